#pragma once

#include <Eigen/Core>

#include "pose/base/result.h"

namespace tbm {

// Pinhole camera with plumb_bob distortion, as OpenCV and ROS write it. Pixel (0, 0) is the centre
// of the first pixel; u to the right, v down. Frame `camera`: x right, y down, z forward.
struct CameraModel {
  int image_width_px = 0;
  int image_height_px = 0;
  double fx_px = 0.0;
  double fy_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
  double k1 = 0.0;
  double k2 = 0.0;
  double p1 = 0.0;
  double p2 = 0.0;
  double k3 = 0.0;
};

enum class CameraModelFailure {
  kBehindCamera,  // the point is not in front of the lens (z <= 0)
  kBeyondLens,    // further from the axis than the distortion polynomial can be inverted
};

// A point of the ideal image plane z = 1: (x / z, y / z).
using NormalisedPoint = Eigen::Vector2d;

struct Projection {
  Eigen::Vector2d pixel_px;
  Eigen::Matrix<double, 2, 3> by_point_px_per_m;  // derivative by the point in `camera`
};

// Forward: normalised -> pixel, and its 2x2 derivative.
Eigen::Vector2d PixelFromNormalised(const CameraModel& camera, const NormalisedPoint& point);
Eigen::Matrix2d PixelByNormalised(const CameraModel& camera, const NormalisedPoint& point);

// Forward from a point in `camera` [m]. kBehindCamera when z <= 1e-9 m.
Result<Projection, CameraModelFailure> Project(const CameraModel& camera,
                                               const Eigen::Vector3d& p_in_camera);

// Inverse: pixel -> normalised, by Newton on PixelFromNormalised, to rounding. Agrees with
// OpenCV's undistortPoints iterated to convergence within 1e-6 px over the whole image (tested).
// kBeyondLens where the polynomial folds back and no inverse near the pixel exists.
Result<NormalisedPoint, CameraModelFailure> NormalisedFromPixel(const CameraModel& camera,
                                                                const Eigen::Vector2d& pixel_px);

// Derivative of the inverse at a normalised point: the inverse matrix of PixelByNormalised.
Eigen::Matrix2d NormalisedByPixel(const CameraModel& camera, const NormalisedPoint& point);

}  // namespace tbm
