#pragma once

#include "idl/cpp/guidance_messages.h"

// As samples.h: one message of each topic in which every field has a value of its own.
namespace tbm::dds::test {

// A covariance with different numbers everywhere, symmetric as far as the boundary can see.
template <class Matrix>
Matrix AnyCovariance(double scale) {
  Matrix m;
  for (int i = 0; i < m.rows(); ++i) {
    for (int j = 0; j < m.cols(); ++j) {
      m(i, j) = scale * ((i == j ? 1.0 * (i + 1) : 1e-2 * (i + j)) +
                         1e-8 * static_cast<double>(m.cols() * i + j));
    }
  }
  return m;
}

inline StationObservation FullStationObservation() {
  StationObservation m;
  m.machine_id = "machine-12";
  m.station = "total_station";
  m.sensed_at.ns = 1'700'000'000'000'000'101;
  m.published_at.ns = 1'700'000'000'000'000'102;
  m.sample_number = 103'000'000'000;
  m.set_up_number = 104;
  m.cycle_number = 105;
  m.kind = ObservedKind::kReference;
  m.target = "ref_3";
  m.face = ObservationFace::kTwo;
  m.status = ObservationStatus::kDegraded;
  m.reason = "not_fully_corrected";
  m.sensed_within_s = 0.106;
  m.circle_rad = 1.07;
  m.zenith_rad = 4.71;
  m.slope_m = 109.25;
  m.prism_constant_m = -0.0344;
  m.ppm = 11.1;
  m.position_in_site_m = {112.1, 113.2, 114.3};
  m.covariance_of_reading_m2 = AnyCovariance<Eigen::Matrix3d>(1e-6);
  for (int i = 0; i < 12; ++i) m.by_station(i / 4, i % 4) = 1.25 + 0.5 * i;
  return m;
}

inline StationSetUp FullStationSetUp() {
  StationSetUp m;
  m.machine_id = "machine-13";
  m.role = "proposed";
  m.station = "total_station";
  m.published_at.ns = 1'700'000'000'000'000'202;
  m.set_up_number = 203;
  m.state = SetUpState::kSuspect;
  m.reason = "station_moved";
  m.set_up_at.ns = 1'700'000'000'000'000'198;
  m.last_good_check_at.ns = 1'700'000'000'000'000'199;
  m.position_in_site_m = {204.1, 205.2, 206.3};
  m.circle_zero_bearing_rad = 2.07;
  m.covariance = AnyCovariance<Eigen::Matrix4d>(2e-6);
  m.chi2 = 20.8;
  m.dof = 209;
  m.sees_m = 0.0021;
  m.closure_m = {0.0022, -0.0023, 0.0024};
  m.closure_worst_m = 0.0025;
  m.closure_tolerance_m = 0.0026;
  m.closure_points = 27;
  for (int i = 0; i < 2; ++i) {
    ReferenceState reference;
    reference.name = i == 0 ? "ref_1" : "ref_2";
    reference.position_in_site_m = {228.1 + i, 229.2 + i, 230.3 + i};
    reference.used = i == 0;
    reference.reason = i == 0 ? "moved" : "left_out";
    reference.across_m = 0.0231 + i;
    reference.up_m = -0.0232 - i;
    reference.slope_m = 0.0233 + i;
    reference.standardised = 2.34 + i;
    reference.checked_share = 0.235 + 0.1 * i;
    m.references.push_back(reference);
  }
  return m;
}

inline ShieldPose FullShieldPose() {
  ShieldPose m;
  m.machine_id = "machine-14";
  m.shield = "front";
  m.valid_at.ns = 1'700'000'000'000'000'301;
  m.published_at.ns = 1'700'000'000'000'000'302;
  m.sample_number = 303'000'000'000;
  m.validity = Validity::kDegraded;
  m.reason = "station_coasting";
  m.age_s = 30.4;
  m.site_from_shield = {Eigen::Quaterniond(0.5, 0.1, -0.7, 0.5), {305.1, 306.2, -307.3}};
  m.covariance = AnyCovariance<PoseCovariance>(3e-6);
  m.speed_m_per_s = 0.0011;
  m.speed_sigma_m_per_s = 0.00012;
  m.heading_rad = -3.1;
  m.pitch_rad = 0.0311;
  m.roll_rad = -0.0312;
  m.heading_sigma_rad = 0.000313;
  m.pitch_sigma_rad = 0.000314;
  m.roll_sigma_rad = 0.000315;
  return m;
}

inline Guidance FullGuidance() {
  Guidance m;
  m.machine_id = "machine-15";
  m.valid_at.ns = 1'700'000'000'000'000'401;
  m.published_at.ns = 1'700'000'000'000'000'402;
  m.sample_number = 403'000'000'000;
  m.validity = Validity::kDegraded;
  m.reason = "camera_coasting";
  m.axis_name = "main tunnel";
  m.axis_sha256 = "a123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
  m.machine_sha256 = "b123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
  m.set_up_number = 404;
  m.lead_right_per_m = 0.00405;
  m.lead_up_per_m = -0.00406;
  m.lead_right_sigma_per_m = 0.000407;
  m.lead_up_sigma_per_m = 0.000408;
  m.articulation_right_rad = 0.00409;
  m.articulation_up_rad = -0.0041;
  m.articulation_roll_rad = 0.00411;
  m.articulation_right_sigma_rad = 0.000412;
  m.articulation_up_sigma_rad = 0.000413;
  m.articulation_roll_sigma_rad = 0.000414;
  m.stroke_m = 0.415;
  m.stroke_sigma_m = 0.00416;
  m.ring_number = 417;
  m.prisms_used = 3;
  m.prisms_chi2 = 4.18;
  m.prisms_dof = 5;
  m.prisms_rms_m = 0.00419;
  m.prisms_remark = "left_out prism_4";
  m.steer_by = "cutter_face";
  for (int i = 0; i < 2; ++i) {
    GuidanceSource source;
    source.name = i == 0 ? "station" : "camera";
    source.freshness = i == 0 ? SourceFreshness::kFresh : SourceFreshness::kCoasting;
    source.age_s = 42.0 + i;
    source.reason = i == 0 ? "inconsistent" : "too_few_leds";
    m.sources.push_back(source);
  }
  for (int i = 0; i < 2; ++i) {
    GuidedPoint point;
    const double more = 30.0 * i;
    point.name = i == 0 ? "cutter_face" : "tail";
    point.shield = i == 0 ? "front" : "rear";
    point.validity = i == 0 ? Validity::kDegraded : Validity::kValid;
    if (i == 0) point.reason = "station_coasting";
    point.position_in_site_m = {430.1 + more, 431.2 + more, 432.3 + more};
    point.position_sigma_m = 0.00433 + more;
    point.chainage_m = 434.4 + more;
    point.official_chainage_m = 435.5 + more;
    point.official_section = 1 + i;
    point.chainage_sigma_m = 0.00436 + more;
    point.deviation_right_m = 0.0437 + more;
    point.deviation_up_m = -0.0438 - more;
    point.deviation_right_sigma_m = 0.00439 + more;
    point.deviation_up_sigma_m = 0.0044 + more;
    point.right_up_correlation = 0.1 + 0.1 * i;
    point.trend_right_per_m = 0.00441 + more;
    point.trend_up_per_m = 0.00442 + more;
    point.trend_right_sigma_per_m = 0.000443 + more;
    point.trend_up_sigma_per_m = 0.000444 + more;
    point.trend_length_m = 4.45 + more;
    m.points.push_back(point);
  }
  for (int i = 0; i < 2; ++i) {
    PredictedDeviation ahead;
    ahead.ahead_m = 1.0 + i;
    ahead.deviation_right_m = 0.046 + i;
    ahead.deviation_up_m = -0.047 - i;
    ahead.deviation_right_sigma_m = 0.0048 + i;
    ahead.deviation_up_sigma_m = 0.0049 + i;
    m.ahead.push_back(ahead);
  }
  return m;
}

inline AlarmStatus FullAlarmStatus() {
  AlarmStatus m;
  m.machine_id = "machine-16";
  m.source = "guidance";
  m.code = "deviation_high";
  m.published_at.ns = 1'700'000'000'000'000'502;
  m.phase = AlarmPhase::kAcknowledged;
  m.urgency = AlarmUrgency::kHigh;
  m.since.ns = 1'700'000'000'000'000'498;
  m.raised_at.ns = 1'700'000'000'000'000'497;
  m.raise_number = 503;
  m.times_raised = 504;
  m.value = 50.5;
  m.raise_above = 50.0;
  m.clear_below = 45.0;
  m.unit = "mm";
  m.cause = "the cutter face is further from the design axis than allowed";
  m.response = "steer back in small steps; tell the shift engineer";
  m.acknowledged_by = "O. Perator";
  m.shelved_until.ns = 1'700'000'000'000'000'505;
  m.shelved_by = "F. Oreman";
  m.shelved_because = "the cover of a prism is being changed";
  return m;
}

inline Command FullCommand() {
  Command m;
  m.machine_id = "machine-17";
  m.request_id = "6f9619ff-8b86-d011-b42d-00c04fc964ff";
  m.addressee = "total_station";
  m.verb = "check_references";
  m.argument = "ref_1 ref_2";
  m.by = "S. Urveyor";
  m.because = "blasting next door";
  m.issued_at.ns = 1'700'000'000'000'000'601;
  m.expires_at.ns = 1'700'000'000'000'000'602;
  return m;
}

inline CommandReply FullCommandReply() {
  CommandReply m;
  m.machine_id = "machine-18";
  m.request_id = "7f9619ff-8b86-d011-b42d-00c04fc964ff";
  m.source = "total_station";
  m.outcome = CommandOutcome::kFailed;
  m.text = "only one reference was seen; the set-up stays suspect";
  m.published_at.ns = 1'700'000'000'000'000'702;
  return m;
}

inline bool Same(const StationObservation& a, const StationObservation& b) { return a == b; }
inline bool Same(const StationSetUp& a, const StationSetUp& b) { return a == b; }
inline bool Same(const ShieldPose& a, const ShieldPose& b) { return a == b; }
inline bool Same(const Guidance& a, const Guidance& b) { return a == b; }
inline bool Same(const AlarmStatus& a, const AlarmStatus& b) { return a == b; }
inline bool Same(const Command& a, const Command& b) { return a == b; }
inline bool Same(const CommandReply& a, const CommandReply& b) { return a == b; }

}  // namespace tbm::dds::test
