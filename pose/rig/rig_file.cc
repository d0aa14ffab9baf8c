#include "pose/rig/rig_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <fmt/format.h>

#include "pose/base/angle.h"
#include "pose/rig/camera_section.h"
#include "pose/rig/rig_yaml.h"
#include "pose/rig/yaml_rotation.h"

namespace tbm {
namespace {

constexpr std::size_t kMostBytes = 1 << 20;
constexpr std::size_t kMaxPoints = 16;  // room in PointResults
constexpr double kMmPerM = 1000.0;

constexpr YamlRange kCoordinateMm{-100000.0, 100000.0, "mm"};
constexpr YamlRange kSigmaMm{0.0, 1000.0, "mm"};

// Names become CSV column names and field values, so they stay free of commas, quotes and blanks.
bool IsName(std::string_view text) {
  const auto is_fine = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  return !text.empty() && text.size() <= 32 && std::all_of(text.begin(), text.end(), is_fine);
}
constexpr std::string_view kNameRule =
    "must be 1 to 32 letters, digits, '_', '-' or '.' because it becomes part of column names";

double InMetres(double value_mm) { return value_mm / kMmPerM; }

class RigReader {
 public:
  explicit RigReader(const std::string& file) : file_(file) {}

  void Read(const YAML::Node& document) {
    const YamlNode root(document, "", file_, &faults_);
    if (!root.IsMap()) {
      root.Fault("must be a map with the keys camera, target, inclinometers and points");
      return;
    }
    Known(root, {"rig_name", "camera", "target", "inclinometers", "points"});
    rig_.name = root.Optional("rig_name").Text().value_or("");
    ReadCamera(Section(root, "camera", "the layout of a ROS camera_info file goes here"));
    ReadLeds(Section(root, "target", "with the list `leds`"));
    ReadInclinometers(Section(root, "inclinometers", "with `target` and `camera`"));
    ReadPoints(root.Optional("points"));
  }

  Rig& rig() { return rig_; }
  RigFileFaults& faults() { return faults_; }
  RigFileFaults& warnings() { return warnings_; }

 private:
  static YamlNode Section(const YamlNode& parent, std::string_view name, std::string_view hint) {
    YamlNode section = parent.Required(name, hint);
    if (section.exists() && !section.IsMap()) section.Fault(fmt::format("must be a map {}", hint));
    return section;
  }

  // Says which keys nobody reads: `mounting_sigma_dg` would otherwise silently promise a perfect
  // mounting. Double keys become faults inside Names().
  void Known(const YamlNode& map, const std::set<std::string_view>& known) {
    for (const std::string& name : map.Names()) {
      if (known.contains(name)) continue;
      std::string list;
      for (const std::string_view word : known)
        list += (list.empty() ? "" : ", ") + std::string(word);
      const YamlNode member = map.Optional(name);
      warnings_.push_back({file_,
                           member.line(),
                           member.key(),
                           fmt::format("is read by nobody; known here are {}", list)});
    }
  }

  void ReadCamera(const YamlNode& camera) {
    if (!camera.IsMap()) return;
    Known(camera,
          {"image_width",
           "image_height",
           "distortion_model",
           "camera_matrix",
           "distortion_coefficients",
           "residual_px",
           "intrinsics_sigma_px",
           "gain_dn_per_electron",
           "read_noise_dn",
           "camera_name",
           "rectification_matrix",
           "projection_matrix",
           "header",
           "binning_x",
           "binning_y",
           "roi",
           "calibration_time",
           "nframes",
           "nr_of_frames",
           "board_width",
           "board_height",
           "square_size",
           "flags",
           "fisheye_model",
           "avg_reprojection_error",
           "per_view_reprojection_errors",
           "extrinsic_parameters",
           "image_points",
           "grid_points",
           "aspectRatio",
           "fix_aspect_ratio"});
    ReadCameraModel(
        camera,
        [this](const YamlNode& map, const std::set<std::string_view>& known) { Known(map, known); },
        &rig_.camera);

    rig_.calibration_residual_px =
        camera.Optional("residual_px").Number({0.0, 100.0, "px"}).value_or(0.0);
    if (const auto sigma = camera.Optional("intrinsics_sigma_px").Numbers(4, {0.0, 1000.0, "px"})) {
      rig_.intrinsics_sigma_px =
          Eigen::Vector4d((*sigma)[0], (*sigma)[1], (*sigma)[2], (*sigma)[3]);
    }
    rig_.gain_dn_per_electron =
        camera.Optional("gain_dn_per_electron").Number({0.0, 1000.0, "DN/electron", true});
    rig_.read_noise_dn = camera.Optional("read_noise_dn").Number({0.0, 1000.0, "DN"});
  }

