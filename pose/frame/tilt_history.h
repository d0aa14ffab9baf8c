#pragma once

#include <cstddef>

#include "pose/base/fixed_vector.h"
#include "pose/base/pose_reason.h"
#include "pose/base/result.h"
#include "pose/base/time.h"
#include "pose/geometry/tilt.h"
#include "pose/rig/rig.h"
#include "pose/solve/problem.h"

namespace tbm {

enum class TiltSensor { kTarget = 0, kCamera = 1 };

// One reading as the instrument gave it, before the rig's `sign` is applied. Not finite when the
// instrument said so.
struct TiltReading {
  Timestamp sensed_at;
  TiltSensor sensor = TiltSensor::kTarget;
  Inclination inclination;
};

struct TiltHistoryOptions {
  // A frame further than this from the nearest reading has no tilt. Drilling moves a shield by its
  // tilt sigma in about this time.
  Duration max_age = std::chrono::milliseconds(100);
  // The recent noise is judged over this long, from the differences of neighbouring readings.
  Duration noise_window = std::chrono::milliseconds(1000);
  // Pairs further apart than this say more about motion than about noise.
  Duration noise_pair_max = std::chrono::milliseconds(60);
};

// The latest readings of one inclinometer, and what it read in the middle of an exposure. Computes
// only: the same readings and the same question give the same answer.
class TiltHistory {
 public:
  explicit TiltHistory(const TiltHistoryOptions& options = {}) : options_(options) {}

  // Readings may come late or twice with one stamp; they are kept in the order of their stamps, an
  // equal stamp replaces the older entry. One that is older than the newest by more than
  // kClockSetBack begins a new history.
  void Add(Timestamp sensed_at, const Inclination& inclination);

  // The tilt at `at`, in the paper's convention (sign applied), linearly interpolated between its
  // neighbours, or the nearest one when there is a neighbour on one side only. Sigma is the rig's,
  // or the scatter of the recent readings where that is significantly larger (vibration).
  // Errors: kTiltMissing (no reading at all), kTiltStale (none within max_age), kTiltNotFinite,
  // kTiltOutOfRange.
  Result<TiltObservation, PoseReason> At(Timestamp at, const TiltMount& mount) const;

  // The latest readings, oldest first.
  struct Entry {
    Timestamp sensed_at;
    Inclination inclination;
  };
  const FixedVector<Entry, 64>& entries() const { return entries_; }
  void Clear() { entries_.clear(); }

 private:
  double SigmaAt(Timestamp at, double rig_sigma_rad) const;

  TiltHistoryOptions options_;
  FixedVector<Entry, 64> entries_;
};

}  // namespace tbm
