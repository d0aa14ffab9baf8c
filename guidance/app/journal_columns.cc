#include "guidance/app/journal_columns.h"

#include <array>
#include <bit>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "idl/cpp/words.h"

namespace tbm {
namespace {

using Names3 = std::array<std::string_view, 3>;

// The word of an enumerator, from those of its type in their order.
template <class Enum, std::size_t N>
std::string_view Word(Enum value, const std::array<std::string_view, N>& words) {
  const auto place = static_cast<std::size_t>(value);
  return place < N ? words[place] : std::string_view{};
}

constexpr std::array<std::string_view, 3> kValidityWords = {"invalid", "degraded", "valid"};
constexpr std::array<std::string_view, 4> kFreshnessWords = {
    "missing", "stale", "coasting", "fresh"};

void AddVector(JournalRow& row, const Names3& names, const Eigen::Vector3d& vector) {
  for (int i = 0; i < 3; ++i) row.Number(names[static_cast<std::size_t>(i)], vector[i]);
}

// Names of the upper triangle of a symmetric matrix, row by row: "covariance_A_B".
std::vector<std::string> TriangleNames(const std::string& what,
                                       const std::vector<std::string>& axes,
                                       const std::string& unit = "") {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    for (std::size_t j = i; j < axes.size(); ++j) {
      names.push_back(fmt::format("{}_{}_{}{}", what, axes[i], axes[j], unit));
    }
  }
  return names;
}

template <class Matrix>
void AddTriangle(JournalRow& row, const std::vector<std::string>& names, const Matrix& matrix) {
  std::size_t next = 0;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = i; j < matrix.cols(); ++j) row.Number(names[next++], matrix(i, j));
  }
}

constexpr Names3 kPositionInSite = {
    "position_in_site_east_m", "position_in_site_north_m", "position_in_site_up_m"};

void AddSpot(JournalRow row, const dds::Spot& spot) {
  row.Number("u_px", spot.centre.pixel_px.x());
  row.Number("v_px", spot.centre.pixel_px.y());
  row.Number("sigma_px", spot.centre.sigma_px);
  row.Number("peak_dn", spot.centre.peak_dn);
  row.Number("background_dn", spot.centre.background_dn);
  row.Number("spread_px", spot.centre.spread_px);
  row.Number("elongation", spot.centre.elongation);
  row.Whole("clipped_pixels", spot.centre.clipped_pixels);
  row.Index("led_index", spot.led_index);
}

void AddPosePoint(JournalRow row, const dds::PosePoint& point) {
  AddVector(row, {"x_in_camera_m", "y_in_camera_m", "z_in_camera_m"}, point.p_in_camera);
  row.Number("sigma_m", point.sigma_m);
  row.Number("bound_m", point.bound_m.value_or(dds::kNaN));
}

void AddReference(JournalRow row, const dds::ReferenceState& reference) {
  AddVector(row, kPositionInSite, reference.position_in_site_m);
  row.Flag("used", reference.used);
  row.Text("reason", reference.reason);
  row.Number("across_m", reference.across_m);
  row.Number("up_m", reference.up_m);
  row.Number("slope_m", reference.slope_m);
  row.Number("standardised", reference.standardised);
  row.Number("checked_share", reference.checked_share);
}

void AddGuidedPoint(JournalRow row, const dds::GuidedPoint& point) {
  row.Text("shield", point.shield);
  row.Text("validity", Word(point.validity, kValidityWords));
  row.Text("reason", point.reason);
  AddVector(row, kPositionInSite, point.position_in_site_m);
  row.Number("position_sigma_m", point.position_sigma_m);
  row.Number("chainage_m", point.chainage_m);
  row.Number("official_chainage_m", point.official_chainage_m);
  row.Index("official_section", point.official_section);
  row.Number("chainage_sigma_m", point.chainage_sigma_m);
  row.Number("deviation_right_m", point.deviation_right_m);
  row.Number("deviation_up_m", point.deviation_up_m);
  row.Number("deviation_right_sigma_m", point.deviation_right_sigma_m);
  row.Number("deviation_up_sigma_m", point.deviation_up_sigma_m);
  row.Number("right_up_correlation", point.right_up_correlation);
  row.Number("trend_right_per_m", point.trend_right_per_m);
  row.Number("trend_up_per_m", point.trend_up_per_m);
  row.Number("trend_right_sigma_per_m", point.trend_right_sigma_per_m);
  row.Number("trend_up_sigma_per_m", point.trend_up_sigma_per_m);
  row.Number("trend_length_m", point.trend_length_m);
}