  void ReadLeds(const YamlNode& target) {
    if (!target.IsMap()) return;
    Known(target, {"leds"});
    const YamlNode list = target.Required("leds", "a list of {id, xyz_mm, sigma_mm}");
    if (!list.exists()) return;
    const auto items = list.Items();
    if (!list.IsList() || items.size() < kMinLeds || items.size() > kMaxLeds) {
      list.Fault(
          fmt::format("must be a list of {} .. {} LEDs, has {}", kMinLeds, kMaxLeds, items.size()));
    }
    const std::size_t faults_before = faults_.size();
    for (const YamlNode& item : items) {
      if (rig_.leds.size() == kMaxLeds) break;
      ReadLed(item);
    }
    if (faults_.size() == faults_before && rig_.leds.size() >= kMinLeds)
      CheckLedPlaces(list, items);
  }

  void ReadLed(const YamlNode& item) {
    if (!item.IsMap()) {
      item.Fault("must be a map {id: P1, xyz_mm: [x, y, z], sigma_mm: 0.05}");
      return;
    }
    Known(item, {"id", "xyz_mm", "sigma_mm"});
    Led led;
    const YamlNode id = item.Required("id", "the name painted beside the LED, such as P1");
    led.id = id.Text().value_or("");
    if (id.exists() && !IsName(led.id)) id.Fault(std::string(kNameRule));
    for (const Led& other : rig_.leds) {
      if (other.id == led.id && !led.id.empty()) {
        id.Fault(fmt::format("'{}' names two LEDs; each needs its own", led.id));
      }
    }
    ReadPlace(item, led.p_led_in_target, led.sigma_m);
    rig_.leds.push_back(led);
  }

  void ReadPlace(const YamlNode& item, Eigen::Vector3d& place_m, double& sigma_m) {
    const auto xyz_mm = item.Required("xyz_mm", "three numbers [x, y, z] in the target frame")
                            .Numbers(3, kCoordinateMm);
    if (xyz_mm) place_m = Eigen::Vector3d((*xyz_mm)[0], (*xyz_mm)[1], (*xyz_mm)[2]) / kMmPerM;
    sigma_m = InMetres(item.Optional("sigma_mm").Number(kSigmaMm).value_or(0.0));
  }

  void CheckLedPlaces(const YamlNode& list, const std::vector<YamlNode>& items) {
    constexpr double kClosestM = 0.001;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < rig_.leds.size(); ++i) {
      mean += rig_.leds[i].p_led_in_target / static_cast<double>(rig_.leds.size());
      for (std::size_t j = 0; j < i; ++j) {
        const auto& [id, place, sigma] = rig_.leds[j];
        if ((place - rig_.leds[i].p_led_in_target).norm() < kClosestM) {
          items[i].Fault(fmt::format(
              "{} is less than 1 mm from {}; they cannot be told apart", rig_.leds[i].id, id));
        }
      }
    }
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const Led& led : rig_.leds) {
      const Eigen::Vector3d d = led.p_led_in_target - mean;
      scatter += d * d.transpose();
    }
    const Eigen::Vector3d spread = scatter.jacobiSvd().singularValues();
    // Second largest spread below 1/1000 of the largest: the turn about the line is not visible.
    if (spread(1) < 1e-6 * spread(0)) list.Fault("all LEDs stand on one line; move one aside");
  }

  void ReadInclinometers(const YamlNode& inclinometers) {
    if (!inclinometers.IsMap()) return;
    Known(inclinometers, {"target", "camera"});
    constexpr std::string_view kHint = "{rotation: [nine numbers], sigma_deg: 0.005}";
    ReadMount(Section(inclinometers, "target", kHint), rig_.target_tilt);
    ReadMount(Section(inclinometers, "camera", kHint), rig_.camera_tilt);
  }

