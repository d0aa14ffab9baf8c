#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "pose/calibrate/board.h"
#include "pose/geometry/camera_model.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

// The order of a camera's parameters in vectors and covariances: fx fy cx cy k1 k2 p1 p2 k3.
inline constexpr int kIntrinsics = 9;
using IntrinsicVector = Eigen::Matrix<double, kIntrinsics, 1>;
using IntrinsicMatrix = Eigen::Matrix<double, kIntrinsics, kIntrinsics>;
IntrinsicVector IntrinsicsOf(const CameraModel& camera);
CameraModel MovedCamera(const CameraModel& camera, const IntrinsicVector& step);

// The normal equations of one picture of a board, weight 1 for each coordinate in px, by the
// camera's parameters and by the error of camera_from_board (as in rigid3.h).
struct ViewNormal {
  IntrinsicMatrix by_camera = IntrinsicMatrix::Zero();
  Eigen::Matrix<double, kIntrinsics, 6> between = Eigen::Matrix<double, kIntrinsics, 6>::Zero();
  Eigen::Matrix<double, 6, 6> by_pose = Eigen::Matrix<double, 6, 6>::Zero();
  IntrinsicVector pull_camera = IntrinsicVector::Zero();
  PoseError pull_pose = PoseError::Zero();
  double sum_px2 = 0.0;                       // of the squared residuals
  std::vector<Eigen::Vector2d> residuals_px;  // found minus expected
};

// Empty where a point would lie behind the camera. `points` are those of the board, `pixels` what
// was found of them. Of circles with a known diameter the middle of the pictured area is expected,
// not the picture of the middle.
std::optional<ViewNormal> LinearisedView(const Board& board,
                                         std::span<const Eigen::Vector3d> points,
                                         std::span<const Eigen::Vector2d> pixels,
                                         const CameraModel& camera,
                                         const Rigid3& camera_from_board);

}  // namespace tbm
