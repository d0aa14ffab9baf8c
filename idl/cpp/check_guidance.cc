#include <cmath>

#include "idl/cpp/check_numbers.h"
#include "idl/cpp/convert.h"

// The rules of the contract for the topics from the total station to the operator.
namespace tbm::dds {
namespace {

// Valid exactly when no reason is given.
bool ReasonFits(v1::GuidanceValidity validity, std::size_t reason_length) {
  return (validity == v1::GUIDANCE_VALID) == (reason_length == 0);
}

BoundaryFault CheckReference(const v1::ReferenceState& reference) {
  if (AnyEmpty(reference.name())) return BoundaryFault::kNoKey;
  if (!AllFinite(reference.position_in_site_m())) return BoundaryFault::kNotFinite;
  const bool fits = NoneInfinite({reference.across_m(), reference.up_m(), reference.slope_m()}) &&
                    NoneNegative({reference.standardised(), reference.checked_share()}) &&
                    !(reference.checked_share() > 1.0 + 1e-9);
  return fits ? BoundaryFault::kNone : BoundaryFault::kOutOfRange;
}

BoundaryFault CheckPoint(const v1::GuidedPoint& point) {
  if (AnyEmpty(point.name(), point.shield())) return BoundaryFault::kNoKey;
  if (point.validity() > v1::GUIDANCE_VALID) return BoundaryFault::kEnumRange;
  if (!ReasonFits(point.validity(), point.reason().size())) return BoundaryFault::kContradiction;
  if (point.validity() == v1::GUIDANCE_INVALID) {
    const bool is_empty = AllNaN(point.position_in_site_m()) &&
                          AllNaN({point.position_sigma_m(),
                                  point.chainage_m(),
                                  point.official_chainage_m(),
                                  point.chainage_sigma_m(),
                                  point.deviation_right_m(),
                                  point.deviation_up_m(),
                                  point.deviation_right_sigma_m(),
                                  point.deviation_up_sigma_m(),
                                  point.right_up_correlation(),
                                  point.trend_right_per_m(),
                                  point.trend_up_per_m(),
                                  point.trend_right_sigma_per_m(),
                                  point.trend_up_sigma_per_m(),
                                  point.trend_length_m()}) &&
                          point.official_section() == -1;
    return is_empty ? BoundaryFault::kNone : BoundaryFault::kContradiction;
  }
  if (!AllFinite(point.position_in_site_m()) || !AllFinite({point.position_sigma_m(),
                                                            point.chainage_m(),
                                                            point.official_chainage_m(),
                                                            point.chainage_sigma_m(),
                                                            point.deviation_right_m(),
                                                            point.deviation_right_sigma_m(),
                                                            point.deviation_up_sigma_m()})) {
    return BoundaryFault::kNotFinite;
  }
  const bool fits =
      point.official_section() >= 0 &&
      NoneInfinite({point.deviation_up_m(), point.trend_right_per_m(), point.trend_up_per_m()}) &&
      NoneNegative({point.position_sigma_m(),
                    point.chainage_sigma_m(),
                    point.deviation_right_sigma_m(),
                    point.deviation_up_sigma_m(),
                    point.trend_right_sigma_per_m(),
                    point.trend_up_sigma_per_m(),
                    point.trend_length_m()}) &&
      std::abs(point.right_up_correlation()) <= 1.0 + 1e-9;
  return fits ? BoundaryFault::kNone : BoundaryFault::kOutOfRange;
}

BoundaryFault CheckAhead(const v1::PredictedDeviation& ahead) {
  if (!AllFinite({ahead.ahead_m(), ahead.deviation_right_m(), ahead.deviation_right_sigma_m()})) {
    return BoundaryFault::kNotFinite;
  }
  const bool fits = ahead.ahead_m() > 0.0 && NoneInfinite({ahead.deviation_up_m()}) &&
                    NoneNegative({ahead.deviation_right_sigma_m(), ahead.deviation_up_sigma_m()});
  return fits ? BoundaryFault::kNone : BoundaryFault::kOutOfRange;
}

BoundaryFault CheckSource(const v1::GuidanceSource& source) {
  if (AnyEmpty(source.name())) return BoundaryFault::kNoKey;
  if (source.freshness() > v1::SOURCE_FRESH) return BoundaryFault::kEnumRange;
  if (std::isinf(source.age_s())) return BoundaryFault::kNotFinite;
  return (source.freshness() == v1::SOURCE_MISSING) == std::isnan(source.age_s())
             ? BoundaryFault::kNone
             : BoundaryFault::kContradiction;
}

}  // namespace

BoundaryFault Check(const v1::StationObservation& wire) {
  if (AnyEmpty(wire.machine_id(), wire.station(), wire.target())) return BoundaryFault::kNoKey;
  if (!IsTime(wire.sensed_at_utc_ns()) || !IsTime(wire.published_at_utc_ns())) {
    return BoundaryFault::kNoTime;
  }
  if (wire.kind() > v1::OBSERVED_REFERENCE || wire.face() > v1::OBSERVATION_FACE_TWO ||
      wire.status() > v1::OBSERVATION_GOOD) {
    return BoundaryFault::kEnumRange;
  }
  if ((wire.status() == v1::OBSERVATION_GOOD) != AnyEmpty(wire.reason())) {
    return BoundaryFault::kContradiction;
  }
  const bool has_no_position = AllNaN(wire.position_in_site_m()) &&
                               AllNaN(wire.covariance_of_reading_m2()) && AllNaN(wire.by_station());
  if (wire.status() == v1::OBSERVATION_NONE) {
    const bool is_empty = has_no_position && AllNaN({wire.sensed_within_s(),
                                                     wire.circle_rad(),
                                                     wire.zenith_rad(),
                                                     wire.slope_m(),
                                                     wire.prism_constant_m(),
                                                     wire.ppm()});
    return is_empty ? BoundaryFault::kNone : BoundaryFault::kContradiction;
  }
  if (!AllFinite({wire.circle_rad(), wire.zenith_rad(), wire.sensed_within_s()})) {
    return BoundaryFault::kNotFinite;
  }
  if (!NoneNegative({wire.slope_m(), wire.sensed_within_s()}) ||
      !NoneInfinite({wire.prism_constant_m(), wire.ppm()})) {
    return BoundaryFault::kOutOfRange;
  }
  if (has_no_position) return BoundaryFault::kNone;
  if (wire.set_up_number() == 0 || std::isnan(wire.slope_m())) return BoundaryFault::kContradiction;
  if (!AllFinite(wire.position_in_site_m()) || !AllFinite(wire.by_station())) {
    return BoundaryFault::kNotFinite;
  }
  return CheckCovariance(wire.covariance_of_reading_m2(), 3);
}

BoundaryFault Check(const v1::StationSetUp& wire) {
  if (AnyEmpty(wire.machine_id(), wire.role(), wire.station())) return BoundaryFault::kNoKey;
  if (!IsTime(wire.published_at_utc_ns()) || !IsTimeOrNever(wire.set_up_at_utc_ns()) ||
      !IsTimeOrNever(wire.last_good_check_at_utc_ns())) {
    return BoundaryFault::kNoTime;
  }
  if (wire.state() > v1::SET_UP_GOOD) return BoundaryFault::kEnumRange;
  if (wire.state() != v1::SET_UP_GOOD && AnyEmpty(wire.reason())) {
    return BoundaryFault::kContradiction;
  }
  if (wire.references().size() > kMaxReferences) return BoundaryFault::kTooLong;
  for (const v1::ReferenceState& reference : wire.references()) {
    if (const auto fault = CheckReference(reference); fault != BoundaryFault::kNone) return fault;
  }
  if (!NoneNegative(
          {wire.chi2(), wire.sees_m(), wire.closure_worst_m(), wire.closure_tolerance_m()}) ||
      wire.dof() < -1 || wire.closure_points() < 0) {
    return BoundaryFault::kOutOfRange;
  }
  if (!(AllNaN(wire.closure_m()) || AllFinite(wire.closure_m()))) return BoundaryFault::kNotFinite;
  if (wire.state() == v1::SET_UP_NONE) {
    const bool is_empty = AllNaN(wire.position_in_site_m()) &&
                          AllNaN({wire.circle_zero_bearing_rad()}) && AllNaN(wire.covariance()) &&
                          wire.set_up_number() == 0;
    return is_empty ? BoundaryFault::kNone : BoundaryFault::kContradiction;
  }
  if (wire.set_up_number() == 0 || wire.set_up_at_utc_ns() == kNeverNs) {
    return BoundaryFault::kContradiction;
  }
  if (!AllFinite(wire.position_in_site_m()) || !AllFinite({wire.circle_zero_bearing_rad()})) {
    return BoundaryFault::kNotFinite;
  }
  return CheckCovariance(wire.covariance(), 4);
}

BoundaryFault Check(const v1::ShieldPose& wire) {
  if (AnyEmpty(wire.machine_id(), wire.shield())) return BoundaryFault::kNoKey;
  if (!IsTime(wire.valid_at_utc_ns()) || !IsTime(wire.published_at_utc_ns())) {
    return BoundaryFault::kNoTime;
  }
  if (wire.validity() > v1::GUIDANCE_VALID) return BoundaryFault::kEnumRange;
  if (!ReasonFits(wire.validity(), wire.reason().size())) return BoundaryFault::kContradiction;
  const double qw = wire.site_from_shield_qw();
  const double qx = wire.site_from_shield_qx();
  const double qy = wire.site_from_shield_qy();
  const double qz = wire.site_from_shield_qz();
  if (wire.validity() == v1::GUIDANCE_INVALID) {
    const bool is_empty = AllNaN({qw,
                                  qx,
                                  qy,
                                  qz,
                                  wire.age_s(),
                                  wire.speed_m_per_s(),
                                  wire.speed_sigma_m_per_s(),
                                  wire.heading_rad(),
                                  wire.pitch_rad(),
                                  wire.roll_rad(),
                                  wire.heading_sigma_rad(),
                                  wire.pitch_sigma_rad(),
                                  wire.roll_sigma_rad()}) &&
                          AllNaN(wire.position_in_site_m()) && AllNaN(wire.covariance());
    return is_empty ? BoundaryFault::kNone : BoundaryFault::kContradiction;
  }
  const double length = std::sqrt(qw * qw + qx * qx + qy * qy + qz * qz);
  if (!AllFinite({length, wire.age_s(), wire.heading_rad(), wire.pitch_rad(), wire.roll_rad()}) ||
      !AllFinite(wire.position_in_site_m())) {
    return BoundaryFault::kNotFinite;
  }
  if (std::abs(length - 1.0) > kUnitTolerance ||
      !NoneNegative({wire.speed_sigma_m_per_s(),
                     wire.heading_sigma_rad(),
                     wire.pitch_sigma_rad(),
                     wire.roll_sigma_rad()}) ||
      !NoneInfinite({wire.speed_m_per_s()})) {
    return BoundaryFault::kOutOfRange;
  }
  return CheckCovariance(wire.covariance(), 6);
}

BoundaryFault Check(const v1::Guidance& wire) {
  if (AnyEmpty(wire.machine_id())) return BoundaryFault::kNoKey;
  if (!IsTime(wire.valid_at_utc_ns()) || !IsTime(wire.published_at_utc_ns())) {
    return BoundaryFault::kNoTime;
  }
  if (wire.validity() > v1::GUIDANCE_VALID) return BoundaryFault::kEnumRange;
  if (!ReasonFits(wire.validity(), wire.reason().size())) return BoundaryFault::kContradiction;
  if (!NoneInfinite({wire.lead_right_per_m(),
                     wire.lead_up_per_m(),
                     wire.articulation_right_rad(),
                     wire.articulation_up_rad(),
                     wire.articulation_roll_rad(),
                     wire.stroke_m()}) ||
      !NoneNegative({wire.lead_right_sigma_per_m(),
                     wire.lead_up_sigma_per_m(),
                     wire.articulation_right_sigma_rad(),
                     wire.articulation_up_sigma_rad(),
                     wire.articulation_roll_sigma_rad(),
                     wire.stroke_sigma_m(),
                     wire.prisms_chi2(),
                     wire.prisms_rms_m()}) ||
      wire.ring_number() < -1 || wire.prisms_used() < 0 || wire.prisms_dof() < -1) {
    return BoundaryFault::kOutOfRange;
  }
  if (wire.sources().size() > kMaxSources || wire.points().size() > kMaxPoints ||
      wire.ahead().size() > kMaxAhead) {
    return BoundaryFault::kTooLong;
  }
  for (const v1::GuidanceSource& source : wire.sources()) {
    if (const auto fault = CheckSource(source); fault != BoundaryFault::kNone) return fault;
  }
  for (const v1::GuidedPoint& point : wire.points()) {
    if (const auto fault = CheckPoint(point); fault != BoundaryFault::kNone) return fault;
  }
  for (const v1::PredictedDeviation& ahead : wire.ahead()) {
    if (const auto fault = CheckAhead(ahead); fault != BoundaryFault::kNone) return fault;
  }
  return BoundaryFault::kNone;
}

BoundaryFault Check(const v1::AlarmStatus& wire) {
  if (AnyEmpty(wire.machine_id(), wire.source(), wire.code())) return BoundaryFault::kNoKey;
  if (!IsTime(wire.published_at_utc_ns()) || !IsTimeOrNever(wire.since_utc_ns()) ||
      !IsTimeOrNever(wire.raised_at_utc_ns()) || !IsTimeOrNever(wire.shelved_until_utc_ns())) {
    return BoundaryFault::kNoTime;
  }
  if (wire.phase() > v1::ALARM_RETURNED_UNACKNOWLEDGED || wire.urgency() > v1::ALARM_HIGH) {
    return BoundaryFault::kEnumRange;
  }
  if (!AllFinite({wire.raise_above(), wire.clear_below()})) return BoundaryFault::kNotFinite;
  if (std::isinf(wire.value()) || wire.clear_below() > wire.raise_above()) {
    return BoundaryFault::kOutOfRange;
  }
  const bool is_shelved = wire.shelved_until_utc_ns() != kNeverNs;
  if (is_shelved == AnyEmpty(wire.shelved_by()) || is_shelved == AnyEmpty(wire.shelved_because())) {
    return BoundaryFault::kContradiction;
  }
  const bool was_raised = wire.raised_at_utc_ns() != kNeverNs;
  if (wire.phase() != v1::ALARM_NORMAL && !was_raised) return BoundaryFault::kContradiction;
  return was_raised == (wire.raise_number() > 0) && was_raised == (wire.times_raised() > 0)
             ? BoundaryFault::kNone
             : BoundaryFault::kContradiction;
}

BoundaryFault Check(const v1::Command& wire) {
  if (AnyEmpty(wire.machine_id(), wire.request_id(), wire.addressee(), wire.verb(), wire.by())) {
    return BoundaryFault::kNoKey;
  }
  if (!IsTime(wire.issued_at_utc_ns()) || !IsTime(wire.expires_at_utc_ns())) {
    return BoundaryFault::kNoTime;
  }
  return wire.expires_at_utc_ns() >= wire.issued_at_utc_ns() ? BoundaryFault::kNone
                                                             : BoundaryFault::kContradiction;
}

BoundaryFault Check(const v1::CommandReply& wire) {
  if (AnyEmpty(wire.machine_id(), wire.request_id(), wire.source())) return BoundaryFault::kNoKey;
  if (!IsTime(wire.published_at_utc_ns())) return BoundaryFault::kNoTime;
  return wire.outcome() > v1::COMMAND_FAILED ? BoundaryFault::kEnumRange : BoundaryFault::kNone;
}

}  // namespace tbm::dds