void AddPredicted(JournalRow row, const dds::PredictedDeviation& predicted) {
  row.Number("ahead_m", predicted.ahead_m);
  row.Number("deviation_right_m", predicted.deviation_right_m);
  row.Number("deviation_up_m", predicted.deviation_up_m);
  row.Number("deviation_right_sigma_m", predicted.deviation_right_sigma_m);
  row.Number("deviation_up_sigma_m", predicted.deviation_up_sigma_m);
}

void AddRailPoint(JournalRow row, const dds::RailLinePoint& point) {
  row.Number("distance_m", point.distance_m);
  AddVector(row, {"x_world_m", "y_world_m", "z_world_m"}, point.position_world_m);
  AddVector(row, {"sigma_x_m", "sigma_y_m", "sigma_z_m"}, point.sigma_world_m);
  row.Text("status", dds::WordOf(point.status));
}

void AddSettlementPoint(JournalRow row, const dds::SettlementPoint& point) {
  row.Number("distance_m", point.distance_m);
  row.Number("dz_m", point.dz_m);
  row.Number("sigma_m", point.sigma_m);
  row.Flag("is_significant", point.is_significant);
  row.Whole("alert", point.alert);
}

// "cutter_face_": the name out of a message, before those of its fields.
std::string Before(std::string_view name) { return std::string(name) + "_"; }

}  // namespace

void AddCells(JournalRow& row, const dds::FrameFeatures& m) {
  row.Text("machine_id", m.machine_id);
  row.Time("sensed_at_utc_ns", m.sensed_at);
  row.Time("published_at_utc_ns", m.published_at);
  row.Count("frame_number", m.frame_number);
  row.Number("exposure_s", m.exposure_s);
  row.Text("reason", ReasonCode(m.reason));
  row.Number("background_dn", m.background_dn);
  row.Number("noise_dn", m.noise_dn);
  row.Count("rejected_spots", m.rejected_spots);
  row.Count("dropped_spots", m.dropped_spots);
  row.Count("frames_received", m.frames_received);
  row.Count("frames_lost", m.frames_lost);
  row.Count("frames_damaged", m.frames_damaged);
  row.Count("frames_skipped", m.frames_skipped);
  for (std::size_t i = 0; i < m.spots.size(); ++i) {
    AddSpot(row.Part(fmt::format("spot_{}_", i + 1)), m.spots[i]);
  }
}

void AddCells(JournalRow& row, const dds::TiltReading& m) {
  row.Text("machine_id", m.machine_id);
  row.Text("sensor", m.sensor);
  row.Time("sensed_at_utc_ns", m.sensed_at);
  row.Time("published_at_utc_ns", m.published_at);
  row.Count("sample_number", m.sample_number);
  row.Text("validity", Word(m.validity, kValidityWords));
  row.Text("reason", m.reason);
  row.Number("beta_rad", m.inclination.beta_rad);
  row.Number("gamma_rad", m.inclination.gamma_rad);
  row.Number("sigma_rad", m.sigma_rad);
}

void AddCells(JournalRow& row, const dds::RelativePose& m) {
  static const std::vector<std::string> covariance =
      TriangleNames("covariance", {"turn_x_rad", "turn_y_rad", "turn_z_rad", "x_m", "y_m", "z_m"});
  row.Text("machine_id", m.machine_id);
  row.Time("sensed_at_utc_ns", m.sensed_at);
  row.Time("published_at_utc_ns", m.published_at);
  row.Count("sample_number", m.sample_number);
  row.Text("rig_hash", m.rig_hash);
  row.Text("status", StatusCode(m.status));
  row.Text("reason_code", ReasonCode(m.reason));
  row.Number("camera_from_target_qw", m.camera_from_target.rotation.w());
  row.Number("camera_from_target_qx", m.camera_from_target.rotation.x());
  row.Number("camera_from_target_qy", m.camera_from_target.rotation.y());
  row.Number("camera_from_target_qz", m.camera_from_target.rotation.z());
  AddVector(row,
            {"camera_from_target_x_m", "camera_from_target_y_m", "camera_from_target_z_m"},
            m.camera_from_target.translation);
  AddTriangle(row, covariance, m.covariance);
  row.Count("leds_used", static_cast<std::uint64_t>(std::popcount(m.leds_used)));
  row.Count("leds_used_mask", m.leds_used);
  row.Index("excluded_led_index", m.excluded_led.value_or(-1));
  row.Flag("tilts_used", m.tilts_used);
  row.Number("chi2", m.chi2);
  row.Index("dof", m.dof.value_or(-1));
  row.Number("rms_px", m.rms_px);
  for (const dds::PosePoint& point : m.points) AddPosePoint(row.Part(Before(point.name)), point);
}

