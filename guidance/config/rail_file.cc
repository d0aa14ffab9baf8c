#include "guidance/config/rail_file.h"

#include <cmath>
#include <optional>

#include "pose/base/angle.h"
#include "pose/rig/camera_section.h"
#include "pose/rig/yaml_rotation.h"
#include "pose/rig/yaml_section.h"

namespace tbm {
namespace {

constexpr double kStandardGravity_m_s2 = 9.80665;
constexpr double kSecondsPerHour = 3600.0;

// A bias that wanders within `sigma` over kBiasTime_s, as a walk [unit / sqrt(s)].
double WalkOf(double sigma) { return sigma * std::sqrt(2.0 / kBiasTime_s); }

void ReadImu(const YamlNode& node, RailImu* imu) {
  if (!node.IsMap()) {
    if (node.exists()) node.Fault("must be a map with rate_hz, angle_random_walk_deg_sqrt_h, ..");
    return;
  }
  YamlSection keys(node);
  const auto number = [&](std::string_view name, double high, std::string_view unit) {
    const auto value =
        keys.Require(name, "from the unit's data sheet").Number({0.0, high, unit, true});
    return value.value_or(1.0);
  };
  const auto optional = [&](std::string_view name, double high, std::string_view unit) {
    double value = 0.0;
    keys.Number(name, 0.0, high, unit, &value);
    return value;
  };
  imu->rate_hz = number("rate_hz", 10'000.0, "Hz");
  imu->noise.angle_random_walk_rad =
      DegToRad(number("angle_random_walk_deg_sqrt_h", 100.0, "deg/sqrt(h)")) /
      std::sqrt(kSecondsPerHour);
  imu->noise.velocity_random_walk_m_s =
      number("velocity_random_walk_ug_sqrt_hz", 1e5, "ug/sqrt(Hz)") * 1e-6 * kStandardGravity_m_s2;
  imu->gyro_bias_sigma_rad_s = DegToRad(number("gyro_bias_deg_h", 1e5, "deg/h")) / kSecondsPerHour;
  imu->accel_bias_sigma_m_s2 = number("accel_bias_mg", 1000.0, "mg") * 1e-3 * kStandardGravity_m_s2;
  imu->noise.gyro_bias_walk_rad_s =
      WalkOf(DegToRad(optional("gyro_instability_deg_h", 1e5, "deg/h")) / kSecondsPerHour);
  imu->noise.accel_bias_walk_m_s2 =
      WalkOf(optional("accel_instability_ug", 1e6, "ug") * 1e-6 * kStandardGravity_m_s2);
  keys.RefuseOthers();
}

std::optional<TiltMounting> ReadTilt(const YamlNode& node) {
  if (!IsSection(node)) return {};
  YamlSection keys(node);
  TiltMounting tilt;
  const auto rotation =
      RotationOf(keys.Require("rotation", "nine numbers, row by row, imu frame into the housing"));
  if (rotation) tilt.housing_from_imu = Eigen::Quaterniond(*rotation);
  const auto sigma_deg =
      keys.Require("sigma_deg", "noise of one reading").Number({0.0, 10.0, "deg", true});
  tilt.sigma_rad = DegToRad(sigma_deg.value_or(1.0));
  double rotation_deg = 0.0;
  keys.Number("sigma_rotation_deg", 0.0, 10.0, "deg", &rotation_deg);
  tilt.sigma_rotation_rad = DegToRad(rotation_deg);
  keys.RefuseOthers();
  return tilt;
}

// The lens of a camera, how it is turned and where it is in the imu frame.
void ReadMountedCamera(const YamlNode& node,
                       YamlSection* keys,
                       CameraModel* model,
                       Eigen::Quaterniond* camera_from_imu,
                       Eigen::Vector3d* in_imu_m) {
  for (const char* key : {"image_width",
                          "image_height",
                          "distortion_model",
                          "camera_matrix",
                          "distortion_coefficients"}) {
    (void)keys->Know(key);
  }
  ReadCameraModel(
      node, [](const YamlNode&, const std::set<std::string_view>&) {}, model);
  const auto rotation =
      RotationOf(keys->Require("rotation", "nine numbers, row by row, imu frame into camera"));
  if (rotation) *camera_from_imu = Eigen::Quaterniond(*rotation);
  const auto position = keys->Require("position_m", "[x, y, z] of the camera in the imu frame")
                            .Numbers(3, {-100.0, 100.0, "m"});
  if (position) *in_imu_m = {(*position)[0], (*position)[1], (*position)[2]};
}

// Required, as all such sigmas: without it a thing would count as built in exactly.
double SigmaOfRotation(YamlSection* keys) {
  const auto sigma_deg = keys->Require("sigma_rotation_deg", "how well rotation is known, e.g. 0.1")
                             .Number({0.0, 10.0, "deg", true});
  return DegToRad(sigma_deg.value_or(1.0));
}

std::optional<RailCamera> ReadCamera(const YamlNode& node) {
  if (!IsSection(node)) return {};
  YamlSection keys(node);
  RailCamera camera;
  ReadMountedCamera(node, &keys, &camera.model, &camera.camera_from_imu, &camera.in_imu_m);
  const auto residual_px =
      keys.Require("residual_px", "sigma of one coordinate of an image point, e.g. 0.1")
          .Number({0.0, 100.0, "px", true});
  camera.residual_px = residual_px.value_or(1.0);
  camera.sigma_rotation_rad = SigmaOfRotation(&keys);
  const auto sigma_mm = keys.Require("sigma_position_mm", "how well position_m is known, e.g. 0.5")
                            .Number({0.0, 1000.0, "mm", true});
  camera.sigma_position_m = 1e-3 * sigma_mm.value_or(1.0);
  keys.Number("time_offset_s", -1.0, 1.0, "s", &camera.time_offset_s);
  const auto sigma_s =
      keys.Require("sigma_time_offset_s", "how well time_offset_s is known, e.g. 0.005")
          .Number({0.0, 1.0, "s", true});
  camera.sigma_time_offset_s = sigma_s.value_or(1.0);
  keys.RefuseOthers();
  return camera;
}

std::optional<RailGroundCamera> ReadGroundCamera(const YamlNode& node) {
  if (!IsSection(node)) return {};
  YamlSection keys(node);
  RailGroundCamera camera;
  ReadMountedCamera(node, &keys, &camera.model, &camera.camera_from_imu, &camera.in_imu_m);
  const auto height_m =
      keys.Require("height_m", "of the camera over the ground, e.g. 0.5").Number({0.02, 10.0, "m"});
  camera.height_m = height_m.value_or(1.0);
  const auto sigma_mm = keys.Require("sigma_height_mm", "how well that is known, e.g. 5")
                            .Number({0.0, 1000.0, "mm", true});
  camera.sigma_height_m = 1e-3 * sigma_mm.value_or(1.0);
  camera.sigma_rotation_rad = SigmaOfRotation(&keys);
  keys.Scaled("sigma_mm", 0.0, 1000.0, "mm", 1e3, &camera.sigma_m);
  keys.RefuseOthers();
  return camera;
}

std::optional<RailOdometer> ReadOdometer(const YamlNode& node) {
  if (!IsSection(node)) return {};
  YamlSection keys(node);
  RailOdometer odometer;
  OdometerMounting& mounting = odometer.mounting;
  const auto rotation = RotationOf(keys.Require(
      "rotation", "nine numbers, row by row, imu frame into vehicle: x along the rail, z up"));
  if (rotation) mounting.vehicle_from_imu = Eigen::Quaterniond(*rotation);
  const auto position = keys.Require("position_m", "[x, y, z] of the wheel in the imu frame")
                            .Numbers(3, {-100.0, 100.0, "m"});
  if (position) mounting.wheel_in_imu_m = {(*position)[0], (*position)[1], (*position)[2]};
  const auto sigma_mm =
      keys.Require("sigma_mm", "of one reading, e.g. 0.5").Number({0.0, 1000.0, "mm", true});
  odometer.sigma_m = 1e-3 * sigma_mm.value_or(1.0);
  const auto scale_ppm =
      keys.Require("sigma_scale_ppm", "how well the wheel's circumference is known, e.g. 2000")
          .Number({0.0, 1e5, "ppm", true});
  odometer.sigma_scale = 1e-6 * scale_ppm.value_or(1.0);
  odometer.sigma_rotation_rad = SigmaOfRotation(&keys);
  const auto side_mm_s =
      keys.Require("sigma_side_mm_s", "how fast the wheel may leave the rail's direction, e.g. 5")
          .Number({0.0, 1e4, "mm/s", true});
  mounting.sigma_side_m_s = 1e-3 * side_mm_s.value_or(1.0);
  keys.RefuseOthers();
  return odometer;
}

void ReadStart(const YamlNode& node, RailStart* start) {
  if (!node.IsMap()) {
    if (node.exists()) node.Fault("must be a map {position_m: [x, y, z], at_rest_s: 10, ..}");
    return;
  }
  YamlSection keys(node);
  const auto position =
      keys.Require("position_m", "[x, y, z] of the unit in the world").Numbers(3, {-1e8, 1e8, "m"});
  if (position) start->position_world_m = {(*position)[0], (*position)[1], (*position)[2]};
  const auto sigma_mm = keys.Require("sigma_position_mm", "how well position_m is known, e.g. 0.5")
                            .Number({0.0, 1e5, "mm", true});
  start->sigma_position_m = 1e-3 * sigma_mm.value_or(1.0);
  const auto at_rest_s =
      keys.Require("at_rest_s", "how long the trolley rests at first, at least 2 s")
          .Number({2.0, 86'400.0, "s"});
  start->at_rest_s = at_rest_s.value_or(2.0);
  bool heading_known = false;
  keys.Flag("heading_known", &heading_known);
  const YamlNode heading = keys.Know("heading_deg");
  const YamlNode sigma = keys.Know("sigma_heading_deg");
  const auto heading_deg = heading.exists() ? heading.Number({-360.0, 360.0, "deg"}) : std::nullopt;
  const auto sigma_deg = sigma.exists() ? sigma.Number({0.0, 180.0, "deg", true}) : std::nullopt;
  if (heading_known && !heading.exists()) {
    node.Fault(
        "says heading_known: true, and there is no heading_deg (of the unit's x in the "
        "world, from x towards y)");
  }
  if (heading_known && !sigma.exists()) {
    node.Fault(
        "says heading_known: true, and there is no sigma_heading_deg: how well it is known, e.g. "
        "0.05");
  }
  if (heading_known) {
    start->heading_rad = DegToRad(heading_deg.value_or(0.0));
    start->sigma_heading_rad = DegToRad(sigma_deg.value_or(1.0));
  }
  keys.RefuseOthers();
}

RailSetup Read(const YamlNode& root) {
  RailSetup setup;
  if (!root.IsMap()) {
    root.Fault(
        "is not a map with gravity_m_s2, imu, tilt, camera, odometer, ground_camera and start");
    return setup;
  }
  YamlSection keys(root);
  keys.Number("gravity_m_s2", 9.7, 9.9, "m/s2", &setup.gravity_m_s2);
  ReadImu(keys.Require("imu", "rate and noise of the inertial unit"), &setup.imu);
  setup.tilt = ReadTilt(keys.Know("tilt"));
  setup.camera = ReadCamera(keys.Know("camera"));
  setup.odometer = ReadOdometer(keys.Know("odometer"));
  setup.ground = ReadGroundCamera(keys.Know("ground_camera"));
  ReadStart(keys.Require("start", "where the run begins and how long it rests"), &setup.start);
  keys.RefuseOthers();
  return setup;
}

}  // namespace

Result<RailSetup, RigFileFaults> ParseRailSetup(std::string_view yaml, const std::string& file) {
  return ReadYaml(yaml, file, [](const YamlNode& root) { return Read(root); });
}

}  // namespace tbm
