#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "pose/base/result.h"
#include "pose/calibrate/board.h"
#include "pose/calibrate/view_fit.h"
#include "pose/geometry/camera_model.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

// How a board stands before a camera whose parameters are known.
struct BoardPose {
  Rigid3 camera_from_board;
  // Covariance for a sigma of 1 px of each coordinate: times sigma squared it is the pose's.
  PoseCovariance cofactor = PoseCovariance::Zero();
  double sum_px2 = 0.0;  // of the squared residuals
  int dof = 0;
  std::vector<Eigen::Vector2d> residuals_px;  // found minus expected
};

enum class BoardPoseFailure {
  kBeyondLens,  // a point lies where the camera's model cannot be inverted: another camera's
  kNoPose,      // no pose before the camera fits the points
  kTwoPoses     // two poses, mirrored in the line of sight, fit alike: small, far away and frontal
};
const char* Text(BoardPoseFailure failure);

// Least squares on the pixels; the start is OpenCV's IPPE, both of whose answers are followed.
Result<BoardPose, BoardPoseFailure> PlaceBoard(const Board& board,
                                               std::span<const Eigen::Vector2d> pixels,
                                               const CameraModel& camera);

}  // namespace tbm
