#pragma once

#include "idl/cpp/rail_messages.h"

// A message of each topic of the rail line with every field set, each to another value.
namespace tbm::dds::test {

inline TrolleyState FullTrolleyState() {
  TrolleyState m;
  m.machine_id = "machine-19";
  m.valid_at.ns = 1'700'000'000'000'000'801;
  m.published_at.ns = 1'700'000'000'000'000'802;
  m.sample_number = 803'000'000'000;
  m.run_id = "run-19";
  m.status = RailPointStatus::kOpen;
  m.position_world_m = {804.1, -805.2, 806.3};
  m.sigma_position_m = {0.0081, 0.0082, 0.0083};
  m.velocity_world_m_per_s = {0.84, -0.085, 0.0086};
  m.sigma_velocity_m_per_s = {0.00087, 0.00088, 0.00089};
  m.world_from_imu = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.5);
  m.sigma_attitude_rad = {0.00081, 0.00082, 0.00083};
  m.gyro_bias_rad_per_s = {1.1e-5, -1.2e-5, 1.3e-5};
  m.sigma_gyro_bias_rad_per_s = {1.4e-6, 1.5e-6, 1.6e-6};
  m.accel_bias_m_per_s2 = {1.7e-3, -1.8e-3, 1.9e-3};
  m.sigma_accel_bias_m_per_s2 = {2.1e-4, 2.2e-4, 2.3e-4};
  m.distance_m = 80.7;
  m.target_age_s = 8.08;
  m.tilt_age_s = 0.089;
  m.rest_age_s = 81.1;
  m.came_too_late = 812;
  m.gaps = 813;
  return m;
}

inline RailLinePiece FullRailLinePiece() {
  RailLinePiece m;
  m.machine_id = "machine-20";
  m.piece = 3;
  m.published_at.ns = 1'700'000'000'000'000'901;
  m.run_id = "run-20";
  m.line_sha256 = "c123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
  m.method = "smoothed";
  m.begins_at.ns = 1'700'000'000'000'000'902;
  m.ends_at.ns = 1'700'000'000'000'000'903;
  m.pieces = 7;
  m.points_in_all = 900;
  m.points_before = 256;
  for (int i = 0; i < 2; ++i) {
    RailLinePoint point;
    point.distance_m = 90.5 + i;
    point.position_world_m = {906.1 + i, 907.2 + i, 908.3 + i};
    point.sigma_world_m = {0.00091 + i, 0.00092 + i, 0.00093 + i};
    point.status = i == 0 ? RailPointStatus::kBridged : RailPointStatus::kGap;
    m.points.push_back(point);
  }
  return m;
}

inline SettlementPiece FullSettlementPiece() {
  SettlementPiece m;
  m.machine_id = "machine-21";
  m.piece = 2;
  m.published_at.ns = 1'700'000'000'000'001'001;
  m.base_run_id = "run-21";
  m.later_run_id = "run-22";
  m.base_sha256 = "d123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
  m.later_sha256 = "e123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
  m.level = 0.95;
  m.highest_alert = 4;
  m.pieces = 5;
  m.points_in_all = 600;
  m.points_before = 128;
  for (int i = 0; i < 2; ++i) {
    SettlementPoint point;
    point.distance_m = 10.6 + i;
    point.dz_m = -0.0107 + 0.01 * i;
    point.sigma_m = 0.00108 + i;
    point.is_significant = i == 0;
    point.alert = i == 0 ? 3 : 0;
    m.points.push_back(point);
  }
  return m;
}

inline CalibrationStatus FullCalibrationStatus() {
  CalibrationStatus m;
  m.machine_id = "machine-23";
  m.subject = "imu_mounting";
  m.source = "rail_line";
  m.published_at.ns = 1'700'000'000'000'001'101;
  m.state = CalibrationState::kDue;
  m.reason = "overdue";
  m.calibrated_at.ns = 1'690'000'000'000'001'102;
  m.age_days = 115.7;
  m.due_after_days = 90.0;
  m.file_sha256 = "f123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
  for (int i = 0; i < 2; ++i) {
    CalibrationSigma sigma;
    sigma.what = i == 0 ? "camera_rotation" : "camera_position";
    sigma.sigma = 0.0111 + i;
    sigma.unit = i == 0 ? "rad" : "m";
    m.sigmas.push_back(sigma);
  }
  return m;
}

inline bool Same(const TrolleyState& a, const TrolleyState& b) { return a == b; }
inline bool Same(const RailLinePiece& a, const RailLinePiece& b) { return a == b; }
inline bool Same(const SettlementPiece& a, const SettlementPiece& b) { return a == b; }
inline bool Same(const CalibrationStatus& a, const CalibrationStatus& b) { return a == b; }

}  // namespace tbm::dds::test
