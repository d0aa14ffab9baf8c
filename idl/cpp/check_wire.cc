#include <bit>
#include <cmath>

#include "idl/cpp/convert.h"
#include "idl/cpp/reason_table.h"
#include "pose/rig/rig.h"

namespace tbm::dds {
namespace {

constexpr double kHalfTurn_rad = 1.5707963267948966;
constexpr double kUnitTolerance = 1e-6;  // of a quaternion's length: far above rounding

template <class... Keys>
bool AnyEmpty(const Keys&... keys) {
  return ((keys.size() == 0) || ...);
}
bool IsFinite(double x) { return std::isfinite(x); }
bool IsNaN(double x) { return std::isnan(x); }
// NaN ("not measured") or a number that is at least `low`.
bool IsAbsentOrAtLeast(double x, double low) { return IsNaN(x) || (IsFinite(x) && x >= low); }

BoundaryFault CheckSpot(const v1::Spot& spot) {
  if (!IsFinite(spot.u_px()) || !IsFinite(spot.v_px())) return BoundaryFault::kNotFinite;
  const bool numbers_fit =
      IsAbsentOrAtLeast(spot.sigma_px(), 0.0) && IsAbsentOrAtLeast(spot.peak_dn(), 0.0) &&
      (IsNaN(spot.background_dn()) || IsFinite(spot.background_dn())) &&
      IsAbsentOrAtLeast(spot.spread_px(), 0.0) &&
      IsAbsentOrAtLeast(spot.elongation(), 1.0 - 1e-9) && spot.clipped_pixels() >= 0 &&
      spot.led_index() >= -1 && spot.led_index() < kMaxLeds;
  return numbers_fit ? BoundaryFault::kNone : BoundaryFault::kOutOfRange;
}

// A 6x6 covariance: finite, no negative variance, equal to its transpose but for rounding.
BoundaryFault CheckCovariance(const std::array<double, 36>& covariance) {
  for (const double entry : covariance) {
    if (!IsFinite(entry)) return BoundaryFault::kNotFinite;
  }
  for (std::size_t row = 0; row < 6; ++row) {
    if (covariance[row * 7] < 0.0) return BoundaryFault::kOutOfRange;
    for (std::size_t column = 0; column < row; ++column) {
      const double scale = std::sqrt(covariance[row * 7] * covariance[column * 7]);
      const double skew = covariance[row * 6 + column] - covariance[column * 6 + row];
      if (std::abs(skew) > 1e-6 * scale) return BoundaryFault::kOutOfRange;
    }
  }
  return BoundaryFault::kNone;
}

BoundaryFault CheckPoint(const v1::PosePoint& point) {
  if (point.name().size() == 0) return BoundaryFault::kNoKey;
  for (const double coordinate : point.in_camera_m()) {
    if (!IsFinite(coordinate)) return BoundaryFault::kNotFinite;
  }
  if (!IsFinite(point.sigma_m())) return BoundaryFault::kNotFinite;
  if (point.sigma_m() < 0.0 || !IsAbsentOrAtLeast(point.bound_m(), 0.0)) {
    return BoundaryFault::kOutOfRange;
  }
  return BoundaryFault::kNone;
}

// status none: not one number may look like a pose.
BoundaryFault CheckAbsentPose(const v1::RelativePose& wire) {
  bool is_empty = IsNaN(wire.camera_from_target_qw()) && IsNaN(wire.camera_from_target_qx()) &&
                  IsNaN(wire.camera_from_target_qy()) && IsNaN(wire.camera_from_target_qz()) &&
                  IsNaN(wire.chi2()) && IsNaN(wire.rms_px()) && wire.points().empty() &&
                  wire.dof() == -1 && wire.leds_used() == 0 && !wire.tilts_used();
  for (const double entry : wire.camera_from_target_translation_m()) {
    is_empty = is_empty && IsNaN(entry);
  }
  for (const double entry : wire.covariance()) is_empty = is_empty && IsNaN(entry);
  return is_empty ? BoundaryFault::kNone : BoundaryFault::kContradiction;
}

BoundaryFault CheckPresentPose(const v1::RelativePose& wire) {
  const double qw = wire.camera_from_target_qw();
  const double qx = wire.camera_from_target_qx();
  const double qy = wire.camera_from_target_qy();
  const double qz = wire.camera_from_target_qz();
  const double length = std::sqrt(qw * qw + qx * qx + qy * qy + qz * qz);
  if (!IsFinite(length) || !IsFinite(wire.rms_px())) return BoundaryFault::kNotFinite;
  if (std::abs(length - 1.0) > kUnitTolerance) return BoundaryFault::kOutOfRange;
  for (const double entry : wire.camera_from_target_translation_m()) {
    if (!IsFinite(entry)) return BoundaryFault::kNotFinite;
  }
  if (wire.rms_px() < 0.0 || !IsAbsentOrAtLeast(wire.chi2(), 0.0) || wire.dof() < -1) {
    return BoundaryFault::kOutOfRange;
  }
  if (wire.leds_used() == 0) return BoundaryFault::kContradiction;
  if (const auto fault = CheckCovariance(wire.covariance()); fault != BoundaryFault::kNone) {
    return fault;
  }
  for (const v1::PosePoint& point : wire.points()) {
    if (const auto fault = CheckPoint(point); fault != BoundaryFault::kNone) return fault;
  }
  return BoundaryFault::kNone;
}

}  // namespace

BoundaryFault Check(const v1::FrameFeatures& wire) {
  if (AnyEmpty(wire.machine_id())) return BoundaryFault::kNoKey;
  if (wire.sensed_at_utc_ns() <= 0 || wire.published_at_utc_ns() <= 0) {
    return BoundaryFault::kNoTime;
  }
  if (!ReasonFromCode(wire.reason().c_str())) return BoundaryFault::kEnumRange;
  if (!IsAbsentOrAtLeast(wire.exposure_s(), 0.0) || !IsAbsentOrAtLeast(wire.noise_dn(), 0.0) ||
      std::isinf(wire.background_dn())) {
    return BoundaryFault::kOutOfRange;
  }
  if (wire.spots().size() > kMaxSpots) return BoundaryFault::kTooLong;
  for (const v1::Spot& spot : wire.spots()) {
    if (const auto fault = CheckSpot(spot); fault != BoundaryFault::kNone) return fault;
  }
  return BoundaryFault::kNone;
}

BoundaryFault Check(const v1::Inclination& wire) {
  if (AnyEmpty(wire.machine_id(), wire.sensor())) return BoundaryFault::kNoKey;
  if (wire.sensed_at_utc_ns() <= 0 || wire.published_at_utc_ns() <= 0) {
    return BoundaryFault::kNoTime;
  }
  if (wire.validity() > v1::TILT_VALID) return BoundaryFault::kEnumRange;
  if ((wire.validity() == v1::TILT_VALID) != AnyEmpty(wire.reason())) {
    return BoundaryFault::kContradiction;
  }
  if (wire.validity() == v1::TILT_INVALID) {
    const bool is_empty =
        IsNaN(wire.beta_rad()) && IsNaN(wire.gamma_rad()) && IsNaN(wire.sigma_rad());
    return is_empty ? BoundaryFault::kNone : BoundaryFault::kContradiction;
  }
  if (!IsFinite(wire.beta_rad()) || !IsFinite(wire.gamma_rad()) || !IsFinite(wire.sigma_rad())) {
    return BoundaryFault::kNotFinite;
  }
  const bool fits = std::abs(wire.beta_rad()) <= kHalfTurn_rad &&
                    std::abs(wire.gamma_rad()) <= kHalfTurn_rad && wire.sigma_rad() >= 0.0;
  return fits ? BoundaryFault::kNone : BoundaryFault::kOutOfRange;
}

BoundaryFault Check(const v1::RelativePose& wire) {
  if (AnyEmpty(wire.machine_id())) return BoundaryFault::kNoKey;
  if (wire.sensed_at_utc_ns() <= 0 || wire.published_at_utc_ns() <= 0) {
    return BoundaryFault::kNoTime;
  }
  if (wire.status() > v1::POSE_STATUS_OK) return BoundaryFault::kEnumRange;
  const auto reason = ReasonFromWire(wire.reason());
  if (!reason) return BoundaryFault::kEnumRange;
  if (ReasonCode(*reason) != wire.reason_code().c_str()) return BoundaryFault::kContradiction;
  if ((wire.status() == v1::POSE_STATUS_OK) != (*reason == PoseReason::kNone)) {
    return BoundaryFault::kContradiction;
  }
  if (wire.points().size() > kMaxPoints) return BoundaryFault::kTooLong;
  if (wire.leds_used() != static_cast<std::uint32_t>(std::popcount(wire.leds_used_mask()))) {
    return BoundaryFault::kContradiction;
  }
  if (wire.excluded_led_index() < -1 || wire.excluded_led_index() >= kMaxLeds) {
    return BoundaryFault::kOutOfRange;
  }
  return wire.status() == v1::POSE_STATUS_NONE ? CheckAbsentPose(wire) : CheckPresentPose(wire);
}

BoundaryFault Check(const v1::DeviceHealth& wire) {
  if (AnyEmpty(wire.machine_id(), wire.device_id())) return BoundaryFault::kNoKey;
  if (wire.published_at_utc_ns() <= 0 || wire.state_since_utc_ns() <= 0) {
    return BoundaryFault::kNoTime;
  }
  return wire.state() > v1::DEVICE_FAULT ? BoundaryFault::kEnumRange : BoundaryFault::kNone;
}

BoundaryFault Check(const v1::Event& wire) {
  if (AnyEmpty(wire.machine_id(), wire.source(), wire.code())) return BoundaryFault::kNoKey;
  if (wire.at_utc_ns() <= 0) return BoundaryFault::kNoTime;
  return wire.severity() > v1::EVENT_ALARM ? BoundaryFault::kEnumRange : BoundaryFault::kNone;
}

}  // namespace tbm::dds
