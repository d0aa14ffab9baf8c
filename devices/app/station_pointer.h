#pragma once

#include <functional>
#include <optional>

#include "devices/app/station_config.h"
#include "devices/total_station/total_station.h"
#include "pose/base/clock.h"

namespace tbm {

// Carries out one pointing after the other on the instrument, with whatever the line and the
// instrument do in between: what was not carried out is told again, what is unknown is found by a
// fine adjustment, and a distance is only taken with the constants that it was made with.
class StationPointer {
 public:
  // All outlive it. `is_ending` stops the attempts.
  StationPointer(const StationConfig& config,
                 TotalStation& instrument,
                 const Clock& clock,
                 std::function<bool()> is_ending)
      : config_(config), instrument_(instrument), clock_(clock), is_ending_(std::move(is_ending)) {}

  struct Outcome {
    Pointed pointed;
    std::optional<PolarObservation> observation;  // as it came, when it came
    std::optional<StationFault> fault;            // of the last call that failed
    bool is_gone = false;                         // no connection: the pointing may be told again
  };
  Outcome Carry(const Pointing& pointing);

 private:
  std::optional<StationFault> Aim(const Pointing& pointing);
  std::optional<StationFault> FineAdjust();
  // Adds what the instrument has not applied to its distance; false when nobody knows what it has.
  bool Reduce(const StationTarget& target, const PolarObservation& observation, Pointed* pointed);

  const StationConfig& config_;
  TotalStation& instrument_;
  const Clock& clock_;
  const std::function<bool()> is_ending_;
};

}  // namespace tbm
