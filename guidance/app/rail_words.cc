#include "guidance/app/rail_words.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>

namespace tbm {
namespace {

constexpr double kSecondsPerDay = 86'400.0;
constexpr std::size_t kMostPoints = dds::kMaxPiecePoints * dds::kMaxPieces;

dds::RailPointStatus StatusOf(TrolleyHold hold) {
  switch (hold) {
    case TrolleyHold::kFixed:
      return dds::RailPointStatus::kFixed;
    case TrolleyHold::kOpen:
      return dds::RailPointStatus::kOpen;
    case TrolleyHold::kGap:
      return dds::RailPointStatus::kGap;
  }
  return dds::RailPointStatus::kOpen;
}

dds::RailPointStatus StatusOf(RailStatus status) {
  switch (status) {
    case RailStatus::kFixed:
      return dds::RailPointStatus::kFixed;
    case RailStatus::kBridged:
      return dds::RailPointStatus::kBridged;
    case RailStatus::kOpen:
      return dds::RailPointStatus::kOpen;
    case RailStatus::kGap:
      return dds::RailPointStatus::kGap;
  }
  return dds::RailPointStatus::kOpen;
}

// Deals points to as many pieces as they need.
template <class Piece, class Point>
std::vector<Piece> Dealt(const Piece& blank, const std::vector<Point>& points) {
  std::vector<Piece> pieces;
  for (std::size_t begin = 0; begin < points.size(); begin += dds::kMaxPiecePoints) {
    Piece piece = blank;
    piece.points_before = static_cast<std::int32_t>(begin);
    piece.piece = static_cast<std::int32_t>(pieces.size() + 1);
    const std::size_t end = std::min(begin + dds::kMaxPiecePoints, points.size());
    for (std::size_t i = begin; i < end; ++i) piece.points.push_back(points[i]);
    pieces.push_back(piece);
  }
  for (Piece& piece : pieces) {
    piece.pieces = static_cast<std::int32_t>(pieces.size());
    piece.points_in_all = static_cast<std::int32_t>(points.size());
  }
  return pieces;
}

bool IsLessTelling(const SettlementPlace& a, const SettlementPlace& b) {
  const auto weight = [](const SettlementPlace& place) {
    const auto& change = place.changes.back();
    return std::tuple(
        place.alert, change && change->is_significant, change ? std::abs(change->dz_m) : -1.0);
  };
  return weight(a) < weight(b);
}

// Every so many of `count`, so that not too many are left.
std::size_t StrideOf(std::size_t count) { return (count + kMostPoints - 1) / kMostPoints; }

}  // namespace

dds::TrolleyState TrolleyStateOf(const std::optional<TrolleyPlace>& place,
                                 std::string_view why_none) {
  dds::TrolleyState state;
  if (!why_none.empty() || !place) {
    state.reason = why_none;
    return state;
  }
  state.valid_at = place->at;
  state.status = StatusOf(place->hold);
  state.position_world_m = place->motion.position_world_m;
  state.sigma_position_m = place->sigma_position_m;
  state.velocity_world_m_per_s = place->motion.velocity_world_m_s;
  state.sigma_velocity_m_per_s = place->sigma_velocity_m_s;
  state.world_from_imu = place->motion.world_from_imu;
  state.sigma_attitude_rad = place->sigma_attitude_rad;
  state.gyro_bias_rad_per_s = place->gyro_bias_rad_s;
  state.sigma_gyro_bias_rad_per_s = place->sigma_gyro_bias_rad_s;
  state.accel_bias_m_per_s2 = place->accel_bias_m_s2;
  state.sigma_accel_bias_m_per_s2 = place->sigma_accel_bias_m_s2;
  state.distance_m = place->distance_m;
  state.target_age_s = place->target_age_s.value_or(dds::kNaN);
  state.tilt_age_s = place->tilt_age_s.value_or(dds::kNaN);
  state.rest_age_s = place->rest_age_s.value_or(dds::kNaN);
  return state;
}

std::vector<dds::RailLinePiece> PiecesOf(const FinishedLine& line, double step_m) {
  if (line.points.empty()) return {};
  const RailPoint& last = line.points.back();
  const double step = std::max(step_m, last.distance_m / static_cast<double>(kMostPoints - 2));
  std::vector<dds::RailLinePoint> points;
  double next_m = 0.0;
  for (const RailPoint& point : line.points) {
    const bool is_last = &point == &last;
    if (point.distance_m < next_m && !is_last) continue;
    next_m = point.distance_m + step;
    dds::RailLinePoint told;
    told.distance_m = point.distance_m;
    told.position_world_m = point.position_world_m;
    told.sigma_world_m = point.sigma_world_m;
    told.status = StatusOf(point.status);
    points.push_back(told);
  }
  dds::RailLinePiece blank;
  blank.run_id = std::string_view(line.run_id);
  blank.line_sha256 = std::string_view(line.sha256);
  blank.method = "smoothed";
  blank.begins_at = line.points.front().at;
  blank.ends_at = last.at;
  return Dealt(blank, points);
}

std::vector<dds::SettlementPiece> PiecesOf(const Settlement& settlement,
                                           const FinishedLine& base,
                                           const FinishedLine& later,
                                           double level) {
  std::vector<dds::SettlementPoint> points;
  dds::SettlementPiece blank;
  blank.base_run_id = std::string_view(base.run_id);
  blank.later_run_id = std::string_view(later.run_id);
  blank.base_sha256 = std::string_view(base.sha256);
  blank.later_sha256 = std::string_view(later.sha256);
  blank.level = level;
  const std::span places(settlement.places);
  const std::size_t stride = StrideOf(places.size());
  for (std::size_t begin = 0; begin < places.size(); begin += stride) {
    const auto stretch = places.subspan(begin, std::min(stride, places.size() - begin));
    const SettlementPlace& place = *std::max_element(stretch.begin(), stretch.end(), IsLessTelling);
    dds::SettlementPoint told;
    told.distance_m = place.distance_m;
    told.alert = static_cast<std::int32_t>(place.alert);
    if (const auto& change = place.changes.back()) {
      told.dz_m = change->dz_m;
      told.sigma_m = change->sigma_m;
      // Beside a shift of the whole line a place may have moved that is as high as it was.
      told.is_significant = change->is_significant || place.alert > 0;
    }
    blank.highest_alert = std::max(blank.highest_alert, told.alert);
    points.push_back(told);
  }
  return Dealt(blank, points);
}

std::vector<dds::CalibrationStatus> CalibrationsOf(const RailSetup& setup,
                                                   const RailLineConfig& config,
                                                   std::string_view rail_yaml_sha256,
                                                   Timestamp now) {
  dds::CalibrationStatus blank;
  blank.machine_id = std::string_view(config.machine_id);
  blank.source = kRailLineSource;
  blank.file_sha256 = rail_yaml_sha256;
  blank.due_after_days = config.calibration_due_days.value_or(dds::kNaN);
  if (config.calibrated_at) {
    blank.calibrated_at = *config.calibrated_at;
    // Of today it may be ahead: a day begins in Auckland before it does in Greenwich.
    blank.age_days = std::max(0.0, SecondsBetween(*config.calibrated_at, now) / kSecondsPerDay);
    const bool is_due =
        config.calibration_due_days && blank.age_days > *config.calibration_due_days;
    blank.state = is_due ? dds::CalibrationState::kDue : dds::CalibrationState::kValid;
    if (is_due) blank.reason = "overdue";
  } else {
    blank.state = dds::CalibrationState::kUndated;
    blank.reason = "undated";
  }
  std::vector<dds::CalibrationStatus> all;
  const auto add = [&](std::string_view subject) -> dds::CalibrationStatus& {
    all.push_back(blank);
    all.back().subject = subject;
    return all.back();
  };
  const auto sigma =
      [](dds::CalibrationStatus& of, std::string_view what, double value, std::string_view unit) {
        of.sigmas.push_back({what, value, unit});
      };
  dds::CalibrationStatus& imu = add("imu");
  sigma(imu, "gyro_bias", setup.imu.gyro_bias_sigma_rad_s, "rad/s");
  sigma(imu, "accel_bias", setup.imu.accel_bias_sigma_m_s2, "m/s2");
  if (setup.tilt) sigma(add("tilt"), "reading", setup.tilt->sigma_rad, "rad");
  if (setup.camera) {
    dds::CalibrationStatus& mounting = add("imu_mounting");
    sigma(mounting, "camera_rotation", setup.camera->sigma_rotation_rad, "rad");
    sigma(mounting, "camera_position", setup.camera->sigma_position_m, "m");
    sigma(mounting, "camera_time_offset", setup.camera->sigma_time_offset_s, "s");
  }
  return all;
}

}  // namespace tbm
