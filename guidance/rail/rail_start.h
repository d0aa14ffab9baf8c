#pragma once

#include <optional>
#include <vector>

#include "guidance/rail/rail_recording.h"
#include "pose/base/result.h"

namespace tbm {

// A span of time in which the unit stood still.
struct RestSpan {
  Timestamp begins_at;
  Timestamp ends_at;
};

// What the unit shows while it certainly rests: the mean and the spread of its samples.
struct RestSignature {
  Eigen::Vector3d mean_gyro_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_accel_m_s2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma_gyro_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma_accel_m_s2 = Eigen::Vector3d::Zero();
};

enum class RailStartFault {
  kNoImu,          // fewer than a second of samples
  kNoRest,         // start.at_rest_s is less than two seconds
  kMovesAtStart,   // the unit moves while it is said to rest
  kWrongRateUnit,  // the gyros' noise is far from the data sheet's: degrees for radians, or turned
                   // into radians twice
  kTurnsTooFast,   // over the run the gyros turn far more than gravity does: degrees for radians
  kWrongForce,     // the accelerometers do not show gravity: another unit
  kBiasTooLarge,   // a gyro shows more at rest than its data sheet and the Earth allow
  kFrozen,         // an axis shows one and the same number
  kTiltDisagrees,  // the inclinometer's up is not that of the accelerometers
  kNoHeading,      // neither given, nor is a target seen
  kNoTargetFits,   // whatever the heading, the targets do not lie where they should
};

struct RailStartFailure {
  RailStartFault fault = RailStartFault::kNoImu;
  double at_s = 0.0;      // kMovesAtStart: since the first sample
  int axis = 0;           // kFrozen, kBiasTooLarge: gyro x, y, z, accelerometer x, y, z
  double times = 0.0;     // kWrongRateUnit, kWrongForce, kBiasTooLarge: shown over expected;
                          // kTurnsTooFast: the gyros' turning over gravity's
  double off_px = 0.0;    // kNoTargetFits: mean distance
  double off_rad = 0.0;   // kTiltDisagrees: between the two
  double most_rad = 0.0;  // and what is allowed
};

// What the Earth's turning may add to a gyro's bias.
inline constexpr double kEarthRate_rad_s = 7.292115e-5;

// The signature of the rest at the start, or what is wrong with it.
Result<RestSignature, RailStartFailure> FindRestSignature(const RailSetup& setup,
                                                          const RailRecording& recording);

// The attitude at the start: level by the inclinometer (or the accelerometers), heading as given or
// turned until the first images' targets lie where they should. An inclinometer is believed where
// it and the accelerometers agree within four sigma of their bias, its noise and its mounting
// (at least 0.05 degree): angles in another unit or of the other sign do not, unless the start is
// level.
Result<Eigen::Quaterniond, RailStartFailure> FindStartAttitude(const RailSetup& setup,
                                                               const RailRecording& recording,
                                                               const RestSignature& rest);

// Whether the gyros of the whole run turn as gravity does in the axes of the unit: second by second
// and without the turn about the vertical, of which gravity knows nothing. Ten times as much is no
// motion of a trolley. A run that hardly turns tells nothing and passes.
std::optional<RailStartFailure> FindTurnsTooFast(const RailSetup& setup,
                                                 const RailRecording& recording,
                                                 const RestSignature& rest);

// Later spans of at least a second in which the unit shows nothing but its noise. That is rest, or
// an even motion on an even rail: the filter decides (UpdateByRest).
std::vector<RestSpan> FindQuietSpans(const RailSetup& setup,
                                     const RailRecording& recording,
                                     const RestSignature& rest);

}  // namespace tbm
