#include "guidance/config/calibration_parts.h"

#include <cmath>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "guidance/config/camera_node.h"
#include "pose/rig/camera_section.h"
#include "pose/rig/rig_sections.h"
#include "pose/rig/yaml_section.h"

namespace tbm {
namespace {

using Covariance = Eigen::Matrix<double, 9, 9>;

// A mistyped optional key would be lost silently.
void RefuseOthers(const YamlNode& map, const std::set<std::string_view>& known) {
  for (const std::string& name : map.Names()) {
    if (known.contains(name)) continue;
    map.Optional(name).Fault(
        fmt::format("nobody reads this key; known here: {}", fmt::join(known, ", ")));
  }
}

bool IsMap(const YamlNode& root, std::string_view what) {
  if (!root.IsMap()) root.Fault(fmt::format("is not a map with {}", what));
  return root.IsMap();
}

// Rounded when written: entries agree to some digits, and what is almost a combination of others
// may come out a little negative.
bool IsCovariance(const Covariance& covariance) {
  const Eigen::Matrix<double, 9, 1> sigma = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  Covariance correlation = Covariance::Identity();
  for (int i = 0; i < 9; ++i) {
    if (covariance(i, i) < 0.0) return false;
    for (int j = 0; j < i; ++j) {
      const double scale = sigma[i] * sigma[j];
      if (std::abs(covariance(i, j) - covariance(j, i)) > 1e-4 * scale) return false;
      if (scale > 0.0) correlation(i, j) = correlation(j, i) = covariance(i, j) / scale;
    }
  }
  return Eigen::SelfAdjointEigenSolver<Covariance>(correlation).eigenvalues()[0] > -1e-3;
}

bool BelongsTo(const Eigen::Vector4d& sigma_px, const Covariance& covariance) {
  for (int i = 0; i < 4; ++i) {
    const double own_px = std::sqrt(covariance(i, i));
    if (std::abs(own_px - sigma_px[i]) > 0.02 * own_px + 2e-5) return false;
  }
  return true;
}

// Eight parameters, or nine with k3.
std::optional<Covariance> ReadCovariance(const YamlNode& node, const Eigen::Vector4d& sigma_px) {
  if (!node.exists()) return {};
  const std::size_t side = node.IsList() && node.Items().size() == 81 ? 9 : 8;
  const auto numbers = node.Numbers(side * side, {-1e9, 1e9, ""});
  if (!numbers) return {};
  Covariance covariance = Covariance::Zero();
  for (std::size_t i = 0; i < side * side; ++i) {
    covariance(static_cast<Eigen::Index>(i / side), static_cast<Eigen::Index>(i % side)) =
        (*numbers)[i];
  }
  if (!IsCovariance(covariance)) {
    node.Fault(
        "is no covariance: it must be symmetric, and no correlation may exceed 1; calibrate "
        "the camera again, or take the key out");
    return {};
  }
  if (!BelongsTo(sigma_px, covariance)) {
    node.Fault(
        "does not belong to intrinsics_sigma_px, whose squares must stand in its diagonal; "
        "calibrate the camera again, or take the key out");
    return {};
  }
  return covariance;
}

CameraPart ReadCameraPart(const YamlNode& root) {
  CameraPart part;
  const YamlNode camera = CameraNodeOf(root);
  if (!camera.IsMap()) return part;
  // What a calibration adds beside the camera stands in the same map when there is no `camera:`.
  const bool is_bare = camera.key().empty();
  const KnownKeys known = [&](const YamlNode& map, const std::set<std::string_view>& keys) {
    if (!is_bare) RefuseOthers(map, keys);
  };
  ReadCameraSection(camera, known, &part.rig);
  camera.Required("residual_px", "what the lens model leaves at a point, in px; 0 .. 100");
  camera.Required("intrinsics_sigma_px",
                  "sigma of fx fy cx cy in px, a list of four; tbm calibrate camera finds them");
  part.intrinsics = ReadCovariance(root.Optional("calibrated").Optional("covariance"),
                                   part.rig.intrinsics_sigma_px);
  return part;
}

// One inclinometer, with the sigma of its mounting.
void ReadMount(const YamlNode& root,
               std::string_view name,
               std::string_view hint,
               TiltMount* mount) {
  const YamlNode mounts = SectionOf(root, "inclinometers", hint);
  const YamlNode node = SectionOf(mounts, name, kTiltMountRule);
  ReadTiltMount(node, RefuseOthers, mount);
  node.Required("mounting_sigma_deg", "how well the rotation is known, per axis; 0 .. 10 deg");
}

// Keys that other programs put beside a camera are no harm here.
void PassOver(const YamlNode&, const std::set<std::string_view>&) {}

void ReadTiltCamera(const YamlNode& root, TiltPart* part) {
  const YamlNode found_with = root.Optional("calibrated").Optional("camera");
  const YamlNode own = root.Optional("camera");
  const YamlNode& camera = found_with.exists() || !own.exists() ? found_with : own;
  part->camera_key = camera.key();
  part->camera_line = camera.line();
  if (camera.IsMap()) {
    ReadCameraModel(camera, PassOver, &part->camera);
  } else if (camera.exists()) {
    camera.Fault("must be a map with image_width, image_height, camera_matrix, ..");
  } else {
    camera.Fault(
        "missing; a rotation belongs to the camera it was found with, and is wrong with another: "
        "run tbm calibrate tilt, which writes it down, or copy the `camera:` section of that "
        "camera's file into this one");
  }
}

TiltPart ReadTiltPart(const YamlNode& root) {
  TiltPart part;
  if (!IsMap(root, "`inclinometers:`, as tbm calibrate tilt writes it")) return part;
  ReadMount(root, "camera", "with `camera`, which tbm calibrate tilt finds", &part.mount);
  ReadTiltCamera(root, &part);
  return part;
}

TargetPart ReadTargetPart(const YamlNode& root) {
  TargetPart part;
  if (!IsMap(root, "`target:` and `inclinometers:`, as tbm calibrate target writes it")) {
    return part;
  }
  const YamlNode target = SectionOf(root, "target", "with the list `leds`");
  ReadTargetSection(target, RefuseOthers, &part.leds);
  for (const YamlNode& led : target.Optional("leds").Items()) {
    led.Required("sigma_mm", "of each coordinate; 0 .. 1000 mm");
  }
  ReadMount(root,
            "target",
            "with `target`, how the board's inclinometer is mounted: tbm calibrate target finds it "
            "from readings at two placements or more, tilted differently",
            &part.mount);
  return part;
}

PointsPart ReadPointsPart(const YamlNode& root) {
  PointsPart part;
  if (!IsMap(root, "`points:` and, if you like, `rig_name:`")) return part;
  constexpr std::string_view kRule = "such as shield_head: {xyz_mm: [3, -5, -1600], sigma_mm: 0.2}";
  part.rig_name = root.Optional("rig_name").Text().value_or("");
  const YamlNode points = SectionOf(root, "points", kRule);
  ReadPointsSection(points, RefuseOthers, &part.points);
  if (!points.IsMap()) return part;
  if (points.Names().empty()) points.Fault(fmt::format("has none; {}", kRule));
  for (const std::string& name : points.Names()) {
    points.Optional(name).Required("sigma_mm", "of each coordinate; 0 .. 1000 mm");
  }
  return part;
}

std::vector<Led> ReadLeds(const YamlNode& root) {
  std::vector<Led> leds;
  if (!IsMap(root, "`target:`, as a rig file has it")) return leds;
  ReadTargetSection(SectionOf(root, "target", "with the list `leds`"), RefuseOthers, &leds);
  return leds;
}

template <class Part>
Result<Part, RigFileFaults> Load(const std::string& path,
                                 std::string_view what,
                                 Result<Part, RigFileFaults> (*parse)(std::string_view,
                                                                      const std::string&)) {
  const auto text = ReadConfigText(path, what);
  if (!text) return Failure{text.error()};
  return parse(*text, path);
}

}  // namespace

Result<CameraPart, RigFileFaults> ParseCameraPart(std::string_view yaml, const std::string& file) {
  return ReadYaml(yaml, file, ReadCameraPart);
}
Result<CameraPart, RigFileFaults> LoadCameraPart(const std::string& path) {
  return Load(path, "file that tbm calibrate camera wrote", ParseCameraPart);
}

Result<TiltPart, RigFileFaults> ParseTiltPart(std::string_view yaml, const std::string& file) {
  return ReadYaml(yaml, file, ReadTiltPart);
}
Result<TiltPart, RigFileFaults> LoadTiltPart(const std::string& path) {
  return Load(path, "file that tbm calibrate tilt wrote", ParseTiltPart);
}

Result<TargetPart, RigFileFaults> ParseTargetPart(std::string_view yaml, const std::string& file) {
  return ReadYaml(yaml, file, ReadTargetPart);
}
Result<TargetPart, RigFileFaults> LoadTargetPart(const std::string& path) {
  return Load(path, "file that tbm calibrate target wrote", ParseTargetPart);
}

Result<PointsPart, RigFileFaults> ParsePointsPart(std::string_view yaml, const std::string& file) {
  return ReadYaml(yaml, file, ReadPointsPart);
}
Result<PointsPart, RigFileFaults> LoadPointsPart(const std::string& path) {
  return Load(path, "file with `points:`", ParsePointsPart);
}

Result<std::vector<Led>, RigFileFaults> ParseLeds(std::string_view yaml, const std::string& file) {
  return ReadYaml(yaml, file, ReadLeds);
}
Result<std::vector<Led>, RigFileFaults> LoadLeds(const std::string& path) {
  return Load(path, "rig file, or of a drawing (.csv)", ParseLeds);
}

}  // namespace tbm
