#pragma once

#include <cstdint>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "idl/cpp/guidance_messages.h"

// The topics of the rail line, in the words of the house; as guidance_messages.h.
namespace tbm::dds {

inline constexpr std::size_t kMaxPiecePoints = 128;
inline constexpr std::size_t kMaxPieces = 256;
inline constexpr std::size_t kMaxCalibrationSigmas = 8;

using RunId = BoundedText<64>;
using Sha256Text = BoundedText<64>;  // hexadecimal

enum class RailPointStatus { kNone, kGap, kOpen, kBridged, kFixed };

// Where the trolley is now; with kNone all numbers but the ages are NaN, whatever they were set to.
struct TrolleyState {
  MachineId machine_id;
  Timestamp valid_at;
  Timestamp published_at;
  std::uint64_t sample_number = 0;
  RunId run_id;
  RailPointStatus status = RailPointStatus::kNone;
  ReasonText reason;
  Eigen::Vector3d position_world_m = blank::kVector3;
  Eigen::Vector3d sigma_position_m = blank::kVector3;
  Eigen::Vector3d velocity_world_m_per_s = blank::kVector3;
  Eigen::Vector3d sigma_velocity_m_per_s = blank::kVector3;
  Eigen::Quaterniond world_from_imu{kNaN, kNaN, kNaN, kNaN};
  Eigen::Vector3d sigma_attitude_rad = blank::kVector3;
  Eigen::Vector3d gyro_bias_rad_per_s = blank::kVector3;
  Eigen::Vector3d sigma_gyro_bias_rad_per_s = blank::kVector3;
  Eigen::Vector3d accel_bias_m_per_s2 = blank::kVector3;
  Eigen::Vector3d sigma_accel_bias_m_per_s2 = blank::kVector3;
  double distance_m = kNaN;
  double target_age_s = kNaN;
  double tilt_age_s = kNaN;
  double rest_age_s = kNaN;
  std::uint64_t came_too_late = 0;
  std::uint64_t gaps = 0;

  bool operator==(const TrolleyState& other) const = default;
};

struct RailLinePoint {
  double distance_m = kNaN;
  Eigen::Vector3d position_world_m = blank::kVector3;
  Eigen::Vector3d sigma_world_m = blank::kVector3;
  RailPointStatus status = RailPointStatus::kNone;

  bool operator==(const RailLinePoint&) const = default;
};

// Part of a finished line.
struct RailLinePiece {
  MachineId machine_id;
  std::int32_t piece = 0;
  Timestamp published_at;
  RunId run_id;
  Sha256Text line_sha256;
  BoundedText<16> method;
  Timestamp begins_at;
  Timestamp ends_at;
  std::int32_t pieces = 0;
  std::int32_t points_in_all = 0;
  std::int32_t points_before = 0;
  FixedVector<RailLinePoint, kMaxPiecePoints> points;

  bool operator==(const RailLinePiece&) const = default;
};

struct SettlementPoint {
  double distance_m = kNaN;
  double dz_m = kNaN;
  double sigma_m = kNaN;
  bool is_significant = false;
  std::int32_t alert = 0;

  bool operator==(const SettlementPoint&) const = default;
};

// Part of a finished line's comparison with an earlier one.
struct SettlementPiece {
  MachineId machine_id;
  std::int32_t piece = 0;
  Timestamp published_at;
  RunId base_run_id;
  RunId later_run_id;
  Sha256Text base_sha256;
  Sha256Text later_sha256;
  double level = kNaN;
  std::int32_t highest_alert = 0;
  std::int32_t pieces = 0;
  std::int32_t points_in_all = 0;
  std::int32_t points_before = 0;
  FixedVector<SettlementPoint, kMaxPiecePoints> points;

  bool operator==(const SettlementPiece&) const = default;
};

enum class CalibrationState { kNone, kUndated, kDue, kValid };

struct CalibrationSigma {
  BoundedText<32> what;
  double sigma = kNaN;
  BoundedText<8> unit;

  bool operator==(const CalibrationSigma&) const = default;
};

// One calibration that a process works with.
struct CalibrationStatus {
  MachineId machine_id;
  BoundedText<32> subject;
  BoundedText<32> source;
  Timestamp published_at;
  CalibrationState state = CalibrationState::kNone;
  ReasonText reason;
  Timestamp calibrated_at = kNever;
  double age_days = kNaN;
  double due_after_days = kNaN;
  Sha256Text file_sha256;
  FixedVector<CalibrationSigma, kMaxCalibrationSigmas> sigmas;

  bool operator==(const CalibrationStatus&) const = default;
};

inline bool SameKey(const TrolleyState& a, const TrolleyState& b) {
  return a.machine_id == b.machine_id;
}
inline bool SameKey(const RailLinePiece& a, const RailLinePiece& b) {
  return a.machine_id == b.machine_id && a.piece == b.piece;
}
inline bool SameKey(const SettlementPiece& a, const SettlementPiece& b) {
  return a.machine_id == b.machine_id && a.piece == b.piece;
}
inline bool SameKey(const CalibrationStatus& a, const CalibrationStatus& b) {
  return a.machine_id == b.machine_id && a.subject == b.subject;
}

}  // namespace tbm::dds
