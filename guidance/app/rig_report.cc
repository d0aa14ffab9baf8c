#include "guidance/app/rig_report.h"

#include <array>
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "pose/base/angle.h"
#include "pose/base/length.h"
#include "pose/rig/rig_text.h"

namespace tbm {
namespace {

// One line of a budget. Without a covariance nothing is known of it.
struct BudgetRow {
  std::string code;  // in CSV and JSON
  std::string text;
  std::optional<Eigen::Matrix3d> covariance_m2;
  bool is_sum = false;

  Eigen::Vector3d sigma_mm() const {
    return kMmPerMetre * covariance_m2->diagonal().cwiseMax(0.0).cwiseSqrt();
  }
  double all_mm() const { return kMmPerMetre * std::sqrt(covariance_m2->trace()); }
};

std::string LedSigma(const Rig& rig) {
  double sum_m2 = 0.0;
  for (const Led& led : rig.leds) {
    sum_m2 += led.sigma_m * led.sigma_m / static_cast<double>(rig.leds.size());
  }
  return fmt::format("{:.3f} mm", kMmPerMetre * std::sqrt(sum_m2));
}

std::string InDegrees(double rad) { return fmt::format("{:.3g} deg", RadToDeg(rad)); }

std::vector<BudgetRow> RowsOf(const RigResult& result, std::size_t point) {
  const Rig& rig = result.rig;
  const PointBudget& budget = result.budgets[point];
  const Eigen::Vector4d& px = rig.intrinsics_sigma_px;
  std::vector<BudgetRow> rows;
  const auto add = [&](const char* code, const std::string& text, ErrorSource source) {
    rows.push_back({code, text, budget.From(source), false});
  };
  const auto add_sum = [&](const char* code, const char* text, const Eigen::Matrix3d& sum) {
    rows.push_back({code, text, sum, true});
  };
  add("focal_length",
      fmt::format("focal length, {:.2f} / {:.2f} px", px[0], px[1]),
      ErrorSource::kFocalLength);
  add("principal_point",
      fmt::format("principal point, {:.2f} / {:.2f} px", px[2], px[3]),
      ErrorSource::kPrincipalPoint);
  add("distortion", "distortion", ErrorSource::kDistortion);
  if (!result.knows_distortion) rows.back().covariance_m2.reset();
  add_sum("camera", "these three together", budget.camera);
  add("lens_residual",
      fmt::format("residual of the lens, {:.3f} px", rig.calibration_residual_px),
      ErrorSource::kLensResidual);
  add("led_coordinates", "LED coordinates, " + LedSigma(rig), ErrorSource::kLeds);
  add("camera_mounting",
      "camera's inclinometer, " + InDegrees(rig.camera_tilt.mounting_sigma_rad),
      ErrorSource::kCameraMounting);
  add("target_mounting",
      "target's inclinometer, " + InDegrees(rig.target_tilt.mounting_sigma_rad),
      ErrorSource::kTargetMounting);
  add("point_coordinates",
      fmt::format("the point itself, {:.2f} mm", kMmPerMetre * rig.points[point].sigma_m),
      ErrorSource::kPoint);
  add_sum("calibration", "calibration", budget.calibration);
  add("centre_noise",
      fmt::format("noise of centres, {:.3f} px", result.request.centre_sigma_px),
      ErrorSource::kCentres);
  add("tilt_noise",
      fmt::format("noise of tilts, {} / {}",
                  InDegrees(rig.camera_tilt.sigma_rad),
                  InDegrees(rig.target_tilt.sigma_rad)),
      ErrorSource::kTilts);
  add_sum("noise", "noise of one frame", budget.noise);
  add_sum("total", "total", budget.total());
  return rows;
}

std::string PointTable(const RigResult& result, std::size_t point) {
  std::string text =
      fmt::format("\n{}, {:.2f} m from the camera; one sigma, mm\n{:42} {:>8} {:>8} {:>8} {:>8}\n",
                  result.rig.points[point].name,
                  result.budgets[point].distance_m,
                  "",
                  "right",
                  "up",
                  "along",
                  "all");
  for (const BudgetRow& row : RowsOf(result, point)) {
    const std::string label = (row.is_sum ? "  = " : "    ") + row.text;
    if (!row.covariance_m2) {
      text += fmt::format("{:42} not known\n", label);
      continue;
    }
    const Eigen::Vector3d mm = row.sigma_mm();
    text += fmt::format(
        "{:42} {:>8.3f} {:>8.3f} {:>8.3f} {:>8.3f}\n", label, mm.x(), mm.y(), mm.z(), row.all_mm());
  }
  return text;
}

// Which way of the target looks at the camera.
std::string FacingText(const RigResult& result) {
  const Eigen::Vector3d facing =
      result.placement.camera_from_target.rotation.conjugate() * -Eigen::Vector3d::UnitZ();
  return fmt::format("({:.2f}, {:.2f}, {:.2f})", facing.x(), facing.y(), facing.z());
}

}  // namespace

std::string RigFileText(const RigResult& result) {
  const CalibrateRigRequest& request = result.request;
  std::string text = fmt::format(
      "# Put together by tbm calibrate rig from\n"
      "#   camera {}\n#   tilt   {}\n#   target {}\n#   points {}\n"
      "# One sigma with the LEDs {} m ahead of the camera:\n",
      YamlText(request.camera),
      YamlText(request.tilt),
      YamlText(request.target),
      YamlText(request.points),
      request.distance_m);
  for (std::size_t i = 0; i < result.rig.points.size(); ++i) {
    const PointBudget& budget = result.budgets[i];
    text += fmt::format("#   {}: calibration {:.2f} mm, noise of one frame {:.2f} mm\n",
                        result.rig.points[i].name,
                        kMmPerMetre * std::sqrt(budget.calibration.trace()),
                        kMmPerMetre * std::sqrt(budget.noise.trace()));
  }
  return text + RigYaml(result.rig);
}

std::string RigSummary(const RigResult& result) {
  std::string text = fmt::format(
      "{}: {} LEDs, {} points\n"
      "with the LEDs {} m ahead of the camera, both inclinometers level, the board's side {} "
      "towards it\n",
      result.request.out,
      result.rig.leds.size(),
      result.rig.points.size(),
      result.request.distance_m,
      FacingText(result));
  for (std::size_t i = 0; i < result.rig.points.size(); ++i) text += PointTable(result, i);
  text += "\nCalibration does not average out from frame to frame; noise does.\n";
  return text;
}

std::string RigCsv(const RigResult& result) {
  std::string text = "point,source,right_mm,up_mm,along_mm,all_mm\n";
  for (std::size_t i = 0; i < result.rig.points.size(); ++i) {
    for (const BudgetRow& row : RowsOf(result, i)) {
      text += fmt::format("{},{},", result.rig.points[i].name, row.code);
      if (!row.covariance_m2) {
        text += ",,,\n";
        continue;
      }
      const Eigen::Vector3d mm = row.sigma_mm();
      text += fmt::format("{:.5f},{:.5f},{:.5f},{:.5f}\n", mm.x(), mm.y(), mm.z(), row.all_mm());
    }
  }
  return text;
}

std::string RigJson(const RigResult& result) {
  nlohmann::ordered_json json;
  json["rig_name"] = result.rig.name;
  json["distance_m"] = result.request.distance_m;
  json["centre_sigma_px"] = result.request.centre_sigma_px;
  const Rigid3& pose = result.placement.camera_from_target;
  json["camera_from_target"] = {{"qw", pose.rotation.w()},
                                {"qx", pose.rotation.x()},
                                {"qy", pose.rotation.y()},
                                {"qz", pose.rotation.z()},
                                {"tx_mm", kMmPerMetre * pose.translation.x()},
                                {"ty_mm", kMmPerMetre * pose.translation.y()},
                                {"tz_mm", kMmPerMetre * pose.translation.z()}};
  for (std::size_t i = 0; i < result.rig.points.size(); ++i) {
    nlohmann::ordered_json point = {{"name", result.rig.points[i].name},
                                    {"distance_m", result.budgets[i].distance_m}};
    for (const BudgetRow& row : RowsOf(result, i)) {
      nlohmann::ordered_json& source = point["sigma_mm"][row.code];
      source = nullptr;
      if (!row.covariance_m2) continue;
      const Eigen::Vector3d mm = row.sigma_mm();
      source = {{"right", mm.x()}, {"up", mm.y()}, {"along", mm.z()}, {"all", row.all_mm()}};
    }
    json["points"].push_back(point);
  }
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace tbm
