#pragma once

#include <optional>

#include <Eigen/Core>

#include "pose/solve/problem.h"

namespace tbm {

// Shared by the solvers: what one LED and the pair of inclinometers say about a pose, linearised.

// Nothing is measured better than this, whatever a problem claims: an exact problem (all sigmas
// zero, as tests and simulations make them) stays solvable, and a sigma is never a division by
// zero.
inline constexpr double kLeastCentreSigmaPx = 1e-3;
inline constexpr double kLeastTiltSigmaRad = 1e-7;

// residual = observed - predicted ~ by_pose * e + noise, rows u and v [px].
struct LedRows {
  Eigen::Vector2d residual_px;
  Eigen::Matrix<double, 2, 6> by_pose;
  // Distorted point of the plane z = 1: the derivative of (u, v) by (fx, fy).
  Eigen::Vector2d by_focal_length;

  // Derivative of the pixel by the LED's position in `camera`.
  auto by_point() const { return by_pose.rightCols<3>(); }
};

// False when the LED is behind the camera.
bool RowsOfLed(const Rig& rig,
               const LedObservation& led,
               const Eigen::Matrix3d& camera_from_target,
               const Eigen::Vector3d& translation,
               LedRows& rows);

// 2x2 covariance of an LED's rows without the intrinsics, which tie all LEDs together: centroid
// noise, calibration residual, and its coordinate's sigma, which is the same along every axis and
// therefore needs no rotation into `camera`.
Eigen::Matrix2d CovarianceOfLed(const Rig& rig, const LedObservation& led, const LedRows& rows);

// Two unit vectors orthogonal to `up` and to each other, as columns.
Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& up);

// Both inclinometers as one constraint on the rotation, R up_in_target = up_in_camera, made ready
// once per problem: all that does not depend on the pose.
struct TiltConstraint {
  struct Rows {
    Eigen::Vector2d residual;  // [rad] B^T (u_C - R u_T)
    Eigen::Matrix<double, 2, 3> by_turn;
    Eigen::Matrix2d covariance;
  };

  Eigen::Vector3d up_in_camera;
  Eigen::Vector3d up_in_target;
  Eigen::Matrix<double, 3, 2> basis;             // B, tangent at up_in_camera
  Eigen::Matrix2d camera_covariance;             // camera's noise and both mountings, along B
  Eigen::Matrix<double, 3, 2> target_deviation;  // sigma times derivative of up_in_target

  // Empty when a tilt is missing or has no up vector.
  static std::optional<TiltConstraint> From(const PoseProblem& problem);

  Rows At(const Eigen::Matrix3d& camera_from_target) const;
};

}  // namespace tbm
