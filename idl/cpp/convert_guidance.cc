#include "idl/cpp/convert.h"
#include "idl/cpp/fields.h"

namespace tbm::dds {

template <class Way, class M, class W, Only<StationObservation, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.machine_id, w.machine_id());
  way(m.station, w.station());
  way(m.sensed_at, w.sensed_at_utc_ns());
  way(m.published_at, w.published_at_utc_ns());
  way(m.sample_number, w.sample_number());
  way(m.set_up_number, w.set_up_number());
  way(m.cycle_number, w.cycle_number());
  way(m.kind, w.kind());
  way(m.target, w.target());
  way(m.face, w.face());
  way(m.status, w.status());
  way(m.reason, w.reason());
  way(m.sensed_within_s, w.sensed_within_s());
  way(m.circle_rad, w.circle_rad());
  way(m.zenith_rad, w.zenith_rad());
  way(m.slope_m, w.slope_m());
  way(m.prism_constant_m, w.prism_constant_m());
  way(m.ppm, w.ppm());
  way(m.position_in_site_m, w.position_in_site_m());
  way(m.covariance_of_reading_m2, w.covariance_of_reading_m2());
  way(m.by_station, w.by_station());
}

template <class Way, class M, class W, Only<ReferenceState, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.name, w.name());
  way(m.position_in_site_m, w.position_in_site_m());
  way(m.used, w.used());
  way(m.reason, w.reason());
  way(m.across_m, w.across_m());
  way(m.up_m, w.up_m());
  way(m.slope_m, w.slope_m());
  way(m.standardised, w.standardised());
  way(m.checked_share, w.checked_share());
}

template <class Way, class M, class W, Only<StationSetUp, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.machine_id, w.machine_id());
  way(m.role, w.role());
  way(m.station, w.station());
  way(m.published_at, w.published_at_utc_ns());
  way(m.set_up_number, w.set_up_number());
  way(m.state, w.state());
  way(m.reason, w.reason());
  way(m.set_up_at, w.set_up_at_utc_ns());
  way(m.last_good_check_at, w.last_good_check_at_utc_ns());
  way(m.position_in_site_m, w.position_in_site_m());
  way(m.circle_zero_bearing_rad, w.circle_zero_bearing_rad());
  way(m.covariance, w.covariance());
  way(m.chi2, w.chi2());
  way(m.dof, w.dof());
  way(m.sees_m, w.sees_m());
  way(m.closure_m, w.closure_m());
  way(m.closure_worst_m, w.closure_worst_m());
  way(m.closure_tolerance_m, w.closure_tolerance_m());
  way(m.closure_points, w.closure_points());
  way(m.references, w.references());
}

// A transform is four numbers and a vector on the wire.
template <class W>
void Quaternion(const Outward&, const Eigen::Quaterniond& from, W& w) {
  w.site_from_shield_qw(from.w());
  w.site_from_shield_qx(from.x());
  w.site_from_shield_qy(from.y());
  w.site_from_shield_qz(from.z());
}
template <class W>
void Quaternion(const Inward&, Eigen::Quaterniond& to, const W& w) {
  to = Eigen::Quaterniond(w.site_from_shield_qw(),
                          w.site_from_shield_qx(),
                          w.site_from_shield_qy(),
                          w.site_from_shield_qz());
}

template <class Way, class M, class W, Only<ShieldPose, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.machine_id, w.machine_id());
  way(m.shield, w.shield());
  way(m.valid_at, w.valid_at_utc_ns());
  way(m.published_at, w.published_at_utc_ns());
  way(m.sample_number, w.sample_number());
  way(m.validity, w.validity());
  way(m.reason, w.reason());
  way(m.age_s, w.age_s());
  Quaternion(way, m.site_from_shield.rotation, w);
  way(m.site_from_shield.translation, w.position_in_site_m());
  way(m.covariance, w.covariance());
  way(m.speed_m_per_s, w.speed_m_per_s());
  way(m.speed_sigma_m_per_s, w.speed_sigma_m_per_s());
  way(m.heading_rad, w.heading_rad());
  way(m.pitch_rad, w.pitch_rad());
  way(m.roll_rad, w.roll_rad());
  way(m.heading_sigma_rad, w.heading_sigma_rad());
  way(m.pitch_sigma_rad, w.pitch_sigma_rad());
  way(m.roll_sigma_rad, w.roll_sigma_rad());
}

