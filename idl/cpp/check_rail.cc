#include <cmath>

#include "idl/cpp/check_numbers.h"
#include "idl/cpp/convert.h"

// The rules of the contract for the topics of the rail line.
namespace tbm::dds {
namespace {

template <std::size_t N>
bool NoneNegative(const std::array<double, N>& numbers) {
  for (const double x : numbers) {
    if (!(x >= 0.0)) return false;
  }
  return true;
}

bool IsEmpty(const v1::TrolleyState& wire) {
  return AllNaN(wire.position_world_m()) && AllNaN(wire.sigma_position_m()) &&
         AllNaN(wire.velocity_world_m_per_s()) && AllNaN(wire.sigma_velocity_m_per_s()) &&
         AllNaN(wire.sigma_attitude_rad()) && AllNaN(wire.gyro_bias_rad_per_s()) &&
         AllNaN(wire.sigma_gyro_bias_rad_per_s()) && AllNaN(wire.accel_bias_m_per_s2()) &&
         AllNaN(wire.sigma_accel_bias_m_per_s2()) &&
         AllNaN({wire.world_from_imu_qw(),
                 wire.world_from_imu_qx(),
                 wire.world_from_imu_qy(),
                 wire.world_from_imu_qz(),
                 wire.distance_m()});
}

bool IsFinite(const v1::TrolleyState& wire) {
  return AllFinite(wire.position_world_m()) && AllFinite(wire.sigma_position_m()) &&
         AllFinite(wire.velocity_world_m_per_s()) && AllFinite(wire.sigma_velocity_m_per_s()) &&
         AllFinite(wire.sigma_attitude_rad()) && AllFinite(wire.gyro_bias_rad_per_s()) &&
         AllFinite(wire.sigma_gyro_bias_rad_per_s()) && AllFinite(wire.accel_bias_m_per_s2()) &&
         AllFinite(wire.sigma_accel_bias_m_per_s2()) && AllFinite({wire.distance_m()});
}

// `pieces` of a whole, each full but the last.
template <class Wire>
BoundaryFault CheckPiece(const Wire& wire) {
  if (wire.points().size() > kMaxPiecePoints || wire.pieces() > static_cast<int>(kMaxPieces)) {
    return BoundaryFault::kTooLong;
  }
  if (wire.piece() < 1 || wire.pieces() < 1 || wire.points_in_all() < 1 ||
      wire.points_before() < 0) {
    return BoundaryFault::kOutOfRange;
  }
  const auto points = static_cast<std::int64_t>(wire.points().size());
  const std::int64_t up_to_here = wire.points_before() + points;
  const bool is_last = wire.piece() == wire.pieces();
  const bool fits =
      wire.piece() <= wire.pieces() && points > 0 &&
      (wire.piece() == 1) == (wire.points_before() == 0) &&
      (is_last ? up_to_here == wire.points_in_all() : up_to_here < wire.points_in_all());
  return fits ? BoundaryFault::kNone : BoundaryFault::kContradiction;
}

}  // namespace

BoundaryFault Check(const v1::TrolleyState& wire) {
  if (AnyEmpty(wire.machine_id())) return BoundaryFault::kNoKey;
  if (!IsTime(wire.valid_at_utc_ns()) || !IsTime(wire.published_at_utc_ns())) {
    return BoundaryFault::kNoTime;
  }
  if (wire.status() > v1::RAIL_FIXED) return BoundaryFault::kEnumRange;
  if ((wire.status() == v1::RAIL_NONE) == AnyEmpty(wire.reason()) ||
      wire.status() == v1::RAIL_BRIDGED) {
    return BoundaryFault::kContradiction;
  }
  if (!NoneNegative({wire.target_age_s(), wire.tilt_age_s(), wire.rest_age_s()})) {
    return BoundaryFault::kOutOfRange;
  }
  if (wire.status() == v1::RAIL_NONE) {
    return IsEmpty(wire) ? BoundaryFault::kNone : BoundaryFault::kContradiction;
  }
  if (AnyEmpty(wire.run_id())) return BoundaryFault::kContradiction;
  const double length = std::hypot(std::hypot(wire.world_from_imu_qw(), wire.world_from_imu_qx()),
                                   std::hypot(wire.world_from_imu_qy(), wire.world_from_imu_qz()));
  if (!IsFinite(wire) || !std::isfinite(length)) return BoundaryFault::kNotFinite;
  const bool fits =
      std::abs(length - 1.0) <= kUnitTolerance && wire.distance_m() >= 0.0 &&
      NoneNegative(wire.sigma_position_m()) && NoneNegative(wire.sigma_velocity_m_per_s()) &&
      NoneNegative(wire.sigma_attitude_rad()) && NoneNegative(wire.sigma_gyro_bias_rad_per_s()) &&
      NoneNegative(wire.sigma_accel_bias_m_per_s2());
  return fits ? BoundaryFault::kNone : BoundaryFault::kOutOfRange;
}

BoundaryFault Check(const v1::RailLinePiece& wire) {
  if (AnyEmpty(wire.machine_id())) return BoundaryFault::kNoKey;
  if (!IsTime(wire.published_at_utc_ns()) || !IsTime(wire.begins_at_utc_ns()) ||
      !IsTime(wire.ends_at_utc_ns())) {
    return BoundaryFault::kNoTime;
  }
  if (const auto fault = CheckPiece(wire); fault != BoundaryFault::kNone) return fault;
  if (AnyEmpty(wire.run_id(), wire.line_sha256(), wire.method()) ||
      wire.ends_at_utc_ns() < wire.begins_at_utc_ns()) {
    return BoundaryFault::kContradiction;
  }
  double before_m = 0.0;
  for (const v1::RailLinePoint& point : wire.points()) {
    if (point.status() > v1::RAIL_FIXED) return BoundaryFault::kEnumRange;
    if (point.status() == v1::RAIL_NONE) return BoundaryFault::kContradiction;
    if (!AllFinite({point.distance_m()}) || !AllFinite(point.position_world_m()) ||
        !AllFinite(point.sigma_world_m())) {
      return BoundaryFault::kNotFinite;
    }
    if (point.distance_m() < before_m || !NoneNegative(point.sigma_world_m())) {
      return BoundaryFault::kOutOfRange;
    }
    before_m = point.distance_m();
  }
  return BoundaryFault::kNone;
}

BoundaryFault Check(const v1::SettlementPiece& wire) {
  if (AnyEmpty(wire.machine_id())) return BoundaryFault::kNoKey;
  if (!IsTime(wire.published_at_utc_ns())) return BoundaryFault::kNoTime;
  if (const auto fault = CheckPiece(wire); fault != BoundaryFault::kNone) return fault;
  if (AnyEmpty(wire.base_run_id(), wire.later_run_id(), wire.base_sha256(), wire.later_sha256())) {
    return BoundaryFault::kContradiction;
  }
  if (!(wire.level() > 0.0 && wire.level() < 1.0) || wire.highest_alert() < 0) {
    return BoundaryFault::kOutOfRange;
  }
  double before_m = 0.0;
  for (const v1::SettlementPoint& point : wire.points()) {
    if (!AllFinite({point.distance_m()})) return BoundaryFault::kNotFinite;
    if (point.distance_m() < before_m || !NoneInfinite({point.dz_m()}) ||
        !NoneNegative({point.sigma_m()}) || point.alert() < 0) {
      return BoundaryFault::kOutOfRange;
    }
    const bool is_compared = !std::isnan(point.dz_m());
    if (is_compared == std::isnan(point.sigma_m()) || (point.is_significant() && !is_compared) ||
        (point.alert() > 0 && !point.is_significant()) || point.alert() > wire.highest_alert()) {
      return BoundaryFault::kContradiction;
    }
    before_m = point.distance_m();
  }
  return BoundaryFault::kNone;
}

BoundaryFault Check(const v1::CalibrationStatus& wire) {
  if (AnyEmpty(wire.machine_id(), wire.subject())) return BoundaryFault::kNoKey;
  if (!IsTime(wire.published_at_utc_ns()) || !IsTimeOrNever(wire.calibrated_at_utc_ns())) {
    return BoundaryFault::kNoTime;
  }
  if (wire.state() > v1::CALIBRATION_VALID) return BoundaryFault::kEnumRange;
  if (wire.sigmas().size() > kMaxCalibrationSigmas) return BoundaryFault::kTooLong;
  if (!NoneInfinite({wire.age_days()}) || !NoneNegative({wire.due_after_days()})) {
    return BoundaryFault::kOutOfRange;
  }
  for (const v1::CalibrationSigma& sigma : wire.sigmas()) {
    if (AnyEmpty(sigma.what(), sigma.unit())) return BoundaryFault::kContradiction;
    if (!(std::isfinite(sigma.sigma()) && sigma.sigma() >= 0.0)) return BoundaryFault::kOutOfRange;
  }
  const bool is_dated = wire.calibrated_at_utc_ns() != kNeverNs;
  const bool needs_date =
      wire.state() == v1::CALIBRATION_DUE || wire.state() == v1::CALIBRATION_VALID;
  const bool fits = !AnyEmpty(wire.source()) && is_dated == needs_date &&
                    is_dated != std::isnan(wire.age_days()) &&
                    (wire.state() == v1::CALIBRATION_VALID) == AnyEmpty(wire.reason()) &&
                    (wire.state() == v1::CALIBRATION_NONE) == AnyEmpty(wire.file_sha256());
  return fits ? BoundaryFault::kNone : BoundaryFault::kContradiction;
}

}  // namespace tbm::dds
