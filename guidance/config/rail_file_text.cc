#include "guidance/config/rail_file_text.h"

#include <fmt/format.h>

#include "pose/base/angle.h"
#include "pose/base/length.h"
#include "pose/rig/rig_text.h"

namespace tbm {
namespace {

// Where the line that begins at `at` ends, with its end.
std::size_t EndOfLine(std::string_view text, std::size_t at) {
  const std::size_t end = text.find('\n', at);
  return end == std::string_view::npos ? text.size() : end + 1;
}

bool IsInside(std::string_view line) { return line.starts_with(' ') || line.starts_with('\t'); }

}  // namespace

std::string RailCameraYaml(const RailCamera& camera, const std::vector<std::string>& remarks) {
  std::string text = "camera:\n";
  for (const std::string& remark : remarks) text += "  # " + remark + "\n";
  text += LensYaml(camera.model);
  text += fmt::format("  residual_px: {}\n", camera.residual_px);
  const Eigen::Matrix3d r = camera.camera_from_imu.toRotationMatrix();
  std::string numbers;
  for (int i = 0; i < 9; ++i) {
    numbers += fmt::format("{}{:.12f}", i == 0 ? "" : ", ", r(i / 3, i % 3));
  }
  text += fmt::format(
      "  rotation: [{}]   # imu frame into camera, row by row\n"
      "  position_m: [{:.7f}, {:.7f}, {:.7f}]   # of the camera in the imu frame\n"
      "  sigma_rotation_deg: {:.4g}\n  sigma_position_mm: {:.4g}\n"
      "  time_offset_s: {:.7f}   # camera stamp minus imu time\n  sigma_time_offset_s: {:.4g}\n",
      numbers,
      camera.in_imu_m.x(),
      camera.in_imu_m.y(),
      camera.in_imu_m.z(),
      RadToDeg(camera.sigma_rotation_rad),
      kMmPerMetre * camera.sigma_position_m,
      camera.time_offset_s,
      camera.sigma_time_offset_s);
  return text;
}

std::optional<std::string> WithSection(std::string_view yaml,
                                       std::string_view name,
                                       std::string_view section) {
  const std::string key = std::string(name) + ":";
  std::size_t begin = 0;
  while (begin < yaml.size() && !yaml.substr(begin).starts_with(key)) {
    begin = EndOfLine(yaml, begin);
  }
  if (begin >= yaml.size()) return std::nullopt;
  // To the last line that is indented: comments and empty lines below belong to what comes next.
  std::size_t end = EndOfLine(yaml, begin);
  for (std::size_t at = end; at < yaml.size(); at = EndOfLine(yaml, at)) {
    const std::string_view line = yaml.substr(at);
    if (IsInside(line)) {
      end = EndOfLine(yaml, at);
    } else if (!line.starts_with('#') && !line.starts_with('\n') && !line.starts_with('\r')) {
      break;
    }
  }
  return std::string(yaml.substr(0, begin)) + std::string(section) + std::string(yaml.substr(end));
}

}  // namespace tbm