void AddCells(JournalRow& row, const dds::DeviceHealth& m) {
  row.Text("machine_id", m.machine_id);
  row.Text("device_id", m.device_id);
  row.Time("published_at_utc_ns", m.published_at);
  row.Text("state", StateCode(m.state));
  row.Time("state_since_utc_ns", m.state_since);
  row.Count("samples_good", m.samples_good);
  row.Count("samples_lost", m.samples_lost);
  row.Count("errors", m.errors);
  row.Count("reconnects", m.reconnects);
  row.Text("detail", m.detail);
}

void AddCells(JournalRow& row, const dds::Event& m) {
  row.Text("machine_id", m.machine_id);
  row.Text("source", m.source);
  row.Text("code", m.code);
  row.Time("at_utc_ns", m.at);
  row.Count("sample_number", m.sample_number);
  row.Text("severity", SeverityCode(m.severity));
  row.Flag("active", m.active);
  row.Text("text", m.text);
}

void AddCells(JournalRow& row, const dds::StationObservation& m) {
  static const std::vector<std::string> covariance =
      TriangleNames("covariance_of_reading", {"east", "north", "up"}, "_m2");
  static constexpr std::array<std::string_view, 12> kByStation = {
      "by_station_east_per_east",
      "by_station_east_per_north",
      "by_station_east_per_up",
      "by_station_east_per_circle_zero_m_per_rad",
      "by_station_north_per_east",
      "by_station_north_per_north",
      "by_station_north_per_up",
      "by_station_north_per_circle_zero_m_per_rad",
      "by_station_up_per_east",
      "by_station_up_per_north",
      "by_station_up_per_up",
      "by_station_up_per_circle_zero_m_per_rad"};
  constexpr std::array<std::string_view, 2> kKinds = {"prism", "reference"};
  constexpr std::array<std::string_view, 2> kFaces = {"one", "two"};
  constexpr std::array<std::string_view, 3> kStatuses = {"none", "degraded", "good"};
  row.Text("machine_id", m.machine_id);
  row.Text("station", m.station);
  row.Time("sensed_at_utc_ns", m.sensed_at);
  row.Time("published_at_utc_ns", m.published_at);
  row.Count("sample_number", m.sample_number);
  row.Count("set_up_number", m.set_up_number);
  row.Count("cycle_number", m.cycle_number);
  row.Text("kind", Word(m.kind, kKinds));
  row.Text("target", m.target);
  row.Text("face", Word(m.face, kFaces));
  row.Text("status", Word(m.status, kStatuses));
  row.Text("reason", m.reason);
  row.Number("sensed_within_s", m.sensed_within_s);
  row.Number("circle_rad", m.circle_rad);
  row.Number("zenith_rad", m.zenith_rad);
  row.Number("slope_m", m.slope_m);
  row.Number("prism_constant_m", m.prism_constant_m);
  row.Number("ppm", m.ppm);
  AddVector(row, kPositionInSite, m.position_in_site_m);
  AddTriangle(row, covariance, m.covariance_of_reading_m2);
  for (std::size_t i = 0; i < kByStation.size(); ++i) {
    const auto place = static_cast<Eigen::Index>(i);
    row.Number(kByStation[i], m.by_station(place / 4, place % 4));
  }
}

