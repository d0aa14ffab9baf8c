#include "pose/rig/rig_text.h"

#include <cctype>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "pose/base/angle.h"
#include "pose/base/length.h"
#include "pose/rig/rig_sections.h"

namespace tbm {
namespace {

// Most names need no quotes; what YAML takes for something else does.
std::string NameYaml(const std::string& name) {
  std::string small;
  for (const char c : name) small += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  const bool is_plain = IsRigName(name) && std::isalpha(static_cast<unsigned char>(name[0])) != 0 &&
                        small != "null" && small != "true" && small != "false" && small != "yes" &&
                        small != "no" && small != "on" && small != "off";
  return is_plain ? name : YamlText(name);
}

std::string PlaceYaml(const Eigen::Vector3d& place_m, double sigma_m) {
  return fmt::format("xyz_mm: [{:.4f}, {:.4f}, {:.4f}], sigma_mm: {:.4f}",
                     kMmPerMetre * place_m.x(),
                     kMmPerMetre * place_m.y(),
                     kMmPerMetre * place_m.z(),
                     kMmPerMetre * sigma_m);
}

}  // namespace

std::string YamlText(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f) {
      quoted += fmt::format("\\x{:02x}", byte);
      continue;
    }
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + "\"";
}

std::string LensYaml(const CameraModel& c) {
  return fmt::format(
      "  image_width: {}\n  image_height: {}\n  distortion_model: plumb_bob\n"
      "  camera_matrix: {{rows: 3, cols: 3, data: [{}, 0.0, {}, 0.0, {}, {}, 0.0, 0.0, 1.0]}}\n"
      "  distortion_coefficients: {{rows: 1, cols: 5, data: [{}, {}, {}, {}, {}]}}   # k1 k2 p1 p2 "
      "k3\n",
      c.image_width_px,
      c.image_height_px,
      c.fx_px,
      c.cx_px,
      c.fy_px,
      c.cy_px,
      c.k1,
      c.k2,
      c.p1,
      c.p2,
      c.k3);
}

std::string CameraSectionYaml(const Rig& rig) {
  const Eigen::Vector4d& sigma = rig.intrinsics_sigma_px;
  std::string text = "camera:\n" + LensYaml(rig.camera) +
                     fmt::format(
                         "  residual_px: {:.9g}          # sigma of one coordinate of a point\n"
                         "  intrinsics_sigma_px: [{}, {}, {}, {}]   # fx fy cx cy\n",
                         rig.calibration_residual_px,
                         sigma[0],
                         sigma[1],
                         sigma[2],
                         sigma[3]);
  if (rig.gain_dn_per_electron) {
    text += fmt::format("  gain_dn_per_electron: {}\n", *rig.gain_dn_per_electron);
  }
  if (rig.read_noise_dn) text += fmt::format("  read_noise_dn: {}\n", *rig.read_noise_dn);
  return text;
}

std::string TargetYaml(const std::vector<Led>& leds) {
  std::string text = "target:\n  leds:               # centres in the target frame\n";
  for (const Led& led : leds) {
    text += fmt::format(
        "    - {{id: {}, {}}}\n", NameYaml(led.id), PlaceYaml(led.p_led_in_target, led.sigma_m));
  }
  return text;
}

std::string TiltMountYaml(const TiltMount& mount) {
  std::vector<std::string> numbers;
  for (int i = 0; i < 9; ++i) {
    numbers.push_back(fmt::format("{:.9f}", mount.tilt_from_body(i / 3, i % 3)));
  }
  std::string text = fmt::format(
      "    # row by row, from the body's frame into the housing's own\n"
      "    rotation: [{}]\n",
      fmt::join(numbers, ", "));
  if (mount.sign[0] != 1.0 || mount.sign[1] != 1.0) {
    text += fmt::format("    sign: [{:+.0f}, {:+.0f}]\n", mount.sign[0], mount.sign[1]);
  }
  return text + fmt::format("    sigma_deg: {:.9g}\n    mounting_sigma_deg: {:.9g}\n",
                            RadToDeg(mount.sigma_rad),
                            RadToDeg(mount.mounting_sigma_rad));
}

std::string PointsYaml(const std::vector<NamedPoint>& points) {
  if (points.empty()) return "";
  std::string text = "points:               # points to report, in the target frame\n";
  for (const NamedPoint& point : points) {
    text += fmt::format(
        "  {}: {{{}}}\n", NameYaml(point.name), PlaceYaml(point.p_point_in_target, point.sigma_m));
  }
  return text;
}

std::string RigYaml(const Rig& rig) {
  return "rig_name: " + NameYaml(rig.name) + "\n" + CameraSectionYaml(rig) + TargetYaml(rig.leds) +
         "inclinometers:\n  target:\n" + TiltMountYaml(rig.target_tilt) + "  camera:\n" +
         TiltMountYaml(rig.camera_tilt) + PointsYaml(rig.points);
}

}  // namespace tbm