  void ReadMount(const YamlNode& node, TiltMount& mount) {
    if (!node.IsMap()) return;
    Known(node, {"rotation", "sign", "sigma_deg", "mounting_sigma_deg"});
    const auto rotation = RotationOf(
        node.Required("rotation", "nine numbers, row by row, body frame into the housing's own"));
    if (rotation) mount.tilt_from_body = *rotation;
    const YamlNode sign = node.Optional("sign");
    if (const auto signs = sign.Numbers(2, {-1.0, 1.0, ""})) {
      mount.sign = {(*signs)[0], (*signs)[1]};
      if (std::abs(mount.sign[0]) != 1.0 || std::abs(mount.sign[1]) != 1.0) {
        sign.Fault("each sign must be +1 or -1");
      }
    }
    const auto sigma_deg = node.Required("sigma_deg", "noise of one output, more than 0 .. 10 deg")
                               .Number({0.0, 10.0, "deg", true});
    mount.sigma_rad = DegToRad(sigma_deg.value_or(0.0));
    mount.mounting_sigma_rad =
        DegToRad(node.Optional("mounting_sigma_deg").Number({0.0, 10.0, "deg"}).value_or(0.0));
  }

  void ReadPoints(const YamlNode& points) {
    if (!points.exists()) return;
    if (!points.IsMap()) {
      points.Fault("must be a map: shield_head: {xyz_mm: [x, y, z], sigma_mm: 0.2}");
      return;
    }
    const auto names = points.Names();
    if (names.size() > kMaxPoints) {
      points.Fault(fmt::format("has {} points; allowed is 0 .. {}", names.size(), kMaxPoints));
    }
    for (const std::string& name : names) {
      const YamlNode item = points.Optional(name);
      if (!IsName(name)) item.Fault(std::string(kNameRule));
      if (!item.IsMap()) {
        item.Fault("must be a map {xyz_mm: [x, y, z], sigma_mm: 0.2}");
        continue;
      }
      Known(item, {"xyz_mm", "sigma_mm"});
      NamedPoint point;
      point.name = name;
      ReadPlace(item, point.p_point_in_target, point.sigma_m);
      rig_.points.push_back(point);
    }
  }

  std::string file_;
  Rig rig_;
  RigFileFaults faults_;
  RigFileFaults warnings_;
};

Failure<RigFileFaults> WholeFile(const std::string& file, int line, std::string what) {
  return Failure{RigFileFaults{{file, line, "", std::move(what)}}};
}

}  // namespace

std::string RigFileFault::Text() const {
  std::string text = file;
  if (line > 0) text += fmt::format(":{}", line);
  if (!key.empty()) text += ": " + key;
  return text + ": " + what;
}

Result<LoadedRig, RigFileFaults> ParseRig(std::string_view yaml, const std::string& file) {
  if (yaml.size() > kMostBytes)
    return WholeFile(file, 0, "is larger than 1 MB; this is no rig file");
  if (yaml.find('\0') != std::string_view::npos) {
    return WholeFile(file, 0, "holds zero bytes; a rig file is UTF-8 text");
  }
  try {
    RigReader reader(file);
    reader.Read(YAML::Load(std::string(yaml)));
    if (!reader.faults().empty()) return Failure{std::move(reader.faults())};
    return LoadedRig{std::move(reader.rig()), std::move(reader.warnings())};
  } catch (const YAML::Exception& error) {
    const int line = error.mark.is_null() ? 0 : error.mark.line + 1;
    return WholeFile(file, line, fmt::format("is not YAML: {}", error.msg));
  } catch (const std::exception& error) {
    return WholeFile(file, 0, fmt::format("cannot be read as YAML: {}", error.what()));
  }
}

Result<LoadedRig, RigFileFaults> LoadRigFile(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream)
    return WholeFile(
        path, 0, "cannot be opened; a run folder needs it (camera, LEDs, inclinometers)");
  std::string text(kMostBytes + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad()) return WholeFile(path, 0, "cannot be read");
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return ParseRig(text, path);
}

}  // namespace tbm
