#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "idl/cpp/bounded_text.h"
#include "pose/base/fixed_vector.h"
#include "pose/base/pose_reason.h"
#include "pose/base/time.h"
#include "pose/centres/centre.h"
#include "pose/geometry/rigid3.h"
#include "pose/geometry/tilt.h"

// What goes over DDS, in the words of the house. One struct per topic; idl/README.md has the table.
// All are plain values without heap. Numbers start as NaN: what nobody fills in is not zero.
namespace tbm::dds {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
inline constexpr std::size_t kMaxSpots = kMaxCentres;
inline constexpr std::size_t kMaxPoints = 16;

using MachineId = BoundedText<32>;
using ReasonText = BoundedText<48>;  // a code of idl/README.md, "Reasons"

// One spot of a frame. Numbers of `centre` that could not be measured are NaN.
struct Spot {
  Centre centre;
  int led_index = -1;  // into Rig::leds; -1: no LED's spot
};

// What was seen in one camera frame; sent also when the image was unusable.
struct FrameFeatures {
  MachineId machine_id;
  Timestamp sensed_at;             // middle of the exposure
  Timestamp published_at;          // when handed to DDS
  std::uint64_t frame_number = 0;  // the camera's own count
  double exposure_s = kNaN;
  PoseReason reason = PoseReason::kNone;  // why the image was unusable
  double background_dn = kNaN;
  double noise_dn = kNaN;
  std::uint32_t rejected_spots = 0;
  std::uint32_t dropped_spots = 0;
  std::uint64_t frames_received = 0;  // these four since the process began
  std::uint64_t frames_lost = 0;
  std::uint64_t frames_damaged = 0;
  std::uint64_t frames_skipped = 0;
  FixedVector<Spot, kMaxSpots> spots;  // brightest first
};

enum class Validity {
  kInvalid,   // no number in it means anything; see the reason
  kDegraded,  // usable with its sigma; see the reason
  kValid,
};

// One reading of one inclinometer.
struct TiltReading {
  MachineId machine_id;
  BoundedText<16> sensor;  // "target" or "camera"
  Timestamp sensed_at;
  Timestamp published_at;
  std::uint64_t sample_number = 0;  // from 1, per sensor
  Validity validity = Validity::kInvalid;
  ReasonText reason;  // empty when valid
  Inclination inclination{kNaN, kNaN};
  double sigma_rad = kNaN;  // of each angle, of this sample
};

// A named point of the front shield.
struct PosePoint {
  BoundedText<32> name;
  Eigen::Vector3d p_in_camera = Eigen::Vector3d::Constant(kNaN);  // [m]
  double sigma_m = kNaN;                                          // one sigma of the 3-D distance
  std::optional<double> bound_m;  // protection level; empty: nothing limits the error
};

// How the target stands to the camera; sent for each exposure, also when no pose could be solved.
// With status kNone the pose, its covariance and all numbers about it are NaN, whatever they were
// set to, and there are no points.
struct RelativePose {
  MachineId machine_id;
  Timestamp sensed_at;              // middle of the exposure
  Timestamp published_at;           // when handed to DDS
  std::uint64_t sample_number = 0;  // from 1
  BoundedText<64> rig_hash;         // hexadecimal
  PoseStatus status = PoseStatus::kNone;
  PoseReason reason = PoseReason::kNone;  // kNone exactly when status is kOk
  Rigid3 camera_from_target{Eigen::Quaterniond(kNaN, kNaN, kNaN, kNaN),
                            Eigen::Vector3d::Constant(kNaN)};
  PoseCovariance covariance = PoseCovariance::Constant(kNaN);  // order: rigid3.h
  std::uint32_t leds_used = 0;      // bit i: rig LED i is in the solution
  std::optional<int> excluded_led;  // rig LED index whose centre was left out
  bool tilts_used = false;
  double chi2 = kNaN;      // NaN also for methods without a noise model
  std::optional<int> dof;  // of chi2
  double rms_px = kNaN;
  FixedVector<PosePoint, kMaxPoints> points;  // in the order of Rig::points
};

enum class DeviceState { kClosed, kOpening, kStreaming, kSilent, kFault };

// The word as it stands in logs and on screens: "streaming".
constexpr std::string_view StateCode(DeviceState state) {
  switch (state) {
    case DeviceState::kClosed:
      return "closed";
    case DeviceState::kOpening:
      return "opening";
    case DeviceState::kStreaming:
      return "streaming";
    case DeviceState::kSilent:
      return "silent";
    case DeviceState::kFault:
      return "fault";
  }
  return "";
}

// How one device is. Sent at every change and once a second.
struct DeviceHealth {
  MachineId machine_id;
  BoundedText<32> device_id;  // as in the config
  Timestamp published_at;
  DeviceState state = DeviceState::kClosed;
  Timestamp state_since;
  std::uint64_t samples_good = 0;  // these four since the process began
  std::uint64_t samples_lost = 0;
  std::uint64_t errors = 0;
  std::uint64_t reconnects = 0;
  BoundedText<128> detail;  // a sentence for the foreman; empty when all is well
};

enum class Severity { kInfo, kWarning, kAlarm };

// Same for a severity: "alarm".
constexpr std::string_view SeverityCode(Severity severity) {
  switch (severity) {
    case Severity::kInfo:
      return "info";
    case Severity::kWarning:
      return "warning";
    case Severity::kAlarm:
      return "alarm";
  }
  return "";
}

// Something that happened, or an alarm that came or went.
struct Event {
  MachineId machine_id;
  BoundedText<32> source;  // process or device
  BoundedText<48> code;
  Timestamp at;
  std::uint64_t sample_number = 0;  // from 1, per source
  Severity severity = Severity::kInfo;
  bool active = false;  // the cause stands; false: it is gone, or was an instant
  BoundedText<200> text;
};

// Same key on the wire: two samples about one and the same thing.
inline bool SameKey(const FrameFeatures& a, const FrameFeatures& b) {
  return a.machine_id == b.machine_id;
}
inline bool SameKey(const TiltReading& a, const TiltReading& b) {
  return a.machine_id == b.machine_id && a.sensor == b.sensor;
}
inline bool SameKey(const RelativePose& a, const RelativePose& b) {
  return a.machine_id == b.machine_id;
}
inline bool SameKey(const DeviceHealth& a, const DeviceHealth& b) {
  return a.machine_id == b.machine_id && a.device_id == b.device_id;
}
inline bool SameKey(const Event& a, const Event& b) {
  return a.machine_id == b.machine_id && a.source == b.source && a.code == b.code;
}

}  // namespace tbm::dds
