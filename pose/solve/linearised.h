#pragma once

#include <optional>

#include <Eigen/Core>

#include "pose/solve/problem.h"

namespace tbm {

inline constexpr int kMaxRows = 2 * kMaxLeds + 2;

// A pose problem linearised at one pose, before whitening:
//   residual = observed - predicted  ~  by_pose * e + noise,   noise ~ N(0, covariance)
// with e the PoseError of rigid3.h that leads from `camera_from_target` to the truth.
//
// Rows: u then v of each LED in the order of the problem [px], then (when both tilts are there) the
// two components of B^T (u_C - R u_T) along a tangent basis B at u_C [rad].
// `covariance` is dense: centroid noise, calibration residual and LED coordinates on the 2x2 blocks
// of each LED, focal length and principal point across all LEDs, tilt noise and mounting on the
// tilt rows.
struct LinearisedProblem {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxRows, 1>;
  using RowsByPose = Eigen::Matrix<double, Eigen::Dynamic, 6, 0, kMaxRows, 6>;
  using RowsCovariance =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxRows, kMaxRows>;

  Rows residual;
  RowsByPose by_pose;
  RowsCovariance covariance;
  int led_rows = 0;   // 2 x LEDs
  int tilt_rows = 0;  // 0 or 2
};

// Empty when an LED is behind the camera or a tilt has no up vector. `with_tilts` false leaves the
// tilt rows out even when the problem has them.
std::optional<LinearisedProblem> Linearise(const PoseProblem& problem,
                                           const Rigid3& camera_from_target,
                                           bool with_tilts = true);

}  // namespace tbm
