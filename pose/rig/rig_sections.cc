#include "pose/rig/rig_sections.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <fmt/format.h>

#include "pose/base/angle.h"
#include "pose/base/length.h"
#include "pose/rig/yaml_rotation.h"

namespace tbm {
namespace {

constexpr std::size_t kMaxPoints = 16;  // room in PointResults

constexpr YamlRange kCoordinateMm{-100000.0, 100000.0, "mm"};
constexpr YamlRange kSigmaMm{0.0, 1000.0, "mm"};

// xyz_mm and sigma_mm; false without a place.
bool ReadPlace(const YamlNode& item, Eigen::Vector3d* place_m, double* sigma_m) {
  const auto xyz_mm = item.Required("xyz_mm", "three numbers [x, y, z] in the target frame")
                          .Numbers(3, kCoordinateMm);
  if (xyz_mm) *place_m = Eigen::Vector3d((*xyz_mm)[0], (*xyz_mm)[1], (*xyz_mm)[2]) / kMmPerMetre;
  *sigma_m = item.Optional("sigma_mm").Number(kSigmaMm).value_or(0.0) / kMmPerMetre;
  return xyz_mm.has_value();
}

// Appends one LED; false when it is not good enough to be compared with the others.
bool ReadLed(const YamlNode& item, const KnownKeys& known, std::vector<Led>* leds) {
  if (!item.IsMap()) {
    item.Fault("must be a map {id: P1, xyz_mm: [x, y, z], sigma_mm: 0.05}");
    return false;
  }
  known(item, {"id", "xyz_mm", "sigma_mm"});
  Led led;
  const YamlNode id = item.Required("id", "the name painted beside the LED, such as P1");
  led.id = id.Text().value_or("");
  bool is_good = IsRigName(led.id);
  if (id.exists() && !is_good) id.Fault(std::string(kRigNameRule));
  for (const Led& other : *leds) {
    if (other.id != led.id || led.id.empty()) continue;
    id.Fault(fmt::format("'{}' names two LEDs; each needs its own", led.id));
    is_good = false;
  }
  is_good = ReadPlace(item, &led.p_led_in_target, &led.sigma_m) && is_good;
  leds->push_back(led);
  return is_good;
}

void CheckLedPlaces(const YamlNode& list,
                    const std::vector<YamlNode>& items,
                    const std::vector<Led>& leds) {
  constexpr double kClosestM = 0.001;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < leds.size(); ++i) {
    mean += leds[i].p_led_in_target / static_cast<double>(leds.size());
    for (std::size_t j = 0; j < i; ++j) {
      const auto& [id, place, sigma] = leds[j];
      if ((place - leds[i].p_led_in_target).norm() < kClosestM) {
        items[i].Fault(
            fmt::format("{} is less than 1 mm from {}; they cannot be told apart", leds[i].id, id));
      }
    }
  }
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Led& led : leds) {
    const Eigen::Vector3d d = led.p_led_in_target - mean;
    scatter += d * d.transpose();
  }
  const Eigen::Vector3d spread = scatter.jacobiSvd().singularValues();
  // Second largest spread below 1/1000 of the largest: the turn about the line is not visible.
  if (spread(1) < 1e-6 * spread(0)) list.Fault("all LEDs stand on one line; move one aside");
}

}  // namespace

bool IsRigName(std::string_view text) {
  const auto is_fine = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  return !text.empty() && text.size() <= 32 && std::all_of(text.begin(), text.end(), is_fine);
}

void ReadCameraSection(const YamlNode& camera, const KnownKeys& known, Rig* rig) {
  if (!camera.IsMap()) return;
  known(camera,
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
  ReadCameraModel(camera, known, &rig->camera);
  rig->calibration_residual_px =
      camera.Optional("residual_px").Number({0.0, 100.0, "px"}).value_or(0.0);
  if (const auto sigma = camera.Optional("intrinsics_sigma_px").Numbers(4, {0.0, 1000.0, "px"})) {
    rig->intrinsics_sigma_px = Eigen::Vector4d((*sigma)[0], (*sigma)[1], (*sigma)[2], (*sigma)[3]);
  }
  rig->gain_dn_per_electron =
      camera.Optional("gain_dn_per_electron").Number({0.0, 1000.0, "DN/electron", true});
  rig->read_noise_dn = camera.Optional("read_noise_dn").Number({0.0, 1000.0, "DN"});
}

void ReadTargetSection(const YamlNode& target, const KnownKeys& known, std::vector<Led>* leds) {
  if (!target.IsMap()) return;
  known(target, {"leds"});
  const YamlNode list = target.Required("leds", "a list of {id, xyz_mm, sigma_mm}");
  if (!list.exists()) return;
  const auto items = list.Items();
  if (!list.IsList() || items.size() < kMinLeds || items.size() > kMaxLeds) {
    list.Fault(
        fmt::format("must be a list of {} .. {} LEDs, has {}", kMinLeds, kMaxLeds, items.size()));
  }
  bool are_good = true;
  for (const YamlNode& item : items) {
    if (leds->size() == kMaxLeds) break;
    are_good = ReadLed(item, known, leds) && are_good;
  }
  if (are_good && leds->size() >= kMinLeds) CheckLedPlaces(list, items, *leds);
}

void ReadTiltMount(const YamlNode& node, const KnownKeys& known, TiltMount* mount) {
  if (!node.IsMap()) return;
  known(node, {"rotation", "sign", "sigma_deg", "mounting_sigma_deg"});
  const auto rotation = RotationOf(
      node.Required("rotation", "nine numbers, row by row, body frame into the housing's own"));
  if (rotation) mount->tilt_from_body = *rotation;
  const YamlNode sign = node.Optional("sign");
  if (const auto signs = sign.Numbers(2, {-1.0, 1.0, ""})) {
    mount->sign = {(*signs)[0], (*signs)[1]};
    if (std::abs(mount->sign[0]) != 1.0 || std::abs(mount->sign[1]) != 1.0) {
      sign.Fault("each sign must be +1 or -1");
    }
  }
  const auto sigma_deg = node.Required("sigma_deg", "noise of one output, more than 0 .. 10 deg")
                             .Number({0.0, 10.0, "deg", true});
  mount->sigma_rad = DegToRad(sigma_deg.value_or(0.0));
  mount->mounting_sigma_rad =
      DegToRad(node.Optional("mounting_sigma_deg").Number({0.0, 10.0, "deg"}).value_or(0.0));
}

void ReadPointsSection(const YamlNode& points,
                       const KnownKeys& known,
                       std::vector<NamedPoint>* list) {
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
    if (!IsRigName(name)) item.Fault(std::string(kRigNameRule));
    if (!item.IsMap()) {
      item.Fault("must be a map {xyz_mm: [x, y, z], sigma_mm: 0.2}");
      continue;
    }
    known(item, {"xyz_mm", "sigma_mm"});
    NamedPoint point;
    point.name = name;
    ReadPlace(item, &point.p_point_in_target, &point.sigma_m);
    list->push_back(point);
  }
}

}  // namespace tbm