void AddCells(JournalRow& row, const dds::StationSetUp& m) {
  static const std::vector<std::string> covariance =
      TriangleNames("covariance", {"east_m", "north_m", "up_m", "circle_zero_rad"});
  constexpr std::array<std::string_view, 3> kStates = {"none", "suspect", "good"};
  row.Text("machine_id", m.machine_id);
  row.Text("role", m.role);
  row.Text("station", m.station);
  row.Time("published_at_utc_ns", m.published_at);
  row.Count("set_up_number", m.set_up_number);
  row.Text("state", Word(m.state, kStates));
  row.Text("reason", m.reason);
  row.Time("set_up_at_utc_ns", m.set_up_at);
  row.Time("last_good_check_at_utc_ns", m.last_good_check_at);
  AddVector(row, kPositionInSite, m.position_in_site_m);
  row.Number("circle_zero_bearing_rad", m.circle_zero_bearing_rad);
  AddTriangle(row, covariance, m.covariance);
  row.Number("chi2", m.chi2);
  row.Index("dof", m.dof);
  row.Number("sees_m", m.sees_m);
  AddVector(row, {"closure_east_m", "closure_north_m", "closure_up_m"}, m.closure_m);
  row.Number("closure_worst_m", m.closure_worst_m);
  row.Number("closure_tolerance_m", m.closure_tolerance_m);
  row.Whole("closure_points", m.closure_points);
  for (const dds::ReferenceState& reference : m.references) {
    AddReference(row.Part("reference_" + Before(reference.name)), reference);
  }
}

void AddCells(JournalRow& row, const dds::ShieldPose& m) {
  static const std::vector<std::string> covariance = TriangleNames(
      "covariance",
      {"turn_east_rad", "turn_north_rad", "turn_up_rad", "east_m", "north_m", "up_m"});
  row.Text("machine_id", m.machine_id);
  row.Text("shield", m.shield);
  row.Time("valid_at_utc_ns", m.valid_at);
  row.Time("published_at_utc_ns", m.published_at);
  row.Count("sample_number", m.sample_number);
  row.Text("validity", Word(m.validity, kValidityWords));
  row.Text("reason", m.reason);
  row.Number("age_s", m.age_s);
  row.Number("site_from_shield_qw", m.site_from_shield.rotation.w());
  row.Number("site_from_shield_qx", m.site_from_shield.rotation.x());
  row.Number("site_from_shield_qy", m.site_from_shield.rotation.y());
  row.Number("site_from_shield_qz", m.site_from_shield.rotation.z());
  AddVector(row, kPositionInSite, m.site_from_shield.translation);
  AddTriangle(row, covariance, m.covariance);
  row.Number("speed_m_per_s", m.speed_m_per_s);
  row.Number("speed_sigma_m_per_s", m.speed_sigma_m_per_s);
  row.Number("heading_rad", m.heading_rad);
  row.Number("pitch_rad", m.pitch_rad);
  row.Number("roll_rad", m.roll_rad);
  row.Number("heading_sigma_rad", m.heading_sigma_rad);
  row.Number("pitch_sigma_rad", m.pitch_sigma_rad);
  row.Number("roll_sigma_rad", m.roll_sigma_rad);
}

void AddCells(JournalRow& row, const dds::Guidance& m) {
  row.Text("machine_id", m.machine_id);
  row.Time("valid_at_utc_ns", m.valid_at);
  row.Time("published_at_utc_ns", m.published_at);
  row.Count("sample_number", m.sample_number);
  row.Text("validity", Word(m.validity, kValidityWords));
  row.Text("reason", m.reason);
  row.Text("axis_name", m.axis_name);
  row.Text("axis_sha256", m.axis_sha256);
  row.Text("machine_sha256", m.machine_sha256);
  row.Count("set_up_number", m.set_up_number);
  row.Number("lead_right_per_m", m.lead_right_per_m);
  row.Number("lead_up_per_m", m.lead_up_per_m);
  row.Number("lead_right_sigma_per_m", m.lead_right_sigma_per_m);
  row.Number("lead_up_sigma_per_m", m.lead_up_sigma_per_m);
  row.Number("articulation_right_rad", m.articulation_right_rad);
  row.Number("articulation_up_rad", m.articulation_up_rad);
  row.Number("articulation_roll_rad", m.articulation_roll_rad);
  row.Number("articulation_right_sigma_rad", m.articulation_right_sigma_rad);
  row.Number("articulation_up_sigma_rad", m.articulation_up_sigma_rad);
  row.Number("articulation_roll_sigma_rad", m.articulation_roll_sigma_rad);
  row.Number("stroke_m", m.stroke_m);
  row.Number("stroke_sigma_m", m.stroke_sigma_m);
  row.Index("ring_number", m.ring_number);
  row.Whole("prisms_used", m.prisms_used);
  row.Number("prisms_chi2", m.prisms_chi2);
  row.Index("prisms_dof", m.prisms_dof);
  row.Number("prisms_rms_m", m.prisms_rms_m);
  row.Text("prisms_remark", m.prisms_remark);
  row.Text("steer_by", m.steer_by);
  for (const dds::GuidanceSource& source : m.sources) {
    JournalRow part = row.Part("source_" + Before(source.name));
    part.Text("freshness", Word(source.freshness, kFreshnessWords));
    part.Number("age_s", source.age_s);
    part.Text("reason", source.reason);
  }
  for (const dds::GuidedPoint& point : m.points) {
    AddGuidedPoint(row.Part(Before(point.name)), point);
  }
  for (std::size_t i = 0; i < m.ahead.size(); ++i) {
    AddPredicted(row.Part(fmt::format("ahead_{}_", i + 1)), m.ahead[i]);
  }
}