template <class Way, class M, class W, Only<GuidedPoint, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.name, w.name());
  way(m.shield, w.shield());
  way(m.validity, w.validity());
  way(m.reason, w.reason());
  way(m.position_in_site_m, w.position_in_site_m());
  way(m.position_sigma_m, w.position_sigma_m());
  way(m.chainage_m, w.chainage_m());
  way(m.official_chainage_m, w.official_chainage_m());
  way(m.official_section, w.official_section());
  way(m.chainage_sigma_m, w.chainage_sigma_m());
  way(m.deviation_right_m, w.deviation_right_m());
  way(m.deviation_up_m, w.deviation_up_m());
  way(m.deviation_right_sigma_m, w.deviation_right_sigma_m());
  way(m.deviation_up_sigma_m, w.deviation_up_sigma_m());
  way(m.right_up_correlation, w.right_up_correlation());
  way(m.trend_right_per_m, w.trend_right_per_m());
  way(m.trend_up_per_m, w.trend_up_per_m());
  way(m.trend_right_sigma_per_m, w.trend_right_sigma_per_m());
  way(m.trend_up_sigma_per_m, w.trend_up_sigma_per_m());
  way(m.trend_length_m, w.trend_length_m());
}

template <class Way, class M, class W, Only<PredictedDeviation, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.ahead_m, w.ahead_m());
  way(m.deviation_right_m, w.deviation_right_m());
  way(m.deviation_up_m, w.deviation_up_m());
  way(m.deviation_right_sigma_m, w.deviation_right_sigma_m());
  way(m.deviation_up_sigma_m, w.deviation_up_sigma_m());
}

template <class Way, class M, class W, Only<GuidanceSource, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.name, w.name());
  way(m.freshness, w.freshness());
  way(m.age_s, w.age_s());
  way(m.reason, w.reason());
}

template <class Way, class M, class W, Only<Guidance, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.machine_id, w.machine_id());
  way(m.valid_at, w.valid_at_utc_ns());
  way(m.published_at, w.published_at_utc_ns());
  way(m.sample_number, w.sample_number());
  way(m.validity, w.validity());
  way(m.reason, w.reason());
  way(m.axis_name, w.axis_name());
  way(m.axis_sha256, w.axis_sha256());
  way(m.machine_sha256, w.machine_sha256());
  way(m.set_up_number, w.set_up_number());
  way(m.lead_right_per_m, w.lead_right_per_m());
  way(m.lead_up_per_m, w.lead_up_per_m());
  way(m.lead_right_sigma_per_m, w.lead_right_sigma_per_m());
  way(m.lead_up_sigma_per_m, w.lead_up_sigma_per_m());
  way(m.articulation_right_rad, w.articulation_right_rad());
  way(m.articulation_up_rad, w.articulation_up_rad());
  way(m.articulation_roll_rad, w.articulation_roll_rad());
  way(m.articulation_right_sigma_rad, w.articulation_right_sigma_rad());
  way(m.articulation_up_sigma_rad, w.articulation_up_sigma_rad());
  way(m.articulation_roll_sigma_rad, w.articulation_roll_sigma_rad());
  way(m.stroke_m, w.stroke_m());
  way(m.stroke_sigma_m, w.stroke_sigma_m());
  way(m.ring_number, w.ring_number());
  way(m.prisms_used, w.prisms_used());
  way(m.prisms_chi2, w.prisms_chi2());
  way(m.prisms_dof, w.prisms_dof());
  way(m.prisms_rms_m, w.prisms_rms_m());
  way(m.prisms_remark, w.prisms_remark());
  way(m.steer_by, w.steer_by());
  way(m.sources, w.sources());
  way(m.points, w.points());
  way(m.ahead, w.ahead());
}

template <class Way, class M, class W, Only<AlarmStatus, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.machine_id, w.machine_id());
  way(m.source, w.source());
  way(m.code, w.code());
  way(m.published_at, w.published_at_utc_ns());
  way(m.phase, w.phase());
  way(m.urgency, w.urgency());
  way(m.since, w.since_utc_ns());
  way(m.raised_at, w.raised_at_utc_ns());
  way(m.raise_number, w.raise_number());
  way(m.times_raised, w.times_raised());
  way(m.value, w.value());
  way(m.raise_above, w.raise_above());
  way(m.clear_below, w.clear_below());
  way(m.unit, w.unit());
  way(m.cause, w.cause());
  way(m.response, w.response());
  way(m.acknowledged_by, w.acknowledged_by());
  way(m.shelved_until, w.shelved_until_utc_ns());
  way(m.shelved_by, w.shelved_by());
  way(m.shelved_because, w.shelved_because());
}

