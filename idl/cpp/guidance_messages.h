#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string_view>

#include <Eigen/Core>

#include "idl/cpp/bounded_text.h"
#include "idl/cpp/messages.h"
#include "pose/base/fixed_vector.h"
#include "pose/base/time.h"
#include "pose/geometry/rigid3.h"

// The topics from the total station to the operator, in the words of the house. Members are named
// as in the .idl files, which say what they mean; a Timestamp stands for the field of that name
// with
// `_utc_ns`. Numbers start as NaN, times as kNever.
namespace tbm::dds {

inline constexpr Timestamp kNever{-1};
inline constexpr std::size_t kMaxReferences = 16;
inline constexpr std::size_t kMaxSources = 8;
inline constexpr std::size_t kMaxAhead = 20;

namespace blank {
inline const Eigen::Vector3d kVector3 = Eigen::Vector3d::Constant(kNaN);
using Matrix3 = Eigen::Matrix3d;
using Matrix4 = Eigen::Matrix4d;
using Matrix34 = Eigen::Matrix<double, 3, 4>;
}  // namespace blank

enum class ObservedKind { kPrism, kReference };
enum class ObservationFace { kOne, kTwo };
enum class ObservationStatus { kNone, kDegraded, kGood };

// One pointing of the total station; with status kNone all numbers are NaN.
struct StationObservation {
  MachineId machine_id;
  BoundedText<32> station;
  Timestamp sensed_at;
  Timestamp published_at;
  std::uint64_t sample_number = 0;
  std::uint64_t set_up_number = 0;
  std::uint64_t cycle_number = 0;
  ObservedKind kind = ObservedKind::kPrism;
  BoundedText<32> target;
  ObservationFace face = ObservationFace::kOne;
  ObservationStatus status = ObservationStatus::kNone;
  ReasonText reason;
  double sensed_within_s = kNaN;
  double circle_rad = kNaN;
  double zenith_rad = kNaN;
  double slope_m = kNaN;
  double prism_constant_m = kNaN;
  double ppm = kNaN;
  Eigen::Vector3d position_in_site_m = blank::kVector3;
  Eigen::Matrix3d covariance_of_reading_m2 = blank::Matrix3::Constant(kNaN);
  Eigen::Matrix<double, 3, 4> by_station = blank::Matrix34::Constant(kNaN);

  bool has_position() const { return position_in_site_m.allFinite(); }
  bool operator==(const StationObservation&) const = default;
};

enum class SetUpState { kNone, kSuspect, kGood };

struct ReferenceState {
  BoundedText<32> name;
  Eigen::Vector3d position_in_site_m = blank::kVector3;
  bool used = false;
  ReasonText reason;
  double across_m = kNaN;
  double up_m = kNaN;
  double slope_m = kNaN;
  double standardised = kNaN;
  double checked_share = kNaN;

  bool operator==(const ReferenceState&) const = default;
};

// Where the total station stands; one for each role: in_use, proposed, previous.
struct StationSetUp {
  MachineId machine_id;
  BoundedText<16> role;
  BoundedText<32> station;
  Timestamp published_at;
  std::uint64_t set_up_number = 0;
  SetUpState state = SetUpState::kNone;
  ReasonText reason;
  Timestamp set_up_at = kNever;
  Timestamp last_good_check_at = kNever;
  Eigen::Vector3d position_in_site_m = blank::kVector3;
  double circle_zero_bearing_rad = kNaN;
  Eigen::Matrix4d covariance = blank::Matrix4::Constant(kNaN);
  double chi2 = kNaN;
  std::int32_t dof = -1;
  double sees_m = kNaN;
  Eigen::Vector3d closure_m = blank::kVector3;
  double closure_worst_m = kNaN;
  double closure_tolerance_m = kNaN;
  std::int32_t closure_points = 0;
  FixedVector<ReferenceState, kMaxReferences> references;

  bool operator==(const StationSetUp&) const = default;
};

// Where one shield is; with kInvalid all numbers are NaN, whatever they were set to.
struct ShieldPose {
  MachineId machine_id;
  BoundedText<8> shield;
  Timestamp valid_at;
  Timestamp published_at;
  std::uint64_t sample_number = 0;
  Validity validity = Validity::kInvalid;
  ReasonText reason;
  double age_s = kNaN;
  Rigid3 site_from_shield{Eigen::Quaterniond(kNaN, kNaN, kNaN, kNaN), blank::kVector3};
  PoseCovariance covariance = PoseCovariance::Constant(kNaN);
  double speed_m_per_s = kNaN;
  double speed_sigma_m_per_s = kNaN;
  double heading_rad = kNaN;
  double pitch_rad = kNaN;
  double roll_rad = kNaN;
  double heading_sigma_rad = kNaN;
  double pitch_sigma_rad = kNaN;
  double roll_sigma_rad = kNaN;

  bool operator==(const ShieldPose&) const = default;
};

struct GuidedPoint {
  BoundedText<32> name;
  BoundedText<8> shield;
  Validity validity = Validity::kInvalid;
  ReasonText reason;
  Eigen::Vector3d position_in_site_m = blank::kVector3;
  double position_sigma_m = kNaN;
  double chainage_m = kNaN;
  double official_chainage_m = kNaN;
  std::int32_t official_section = -1;
  double chainage_sigma_m = kNaN;
  double deviation_right_m = kNaN;
  double deviation_up_m = kNaN;
  double deviation_right_sigma_m = kNaN;
  double deviation_up_sigma_m = kNaN;
  double right_up_correlation = kNaN;
  double trend_right_per_m = kNaN;
  double trend_up_per_m = kNaN;
  double trend_right_sigma_per_m = kNaN;
  double trend_up_sigma_per_m = kNaN;
  double trend_length_m = kNaN;

