#include "idl/cpp/convert.h"
#include "idl/cpp/fields.h"

namespace tbm::dds {

template <class Way, class M, class W, Only<RailLinePoint, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.distance_m, w.distance_m());
  way(m.position_world_m, w.position_world_m());
  way(m.sigma_world_m, w.sigma_world_m());
  way(m.status, w.status());
}

template <class Way, class M, class W, Only<SettlementPoint, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.distance_m, w.distance_m());
  way(m.dz_m, w.dz_m());
  way(m.sigma_m, w.sigma_m());
  way(m.is_significant, w.is_significant());
  way(m.alert, w.alert());
}

template <class Way, class M, class W, Only<CalibrationSigma, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.what, w.what());
  way(m.sigma, w.sigma());
  way(m.unit, w.unit());
}

namespace {

// A rotation is four numbers on the wire.
template <class W>
void Quaternion(const Outward&, const Eigen::Quaterniond& from, W& w) {
  w.world_from_imu_qw(from.w());
  w.world_from_imu_qx(from.x());
  w.world_from_imu_qy(from.y());
  w.world_from_imu_qz(from.z());
}
template <class W>
void Quaternion(const Inward&, Eigen::Quaterniond& to, const W& w) {
  to = Eigen::Quaterniond(
      w.world_from_imu_qw(), w.world_from_imu_qx(), w.world_from_imu_qy(), w.world_from_imu_qz());
}

}  // namespace

template <class Way, class M, class W, Only<TrolleyState, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.machine_id, w.machine_id());
  way(m.valid_at, w.valid_at_utc_ns());
  way(m.published_at, w.published_at_utc_ns());
  way(m.sample_number, w.sample_number());
  way(m.run_id, w.run_id());
  way(m.status, w.status());
  way(m.reason, w.reason());
  way(m.position_world_m, w.position_world_m());
  way(m.sigma_position_m, w.sigma_position_m());
  way(m.velocity_world_m_per_s, w.velocity_world_m_per_s());
  way(m.sigma_velocity_m_per_s, w.sigma_velocity_m_per_s());
  Quaternion(way, m.world_from_imu, w);
  way(m.sigma_attitude_rad, w.sigma_attitude_rad());
  way(m.gyro_bias_rad_per_s, w.gyro_bias_rad_per_s());
  way(m.sigma_gyro_bias_rad_per_s, w.sigma_gyro_bias_rad_per_s());
  way(m.accel_bias_m_per_s2, w.accel_bias_m_per_s2());
  way(m.sigma_accel_bias_m_per_s2, w.sigma_accel_bias_m_per_s2());
  way(m.distance_m, w.distance_m());
  way(m.target_age_s, w.target_age_s());
  way(m.tilt_age_s, w.tilt_age_s());
  way(m.rest_age_s, w.rest_age_s());
  way(m.came_too_late, w.came_too_late());
  way(m.gaps, w.gaps());
}

template <class Way, class M, class W, Only<RailLinePiece, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.machine_id, w.machine_id());
  way(m.piece, w.piece());
  way(m.published_at, w.published_at_utc_ns());
  way(m.run_id, w.run_id());
  way(m.line_sha256, w.line_sha256());
  way(m.method, w.method());
  way(m.begins_at, w.begins_at_utc_ns());
  way(m.ends_at, w.ends_at_utc_ns());
  way(m.pieces, w.pieces());
  way(m.points_in_all, w.points_in_all());
  way(m.points_before, w.points_before());
  way(m.points, w.points());
}

template <class Way, class M, class W, Only<SettlementPiece, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.machine_id, w.machine_id());
  way(m.piece, w.piece());
  way(m.published_at, w.published_at_utc_ns());
  way(m.base_run_id, w.base_run_id());
  way(m.later_run_id, w.later_run_id());
  way(m.base_sha256, w.base_sha256());
  way(m.later_sha256, w.later_sha256());
  way(m.level, w.level());
  way(m.highest_alert, w.highest_alert());
  way(m.pieces, w.pieces());
  way(m.points_in_all, w.points_in_all());
  way(m.points_before, w.points_before());
  way(m.points, w.points());
}

template <class Way, class M, class W, Only<CalibrationStatus, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.machine_id, w.machine_id());
  way(m.subject, w.subject());
  way(m.source, w.source());
  way(m.published_at, w.published_at_utc_ns());
  way(m.state, w.state());
  way(m.reason, w.reason());
  way(m.calibrated_at, w.calibrated_at_utc_ns());
  way(m.age_days, w.age_days());
  way(m.due_after_days, w.due_after_days());
  way(m.file_sha256, w.file_sha256());
  way(m.sigmas, w.sigmas());
}

namespace {

// The same without its numbers: what stands in a state that promises nothing stays here.
TrolleyState Emptied(const TrolleyState& m) {
  TrolleyState empty;
  empty.machine_id = m.machine_id;
  empty.valid_at = m.valid_at;
  empty.published_at = m.published_at;
  empty.sample_number = m.sample_number;
  empty.run_id = m.run_id;
  empty.reason = m.reason;
  empty.target_age_s = m.target_age_s;
  empty.tilt_age_s = m.tilt_age_s;
  empty.rest_age_s = m.rest_age_s;
  empty.came_too_late = m.came_too_late;
  empty.gaps = m.gaps;
  return empty;
}

}  // namespace

void ToWire(const TrolleyState& message, v1::TrolleyState& wire) {
  const bool has_numbers = message.status != RailPointStatus::kNone;
  Fields(Outward{}, has_numbers ? message : Emptied(message), wire);
}
void FromWire(const v1::TrolleyState& wire, TrolleyState& message) {
  Fields(Inward{}, message, wire);
}

void ToWire(const RailLinePiece& message, v1::RailLinePiece& wire) {
  Fields(Outward{}, message, wire);
}
void FromWire(const v1::RailLinePiece& wire, RailLinePiece& message) {
  Fields(Inward{}, message, wire);
}

void ToWire(const SettlementPiece& message, v1::SettlementPiece& wire) {
  Fields(Outward{}, message, wire);
}
void FromWire(const v1::SettlementPiece& wire, SettlementPiece& message) {
  Fields(Inward{}, message, wire);
}

void ToWire(const CalibrationStatus& message, v1::CalibrationStatus& wire) {
  Fields(Outward{}, message, wire);
}
void FromWire(const v1::CalibrationStatus& wire, CalibrationStatus& message) {
  Fields(Inward{}, message, wire);
}

}  // namespace tbm::dds
