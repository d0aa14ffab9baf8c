#include "hmi_bridge/core/view_json.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string_view>
#include <utility>

#include "idl/cpp/words.h"
#include "pose/base/angle.h"
#include "pose/geometry/camera_model.h"

namespace tbm::hmi {
namespace {

constexpr double kMm = 1e3;
constexpr double kMmPerM = 1e3;
constexpr double kMmPerMin = 6e4;

// Digits behind the point, for each kind of number.
constexpr int kMmDigits = 2;
constexpr int kMetreDigits = 4;
constexpr int kDegDigits = 4;
constexpr int kSlopeDigits = 3;
constexpr int kPixelDigits = 3;
constexpr int kPlainDigits = 3;

std::string Text(std::string_view text) { return std::string(text); }

Json Millimetres(double value_m) { return Rounded(value_m * kMm, kMmDigits); }
Json Degrees(double value_rad) { return Rounded(RadToDeg(value_rad), kDegDigits); }
Json Metres(double value_m) { return Rounded(value_m, kMetreDigits); }
Json Slope(double value) { return Rounded(value * kMmPerM, kSlopeDigits); }

Json Triple(const Eigen::Vector3d& value, double scale, int digits) {
  if (!value.allFinite()) return nullptr;
  Json triple = Json::array();
  for (int i = 0; i < 3; ++i) triple.push_back(Rounded(value[i] * scale, digits));
  return triple;
}
Json Place(const Eigen::Vector3d& p_in_site_m) { return Triple(p_in_site_m, 1.0, kMetreDigits); }

Json OrNull(std::int32_t value, std::int32_t none) {
  return value == none ? Json(nullptr) : Json(value);
}

Json TimeOrNull(Timestamp stamp) {
  return stamp == dds::kNever ? Json(nullptr) : Json(Milliseconds(stamp));
}

Json LedName(std::optional<int> led, const Rig& rig) {
  if (!led || *led < 0 || *led >= static_cast<int>(rig.leds.size())) return nullptr;
  return rig.leds[static_cast<std::size_t>(*led)].id;
}

Json ViewOf(const dds::GuidedPoint& point) {
  return {{"name", Text(point.name)},
          {"shield", Text(point.shield)},
          {"validity", Text(WordOf(point.validity))},
          {"reason", Text(point.reason)},
          {"right_mm", Millimetres(point.deviation_right_m)},
          {"up_mm", Millimetres(point.deviation_up_m)},
          {"right_sigma_mm", Millimetres(point.deviation_right_sigma_m)},
          {"up_sigma_mm", Millimetres(point.deviation_up_sigma_m)},
          {"correlation", Rounded(point.right_up_correlation, kPlainDigits)},
          {"chainage_m", Metres(point.chainage_m)},
          {"official_chainage_m", Metres(point.official_chainage_m)},
          {"official_section", OrNull(point.official_section, -1)},
          {"chainage_sigma_mm", Millimetres(point.chainage_sigma_m)},
          {"trend_right_mm_per_m", Slope(point.trend_right_per_m)},
          {"trend_up_mm_per_m", Slope(point.trend_up_per_m)},
          {"trend_right_sigma_mm_per_m", Slope(point.trend_right_sigma_per_m)},
          {"trend_up_sigma_mm_per_m", Slope(point.trend_up_sigma_per_m)},
          {"trend_length_m", Rounded(point.trend_length_m, kMmDigits)},
          {"position_in_site_m", Place(point.position_in_site_m)},
          {"position_sigma_mm", Millimetres(point.position_sigma_m)}};
}

Json ViewOf(const dds::GuidanceSource& source) {
  return {{"name", Text(source.name)},
          {"freshness", Text(WordOf(source.freshness))},
          {"age_s", Rounded(source.age_s, kPlainDigits)},
          {"reason", Text(source.reason)}};
}

Json ViewOf(const dds::PredictedDeviation& ahead) {
  return {{"ahead_m", Rounded(ahead.ahead_m, kMmDigits)},
          {"right_mm", Millimetres(ahead.deviation_right_m)},
          {"up_mm", Millimetres(ahead.deviation_up_m)},
          {"right_sigma_mm", Millimetres(ahead.deviation_right_sigma_m)},
          {"up_sigma_mm", Millimetres(ahead.deviation_up_sigma_m)}};
}

Json ViewOf(const dds::ReferenceState& reference) {
  return {{"name", Text(reference.name)},
          {"used", reference.used},
          {"reason", Text(reference.reason)},
          {"across_mm", Millimetres(reference.across_m)},
          {"up_mm", Millimetres(reference.up_m)},
          {"slope_mm", Millimetres(reference.slope_m)},
          {"standardised", Rounded(reference.standardised, kPlainDigits)},
          {"checked_share", Rounded(reference.checked_share, kPlainDigits)},
          {"position_in_site_m", Place(reference.position_in_site_m)}};
}

// Measured minus projected [px]; nothing for a spot that is no LED's, or behind the lens.
std::optional<Eigen::Vector2d> ResidualOf(const dds::Spot& spot,
                                          const dds::RelativePose& pose,
                                          const Rig& rig) {
  if (spot.led_index < 0 || spot.led_index >= static_cast<int>(rig.leds.size())) return {};
  const Led& led = rig.leds[static_cast<std::size_t>(spot.led_index)];
  const auto projected = Project(rig.camera, pose.camera_from_target * led.p_led_in_target);
  if (!projected) return {};
  return spot.centre.pixel_px - projected->pixel_px;
}

Json ViewOf(const dds::Spot& spot, const dds::RelativePose* pose, const Rig& rig) {
  const auto residual = pose == nullptr ? std::nullopt : ResidualOf(spot, *pose, rig);
  return {{"u_px", Rounded(spot.centre.pixel_px.x(), kPixelDigits)},
          {"v_px", Rounded(spot.centre.pixel_px.y(), kPixelDigits)},
          {"sigma_px", Rounded(spot.centre.sigma_px, kPixelDigits)},
          {"peak_dn", Rounded(spot.centre.peak_dn, 1)},
          {"led", LedName(spot.led_index, rig)},
          {"residual_u_px", residual ? Rounded(residual->x(), kPixelDigits) : Json(nullptr)},
          {"residual_v_px", residual ? Rounded(residual->y(), kPixelDigits) : Json(nullptr)}};
}

template <class List>
Json EachOf(const List& list) {
  Json views = Json::array();
  for (const auto& entry : list) views.push_back(ViewOf(entry));
  return views;
}

}  // namespace

Json Rounded(double value, int digits) {
  if (!std::isfinite(value)) return nullptr;
  const double scale = std::pow(10.0, digits);
  const double rounded = std::round(value * scale) / scale;
  return rounded == 0.0 ? 0.0 : rounded;  // no minus zero
}

Json TimingOf(const Arrival& arrival, Timestamp stamp, std::int64_t stale_after_ms) {
  Json timing = {{"stamp_utc_ms", Milliseconds(stamp)},
                 {"heard_steady_ms", arrival.heard_steady_ms},
                 {"stale_after_ms", stale_after_ms}};
  if (arrival.contested) timing["contested"] = true;
  return timing;
}

Json ViewOf(const dds::Guidance& guidance, Json timing) {
  return {{"timing", std::move(timing)},
          {"number", guidance.sample_number},
          {"validity", Text(WordOf(guidance.validity))},
          {"reason", Text(guidance.reason)},
          {"steer_by", Text(guidance.steer_by)},
          {"axis_name", Text(guidance.axis_name)},
          {"axis_sha256", Text(guidance.axis_sha256)},
          {"machine_sha256", Text(guidance.machine_sha256)},
          {"set_up_number", guidance.set_up_number},
          {"lead_right_mm_per_m", Slope(guidance.lead_right_per_m)},
          {"lead_up_mm_per_m", Slope(guidance.lead_up_per_m)},
          {"lead_right_sigma_mm_per_m", Slope(guidance.lead_right_sigma_per_m)},
          {"lead_up_sigma_mm_per_m", Slope(guidance.lead_up_sigma_per_m)},
          {"articulation_right_deg", Degrees(guidance.articulation_right_rad)},
          {"articulation_up_deg", Degrees(guidance.articulation_up_rad)},
          {"articulation_roll_deg", Degrees(guidance.articulation_roll_rad)},
          {"articulation_right_sigma_deg", Degrees(guidance.articulation_right_sigma_rad)},
          {"articulation_up_sigma_deg", Degrees(guidance.articulation_up_sigma_rad)},
          {"articulation_roll_sigma_deg", Degrees(guidance.articulation_roll_sigma_rad)},
          {"stroke_mm", Millimetres(guidance.stroke_m)},
          {"stroke_sigma_mm", Millimetres(guidance.stroke_sigma_m)},
          {"ring_number", OrNull(guidance.ring_number, -1)},
          {"prisms",
           {{"used", guidance.prisms_used},
            {"chi2", Rounded(guidance.prisms_chi2, kPlainDigits)},
            {"dof", OrNull(guidance.prisms_dof, -1)},
            {"rms_mm", Millimetres(guidance.prisms_rms_m)},
            {"remark", Text(guidance.prisms_remark)}}},
          {"sources", EachOf(guidance.sources)},
          {"points", EachOf(guidance.points)},
          {"ahead", EachOf(guidance.ahead)}};
}

Json ViewOf(const dds::ShieldPose& pose, Json timing) {
  return {{"timing", std::move(timing)},
          {"validity", Text(WordOf(pose.validity))},
          {"reason", Text(pose.reason)},
          {"age_s", Rounded(pose.age_s, kPlainDigits)},
          {"heading_deg", Degrees(pose.heading_rad)},
          {"pitch_deg", Degrees(pose.pitch_rad)},
          {"roll_deg", Degrees(pose.roll_rad)},
          {"heading_sigma_deg", Degrees(pose.heading_sigma_rad)},
          {"pitch_sigma_deg", Degrees(pose.pitch_sigma_rad)},
          {"roll_sigma_deg", Degrees(pose.roll_sigma_rad)},
          {"speed_mm_per_min", Rounded(pose.speed_m_per_s * kMmPerMin, kMmDigits)},
          {"speed_sigma_mm_per_min", Rounded(pose.speed_sigma_m_per_s * kMmPerMin, kMmDigits)},
          {"position_in_site_m", Place(pose.site_from_shield.translation)}};
}

Json ViewOf(const dds::TiltReading& tilt, Json timing) {
  return {{"sensor", Text(tilt.sensor)},
          {"timing", std::move(timing)},
          {"validity", Text(WordOf(tilt.validity))},
          {"reason", Text(tilt.reason)},
          {"beta_deg", Degrees(tilt.inclination.beta_rad)},
          {"gamma_deg", Degrees(tilt.inclination.gamma_rad)},
          {"sigma_deg", Degrees(tilt.sigma_rad)}};
}

Json ViewOf(const dds::StationSetUp& set_up, Json timing) {
  const Eigen::Vector4d sigma = set_up.covariance.diagonal().cwiseSqrt();
  return {{"timing", std::move(timing)},
          {"station", Text(set_up.station)},
          {"set_up_number", set_up.set_up_number},
          {"state", Text(WordOf(set_up.state))},
          {"reason", Text(set_up.reason)},
          {"set_up_at_utc_ms", TimeOrNull(set_up.set_up_at)},
          {"last_good_check_at_utc_ms", TimeOrNull(set_up.last_good_check_at)},
          {"position_in_site_m", Place(set_up.position_in_site_m)},
          {"position_sigma_mm", Triple(sigma.head<3>(), kMm, kMmDigits)},
          {"circle_zero_bearing_deg", Degrees(set_up.circle_zero_bearing_rad)},
          {"circle_zero_sigma_deg", Rounded(RadToDeg(sigma[3]), 5)},
          {"chi2", Rounded(set_up.chi2, kPlainDigits)},
          {"dof", OrNull(set_up.dof, -1)},
          {"sees_mm", Millimetres(set_up.sees_m)},
          {"closure_mm", Triple(set_up.closure_m, kMm, kMmDigits)},
          {"closure_worst_mm", Millimetres(set_up.closure_worst_m)},
          {"closure_tolerance_mm", Millimetres(set_up.closure_tolerance_m)},
          {"closure_points", set_up.closure_points},
          {"references", EachOf(set_up.references)}};
}

Json ViewOf(const dds::TrolleyState& state, Json timing) {
  const double speed_m_per_s = state.velocity_world_m_per_s.norm();
  return {{"timing", std::move(timing)},
          {"run", Text(state.run_id)},
          {"status", Text(WordOf(state.status))},
          {"reason", Text(state.reason)},
          {"position_world_m", Place(state.position_world_m)},
          {"position_sigma_mm", Triple(state.sigma_position_m, kMm, kMmDigits)},
          {"speed_m_per_s", Metres(speed_m_per_s)},
          {"distance_m", Metres(state.distance_m)},
          {"target_age_s", Rounded(state.target_age_s, kMmDigits)},
          {"tilt_age_s", Rounded(state.tilt_age_s, kMmDigits)},
          {"rest_age_s", Rounded(state.rest_age_s, kMmDigits)},
          {"came_too_late", state.came_too_late},
          {"gaps", state.gaps}};
}

Json ViewOf(const dds::SettlementPiece& piece) {
  return {{"base_run", Text(piece.base_run_id)},
          {"later_run", Text(piece.later_run_id)},
          {"at_utc_ms", Milliseconds(piece.published_at)},
          {"highest_alert", piece.highest_alert}};
}

Json ViewOf(const dds::StationObservation& observation) {
  return {{"target", Text(observation.target)},
          {"kind", observation.kind == dds::ObservedKind::kPrism ? "prism" : "reference"},
          {"face", observation.face == dds::ObservationFace::kOne ? 1 : 2},
          {"status", Text(WordOf(observation.status))},
          {"reason", Text(observation.reason)},
          {"at_utc_ms", Milliseconds(observation.sensed_at)},
          {"slope_m", Metres(observation.slope_m)},
          {"position_in_site_m", Place(observation.position_in_site_m)}};
}

Json ViewOf(const dds::DeviceHealth& health, Json timing) {
  return {{"id", Text(health.device_id)},
          {"timing", std::move(timing)},
          {"state", Text(StateCode(health.state))},
          {"since_utc_ms", Milliseconds(health.state_since)},
          {"samples_good", health.samples_good},
          {"samples_lost", health.samples_lost},
          {"errors", health.errors},
          {"reconnects", health.reconnects},
          {"detail", Text(health.detail)}};
}

Json ViewOf(const dds::Event& event) {
  return {{"source", Text(event.source)},
          {"code", Text(event.code)},
          {"at_utc_ms", Milliseconds(event.at)},
          {"severity", Text(SeverityCode(event.severity))},
          {"active", event.active},
          {"text", Text(event.text)}};
}

Json ViewOf(const dds::RelativePose& pose, const Rig& rig, Json timing) {
  Json points = Json::array();
  for (const dds::PosePoint& point : pose.points) {
    Json in_camera = Json::array();
    for (int i = 0; i < 3; ++i) in_camera.push_back(Millimetres(point.p_in_camera[i]));
    points.push_back({{"name", Text(point.name)},
                      {"in_camera_mm", std::move(in_camera)},
                      {"sigma_mm", Millimetres(point.sigma_m)},
                      {"bound_mm", point.bound_m ? Millimetres(*point.bound_m) : Json(nullptr)}});
  }
  return {{"timing", std::move(timing)},
          {"status", Text(StatusCode(pose.status))},
          {"reason", Text(ReasonCode(pose.reason))},
          {"leds_used", std::popcount(pose.leds_used)},
          {"excluded_led", LedName(pose.excluded_led, rig)},
          {"tilts_used", pose.tilts_used},
          {"chi2", Rounded(pose.chi2, kPlainDigits)},
          {"dof", pose.dof ? Json(*pose.dof) : Json(nullptr)},
          {"rms_px", Rounded(pose.rms_px, kPixelDigits)},
          {"rig_sha256", Text(pose.rig_hash)},
          {"points", std::move(points)}};
}

Json ViewOf(const dds::FrameFeatures& frame,
            const dds::RelativePose* pose,
            const Rig& rig,
            Json timing) {
  const bool is_of_frame =
      pose != nullptr && pose->sensed_at == frame.sensed_at && pose->status != PoseStatus::kNone;
  Json spots = Json::array();
  for (const dds::Spot& spot : frame.spots) {
    spots.push_back(ViewOf(spot, is_of_frame ? pose : nullptr, rig));
  }
  return {{"timing", std::move(timing)},
          {"number", frame.frame_number},
          {"reason", Text(ReasonCode(frame.reason))},
          {"exposure_us", Rounded(frame.exposure_s * 1e6, 0)},
          {"background_dn", Rounded(frame.background_dn, 1)},
          {"noise_dn", Rounded(frame.noise_dn, 2)},
          {"rejected_spots", frame.rejected_spots},
          {"dropped_spots", frame.dropped_spots},
          {"received", frame.frames_received},
          {"lost", frame.frames_lost},
          {"damaged", frame.frames_damaged},
          {"skipped", frame.frames_skipped},
          {"spots", std::move(spots)}};
}

}  // namespace tbm::hmi