  bool operator==(const GuidedPoint&) const = default;
};

struct PredictedDeviation {
  double ahead_m = kNaN;
  double deviation_right_m = kNaN;
  double deviation_up_m = kNaN;
  double deviation_right_sigma_m = kNaN;
  double deviation_up_sigma_m = kNaN;

  bool operator==(const PredictedDeviation&) const = default;
};

enum class SourceFreshness { kMissing, kStale, kCoasting, kFresh };

struct GuidanceSource {
  BoundedText<16> name;
  SourceFreshness freshness = SourceFreshness::kMissing;
  double age_s = kNaN;
  ReasonText reason;

  bool operator==(const GuidanceSource&) const = default;
};

// All that the operator steers by.
struct Guidance {
  MachineId machine_id;
  Timestamp valid_at;
  Timestamp published_at;
  std::uint64_t sample_number = 0;
  Validity validity = Validity::kInvalid;
  ReasonText reason;
  BoundedText<64> axis_name;
  BoundedText<64> axis_sha256;
  BoundedText<64> machine_sha256;
  std::uint64_t set_up_number = 0;
  double lead_right_per_m = kNaN;
  double lead_up_per_m = kNaN;
  double lead_right_sigma_per_m = kNaN;
  double lead_up_sigma_per_m = kNaN;
  double articulation_right_rad = kNaN;
  double articulation_up_rad = kNaN;
  double articulation_roll_rad = kNaN;
  double articulation_right_sigma_rad = kNaN;
  double articulation_up_sigma_rad = kNaN;
  double articulation_roll_sigma_rad = kNaN;
  double stroke_m = kNaN;
  double stroke_sigma_m = kNaN;
  std::int32_t ring_number = -1;
  std::int32_t prisms_used = 0;
  double prisms_chi2 = kNaN;
  std::int32_t prisms_dof = -1;
  double prisms_rms_m = kNaN;
  ReasonText prisms_remark;
  BoundedText<32> steer_by;
  FixedVector<GuidanceSource, kMaxSources> sources;
  FixedVector<GuidedPoint, kMaxPoints> points;
  FixedVector<PredictedDeviation, kMaxAhead> ahead;

  bool operator==(const Guidance&) const = default;
};

enum class AlarmPhase { kNormal, kUnacknowledged, kAcknowledged, kReturnedUnacknowledged };
enum class AlarmUrgency { kLow, kMedium, kHigh };

// One alarm of one process, also while it is normal.
struct AlarmStatus {
  MachineId machine_id;
  BoundedText<32> source;
  BoundedText<48> code;
  Timestamp published_at;
  AlarmPhase phase = AlarmPhase::kNormal;
  AlarmUrgency urgency = AlarmUrgency::kMedium;
  Timestamp since = kNever;
  Timestamp raised_at = kNever;
  std::uint64_t raise_number = 0;
  std::uint32_t times_raised = 0;
  double value = kNaN;
  double raise_above = kNaN;
  double clear_below = kNaN;
  BoundedText<8> unit;
  BoundedText<120> cause;
  BoundedText<160> response;
  BoundedText<32> acknowledged_by;
  Timestamp shelved_until = kNever;
  BoundedText<32> shelved_by;
  BoundedText<120> shelved_because;

  bool operator==(const AlarmStatus&) const = default;
};

// What somebody asks a process to do.
struct Command {
  MachineId machine_id;
  BoundedText<36> request_id;
  BoundedText<32> addressee;
  BoundedText<32> verb;
  BoundedText<128> argument;
  BoundedText<32> by;
  BoundedText<120> because;
  Timestamp issued_at;
  Timestamp expires_at;

  bool operator==(const Command&) const = default;
};

enum class CommandOutcome { kAccepted, kDone, kRefused, kFailed };

struct CommandReply {
  MachineId machine_id;
  BoundedText<36> request_id;
  BoundedText<32> source;
  CommandOutcome outcome = CommandOutcome::kRefused;
  BoundedText<200> text;
  Timestamp published_at;

  bool operator==(const CommandReply&) const = default;
};

inline bool SameKey(const StationObservation& a, const StationObservation& b) {
  return a.machine_id == b.machine_id && a.station == b.station;
}
inline bool SameKey(const StationSetUp& a, const StationSetUp& b) {
  return a.machine_id == b.machine_id && a.role == b.role;
}
inline bool SameKey(const ShieldPose& a, const ShieldPose& b) {
  return a.machine_id == b.machine_id && a.shield == b.shield;
}
inline bool SameKey(const Guidance& a, const Guidance& b) { return a.machine_id == b.machine_id; }
inline bool SameKey(const AlarmStatus& a, const AlarmStatus& b) {
  return a.machine_id == b.machine_id && a.source == b.source && a.code == b.code;
}
inline bool SameKey(const Command& a, const Command& b) { return a.machine_id == b.machine_id; }
inline bool SameKey(const CommandReply& a, const CommandReply& b) {
  return a.machine_id == b.machine_id && a.source == b.source;
}

}  // namespace tbm::dds
