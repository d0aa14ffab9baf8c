#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "guidance/station/set_up.h"

namespace tbm {

// What a second look at the references says of the station.
enum class CheckVerdict {
  kGood,            // nothing has moved that these readings could show
  kReferenceMoved,  // exactly one reference disagrees, all others stand
  kStationMoved,    // all references moved alike, as they do when the station moves or turns
  kUnclear,         // something moved, and these readings do not tell what
  kNothingSeen,     // no reference was seen both times
};

struct CheckOptions {
  SightModel sight;
  double gate_risk = 1e-3;  // that an unmoved station and unmoved references are not called good
};

struct ReferenceCheck {
  CheckVerdict verdict = CheckVerdict::kNothingSeen;
  double chi2 = 0.0;  // of "nothing has moved"
  int dof = 0;
  std::optional<int> moved_reference;  // with kReferenceMoved
  // How the station has moved since the set-up, fitted to all differences: east, north, up [m],
  // circle zero [rad]; only with kStationMoved.
  std::optional<Eigen::Vector4d> station_shift;
  StationCovariance shift_covariance = StationCovariance::Zero();
  // Largest standardised difference of the values; the smallest station shift across and along
  // that would not have passed as good is told by `sees_m`.
  double largest_standardised = 0.0;
  // A shift of the station in the worst horizontal direction that this check finds in 95 of 100
  // cases. Empty where no shift would be found.
  std::optional<double> sees_m;
};

// Compares readings with those of the set-up on the same references. The references' own errors
// and the station's are in both and cancel: what is left is the noise of two readings.
//
// `then` and `now` may hold several sightings of one reference; each of `now` is compared with the
// mean of `then`.
ReferenceCheck CheckReferences(const Station& station,
                               std::span<const Reference> references,
                               std::span<const ReferenceSighting> then,
                               std::span<const ReferenceSighting> now,
                               const CheckOptions& options);

}  // namespace tbm