void AddCells(JournalRow& row, const dds::AlarmStatus& m) {
  constexpr std::array<std::string_view, 4> kPhases = {
      "normal", "unacknowledged", "acknowledged", "returned_unacknowledged"};
  constexpr std::array<std::string_view, 3> kUrgencies = {"low", "medium", "high"};
  row.Text("machine_id", m.machine_id);
  row.Text("source", m.source);
  row.Text("code", m.code);
  row.Time("published_at_utc_ns", m.published_at);
  row.Text("phase", Word(m.phase, kPhases));
  row.Text("urgency", Word(m.urgency, kUrgencies));
  row.Time("since_utc_ns", m.since);
  row.Time("raised_at_utc_ns", m.raised_at);
  row.Count("raise_number", m.raise_number);
  row.Count("times_raised", m.times_raised);
  row.Number("value", m.value);
  row.Number("raise_above", m.raise_above);
  row.Number("clear_below", m.clear_below);
  row.Text("unit", m.unit);
  row.Text("cause", m.cause);
  row.Text("response", m.response);
  row.Text("acknowledged_by", m.acknowledged_by);
  row.Time("shelved_until_utc_ns", m.shelved_until);
  row.Text("shelved_by", m.shelved_by);
  row.Text("shelved_because", m.shelved_because);
}

void AddCells(JournalRow& row, const dds::Command& m) {
  row.Text("machine_id", m.machine_id);
  row.Text("request_id", m.request_id);
  row.Text("addressee", m.addressee);
  row.Text("verb", m.verb);
  row.Text("argument", m.argument);
  row.Text("by", m.by);
  row.Text("because", m.because);
  row.Time("issued_at_utc_ns", m.issued_at);
  row.Time("expires_at_utc_ns", m.expires_at);
}

void AddCells(JournalRow& row, const dds::CommandReply& m) {
  constexpr std::array<std::string_view, 4> kOutcomes = {"accepted", "done", "refused", "failed"};
  row.Text("machine_id", m.machine_id);
  row.Text("request_id", m.request_id);
  row.Text("source", m.source);
  row.Text("outcome", Word(m.outcome, kOutcomes));
  row.Text("text", m.text);
  row.Time("published_at_utc_ns", m.published_at);
}