template <class Way, class M, class W, Only<Command, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.machine_id, w.machine_id());
  way(m.request_id, w.request_id());
  way(m.addressee, w.addressee());
  way(m.verb, w.verb());
  way(m.argument, w.argument());
  way(m.by, w.by());
  way(m.because, w.because());
  way(m.issued_at, w.issued_at_utc_ns());
  way(m.expires_at, w.expires_at_utc_ns());
}

template <class Way, class M, class W, Only<CommandReply, M> = 0>
void Fields(const Way& way, M& m, W& w) {
  way(m.machine_id, w.machine_id());
  way(m.request_id, w.request_id());
  way(m.source, w.source());
  way(m.outcome, w.outcome());
  way(m.text, w.text());
  way(m.published_at, w.published_at_utc_ns());
}

namespace {

// The same without its numbers: what stands in a message that promises nothing stays here.
StationObservation Emptied(const StationObservation& m) {
  StationObservation empty;
  empty.machine_id = m.machine_id;
  empty.station = m.station;
  empty.sensed_at = m.sensed_at;
  empty.published_at = m.published_at;
  empty.sample_number = m.sample_number;
  empty.set_up_number = m.set_up_number;
  empty.cycle_number = m.cycle_number;
  empty.kind = m.kind;
  empty.target = m.target;
  empty.face = m.face;
  empty.reason = m.reason;
  return empty;
}
ShieldPose Emptied(const ShieldPose& m) {
  ShieldPose empty;
  empty.machine_id = m.machine_id;
  empty.shield = m.shield;
  empty.valid_at = m.valid_at;
  empty.published_at = m.published_at;
  empty.sample_number = m.sample_number;
  empty.reason = m.reason;
  return empty;
}
GuidedPoint Emptied(const GuidedPoint& m) {
  GuidedPoint empty;
  empty.name = m.name;
  empty.shield = m.shield;
  empty.reason = m.reason;
  return empty;
}

}  // namespace

void ToWire(const StationObservation& message, v1::StationObservation& wire) {
  const bool has_numbers = message.status != ObservationStatus::kNone;
  Fields(Outward{}, has_numbers ? message : Emptied(message), wire);
}
void FromWire(const v1::StationObservation& wire, StationObservation& message) {
  Fields(Inward{}, message, wire);
}

void ToWire(const StationSetUp& message, v1::StationSetUp& wire) {
  Fields(Outward{}, message, wire);
}
void FromWire(const v1::StationSetUp& wire, StationSetUp& message) {
  Fields(Inward{}, message, wire);
}

void ToWire(const ShieldPose& message, v1::ShieldPose& wire) {
  const bool has_numbers = message.validity != Validity::kInvalid;
  Fields(Outward{}, has_numbers ? message : Emptied(message), wire);
}
void FromWire(const v1::ShieldPose& wire, ShieldPose& message) { Fields(Inward{}, message, wire); }

void ToWire(const Guidance& message, v1::Guidance& wire) {
  Fields(Outward{}, message, wire);
  for (std::size_t i = 0; i < message.points.size(); ++i) {
    if (message.points[i].validity == Validity::kInvalid) {
      const GuidedPoint empty = Emptied(message.points[i]);
      Fields(Outward{}, empty, wire.points()[i]);
    }
  }
}
void FromWire(const v1::Guidance& wire, Guidance& message) { Fields(Inward{}, message, wire); }

void ToWire(const AlarmStatus& message, v1::AlarmStatus& wire) { Fields(Outward{}, message, wire); }
void FromWire(const v1::AlarmStatus& wire, AlarmStatus& message) {
  Fields(Inward{}, message, wire);
}

void ToWire(const Command& message, v1::Command& wire) { Fields(Outward{}, message, wire); }
void FromWire(const v1::Command& wire, Command& message) { Fields(Inward{}, message, wire); }

void ToWire(const CommandReply& message, v1::CommandReply& wire) {
  Fields(Outward{}, message, wire);
}
void FromWire(const v1::CommandReply& wire, CommandReply& message) {
  Fields(Inward{}, message, wire);
}

}  // namespace tbm::dds
