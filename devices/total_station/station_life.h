#pragma once

#include <chrono>
#include <optional>

#include "devices/total_station/total_station.h"

namespace tbm {

// State of the connection and when to open it again, as a function of instants, so that each
// decision can be tested without waiting.
class StationLife {
 public:
  using SteadyTime = TotalStation::SteadyTime;

  StationLife(Duration first_back_off, Duration longest_back_off)
      : first_back_off_(first_back_off),
        longest_back_off_(longest_back_off),
        back_off_(first_back_off) {}

  StationState state() const { return state_; }

  // closed: when opening may be tried; the past means now.
  SteadyTime MayOpenAt() const { return next_opening_; }

  void Opening() { state_ = StationState::kOpening; }
  void OpeningFailed(SteadyTime now);
  // The instrument has answered and is set up. Whether it is a reconnection.
  bool Ready();
  void Answered();
  void NotAnswered();
  void Lost(SteadyTime now);

 private:
  const Duration first_back_off_;
  const Duration longest_back_off_;
  StationState state_ = StationState::kClosed;
  SteadyTime next_opening_{};
  Duration back_off_;
  bool was_ready_ = false;
};

}  // namespace tbm