void AddCells(JournalRow& row, const dds::TrolleyState& m) {
  row.Text("machine_id", m.machine_id);
  row.Time("valid_at_utc_ns", m.valid_at);
  row.Time("published_at_utc_ns", m.published_at);
  row.Count("sample_number", m.sample_number);
  row.Text("run_id", m.run_id);
  row.Text("status", dds::WordOf(m.status));
  row.Text("reason", m.reason);
  AddVector(row, {"x_world_m", "y_world_m", "z_world_m"}, m.position_world_m);
  AddVector(row, {"sigma_x_m", "sigma_y_m", "sigma_z_m"}, m.sigma_position_m);
  AddVector(row,
            {"velocity_x_m_per_s", "velocity_y_m_per_s", "velocity_z_m_per_s"},
            m.velocity_world_m_per_s);
  AddVector(row,
            {"sigma_velocity_x_m_per_s", "sigma_velocity_y_m_per_s", "sigma_velocity_z_m_per_s"},
            m.sigma_velocity_m_per_s);
  row.Number("world_from_imu_qw", m.world_from_imu.w());
  row.Number("world_from_imu_qx", m.world_from_imu.x());
  row.Number("world_from_imu_qy", m.world_from_imu.y());
  row.Number("world_from_imu_qz", m.world_from_imu.z());
  AddVector(row,
            {"sigma_attitude_x_rad", "sigma_attitude_y_rad", "sigma_attitude_z_rad"},
            m.sigma_attitude_rad);
  AddVector(row,
            {"gyro_bias_x_rad_per_s", "gyro_bias_y_rad_per_s", "gyro_bias_z_rad_per_s"},
            m.gyro_bias_rad_per_s);
  AddVector(
      row,
      {"sigma_gyro_bias_x_rad_per_s", "sigma_gyro_bias_y_rad_per_s", "sigma_gyro_bias_z_rad_per_s"},
      m.sigma_gyro_bias_rad_per_s);
  AddVector(row,
            {"accel_bias_x_m_per_s2", "accel_bias_y_m_per_s2", "accel_bias_z_m_per_s2"},
            m.accel_bias_m_per_s2);
  AddVector(
      row,
      {"sigma_accel_bias_x_m_per_s2", "sigma_accel_bias_y_m_per_s2", "sigma_accel_bias_z_m_per_s2"},
      m.sigma_accel_bias_m_per_s2);
  row.Number("distance_m", m.distance_m);
  row.Number("target_age_s", m.target_age_s);
  row.Number("tilt_age_s", m.tilt_age_s);
  row.Number("rest_age_s", m.rest_age_s);
  row.Count("came_too_late", m.came_too_late);
  row.Count("gaps", m.gaps);
}

void AddCells(JournalRow& row, const dds::RailLinePiece& m) {
  row.Text("machine_id", m.machine_id);
  row.Whole("piece", m.piece);
  row.Time("published_at_utc_ns", m.published_at);
  row.Text("run_id", m.run_id);
  row.Text("line_sha256", m.line_sha256);
  row.Text("method", m.method);
  row.Time("begins_at_utc_ns", m.begins_at);
  row.Time("ends_at_utc_ns", m.ends_at);
  row.Whole("pieces", m.pieces);
  row.Whole("points_in_all", m.points_in_all);
  row.Whole("points_before", m.points_before);
  for (std::size_t i = 0; i < m.points.size(); ++i) {
    AddRailPoint(row.Part(fmt::format("point_{}_", i + 1)), m.points[i]);
  }
}

void AddCells(JournalRow& row, const dds::SettlementPiece& m) {
  row.Text("machine_id", m.machine_id);
  row.Whole("piece", m.piece);
  row.Time("published_at_utc_ns", m.published_at);
  row.Text("base_run_id", m.base_run_id);
  row.Text("later_run_id", m.later_run_id);
  row.Text("base_sha256", m.base_sha256);
  row.Text("later_sha256", m.later_sha256);
  row.Number("level", m.level);
  row.Whole("highest_alert", m.highest_alert);
  row.Whole("pieces", m.pieces);
  row.Whole("points_in_all", m.points_in_all);
  row.Whole("points_before", m.points_before);
  for (std::size_t i = 0; i < m.points.size(); ++i) {
    AddSettlementPoint(row.Part(fmt::format("point_{}_", i + 1)), m.points[i]);
  }
}

void AddCells(JournalRow& row, const dds::CalibrationStatus& m) {
  row.Text("machine_id", m.machine_id);
  row.Text("subject", m.subject);
  row.Text("source", m.source);
  row.Time("published_at_utc_ns", m.published_at);
  row.Text("state", dds::WordOf(m.state));
  row.Text("reason", m.reason);
  row.Time("calibrated_at_utc_ns", m.calibrated_at);
  row.Number("age_days", m.age_days);
  row.Number("due_after_days", m.due_after_days);
  row.Text("file_sha256", m.file_sha256);
  for (const dds::CalibrationSigma& sigma : m.sigmas) {
    JournalRow part = row.Part(Before(sigma.what));
    part.Number("sigma", sigma.sigma);
    part.Text("unit", sigma.unit);
  }
}

}  // namespace tbm
