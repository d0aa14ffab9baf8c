#include "guidance/app/pose_rows.h"

#include <bit>
#include <cmath>

#include <fmt/format.h>

#include "pose/base/angle.h"

namespace tbm {
namespace {

constexpr double kMmPerM = 1000.0;

// Digits far beyond any sigma, so that a difference of two files is a difference of the poses.
std::string Mm(double value_m) {
  return std::isfinite(value_m) ? fmt::format("{:.6f}", value_m * kMmPerM) : "";
}
std::string Deg(double value_rad) {
  return std::isfinite(value_rad) ? fmt::format("{:.8f}", RadToDeg(value_rad)) : "";
}
std::string Plain(double value) {
  return std::isfinite(value) ? fmt::format("{:.12f}", value) : "";
}
std::string Px(double value_px) {
  return std::isfinite(value_px) ? fmt::format("{:.6f}", value_px) : "";
}

void AppendPose(const CheckedPose& checked, std::vector<std::string>& values) {
  const PoseEstimate& pose = checked.pose;
  Eigen::Quaterniond q = pose.camera_from_target.rotation;
  // q and -q are one rotation; the one with w >= 0 is written.
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  values.push_back(std::to_string(std::popcount(checked.leds_used)));
  for (const double part : {q.w(), q.x(), q.y(), q.z()}) values.push_back(Plain(part));
  for (int axis = 0; axis < 3; ++axis)
    values.push_back(Mm(pose.camera_from_target.translation(axis)));
  for (int axis = 0; axis < 3; ++axis)
    values.push_back(Deg(std::sqrt(pose.covariance(axis, axis))));
  for (int axis = 3; axis < 6; ++axis) values.push_back(Mm(std::sqrt(pose.covariance(axis, axis))));
  values.push_back(Px(pose.rms_px));
}

// The words among the columns; everything else is a number.
bool IsWord(std::string_view column) { return column == "status" || column == "reason"; }

}  // namespace

std::vector<std::string> PoseColumns(const Rig& rig) {
  std::vector<std::string> columns = {"stamp_ns",
                                      "status",
                                      "reason",
                                      "leds_used",
                                      "qw",
                                      "qx",
                                      "qy",
                                      "qz",
                                      "tx_mm",
                                      "ty_mm",
                                      "tz_mm",
                                      "sigma_rot_x_deg",
                                      "sigma_rot_y_deg",
                                      "sigma_rot_z_deg",
                                      "sigma_tx_mm",
                                      "sigma_ty_mm",
                                      "sigma_tz_mm",
                                      "rms_px"};
  for (const NamedPoint& point : rig.points) {
    for (const char* part : {"x_mm", "y_mm", "z_mm", "sigma_mm", "bound_mm"}) {
      columns.push_back(fmt::format("{}_{}", point.name, part));
    }
  }
  return columns;
}

std::vector<std::string> PoseValues(const Rig& rig, const FrameResult& result) {
  std::vector<std::string> values = {std::to_string(result.sensed_at.ns),
                                     std::string(StatusCode(result.status)),
                                     std::string(ReasonCode(result.reason))};
  if (result.status != PoseStatus::kNone && result.pose) {
    AppendPose(*result.pose, values);
    for (const PointResult& point : result.points) {
      for (int axis = 0; axis < 3; ++axis) values.push_back(Mm(point.p_in_camera(axis)));
      values.push_back(Mm(point.sigma_m));
      values.push_back(point.bound_m ? Mm(*point.bound_m) : "");
    }
  }
  values.resize(PoseColumns(rig).size());
  return values;
}

std::string CentreHeader() { return "stamp_ns,led,u_px,v_px,sigma_px,peak\n"; }

std::string CentreRows(const Rig& rig, const FrameResult& result) {
  std::string rows;
  for (std::size_t i = 0; i < result.centres.size(); ++i) {
    const Centre& centre = result.centres[i];
    const auto led = std::ptrdiff_t{result.led_of_centre[i]};
    rows += fmt::format("{},{},{:.5f},{:.5f},{:.5f},{:.2f}\n",
                        result.sensed_at.ns,
                        led >= 0 ? rig.leds[static_cast<std::size_t>(led)].id : "",
                        centre.pixel_px.x(),
                        centre.pixel_px.y(),
                        centre.sigma_px,
                        centre.peak_dn);
  }
  return rows;
}

std::string TableAsCsv(const std::vector<std::string>& columns,
                       const std::vector<std::vector<std::string>>& rows) {
  std::string text = fmt::format("{}\n", fmt::join(columns, ","));
  for (const auto& row : rows) text += fmt::format("{}\n", fmt::join(row, ","));
  return text;
}

std::string TableAsJson(const std::vector<std::string>& columns,
                        const std::vector<std::vector<std::string>>& rows) {
  std::string text = "[";
  for (std::size_t r = 0; r < rows.size(); ++r) {
    text += r == 0 ? "\n  {" : ",\n  {";
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const std::string& value = rows[r][c];
      const std::string shown = IsWord(columns[c]) ? "\"" + value + "\""
                                : value.empty()    ? "null"
                                                   : value;
      text += fmt::format("{}\"{}\": {}", c == 0 ? "" : ", ", columns[c], shown);
    }
    text += "}";
  }
  return text + (rows.empty() ? "]\n" : "\n]\n");
}

}  // namespace tbm
