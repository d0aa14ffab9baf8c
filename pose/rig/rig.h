#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pose/geometry/camera_model.h"

namespace tbm {

inline constexpr int kMinLeds = 3;
inline constexpr int kMaxLeds = 32;  // what the fixed-size solver has room for

struct Led {
  std::string id;                                             // as painted on the board, "P1"
  Eigen::Vector3d p_led_in_target = Eigen::Vector3d::Zero();  // [m]
  double sigma_m = 0.0;  // of each coordinate; does not average out from frame to frame
};

// One inclinometer and how it is bolted to its body (`target` or `camera`).
struct TiltMount {
  Eigen::Matrix3d tilt_from_body = Eigen::Matrix3d::Identity();  // R1, R2 of Eqs. 11 and 12
  std::array<double, 2> sign = {1.0, 1.0};  // instrument's (beta, gamma) -> the paper's convention
  double sigma_rad = 0.0;                   // noise of one output
  double mounting_sigma_rad = 0.0;          // per axis; does not average out
};

struct NamedPoint {
  std::string name;
  Eigen::Vector3d p_point_in_target = Eigen::Vector3d::Zero();  // [m]
  double sigma_m = 0.0;                                         // of each coordinate
};

// All that is calibrated: what rig.yaml says, in SI units. Immutable after loading.
struct Rig {
  std::string name;
  CameraModel camera;
  double calibration_residual_px = 0.0;                           // per axis, of each LED's centre
  Eigen::Vector4d intrinsics_sigma_px = Eigen::Vector4d::Zero();  // fx fy cx cy
  std::optional<double> gain_dn_per_electron;  // of the sensor; estimated when absent
  std::optional<double> read_noise_dn;
  std::vector<Led> leds;  // kMinLeds .. kMaxLeds
  TiltMount target_tilt;
  TiltMount camera_tilt;
  std::vector<NamedPoint> points;  // e.g. shield_head
};

}  // namespace tbm
