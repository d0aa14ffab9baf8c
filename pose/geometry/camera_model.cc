#include "pose/geometry/camera_model.h"

#include <cmath>

#include <Eigen/LU>

namespace tbm {
namespace {

struct Distorted {
  Eigen::Vector2d point;
  Eigen::Matrix2d by_point;
};

// OpenCV's plumb_bob in normalised coordinates, with its derivative:
//   r2 = x^2 + y^2,  g = 1 + k1 r2 + k2 r2^2 + k3 r2^3
//   x' = g x + 2 p1 x y + p2 (r2 + 2 x^2),  y' = g y + p1 (r2 + 2 y^2) + 2 p2 x y
Distorted Distort(const CameraModel& camera, const NormalisedPoint& point) {
  const double x = point.x();
  const double y = point.y();
  const double r2 = x * x + y * y;
  const double g = 1.0 + r2 * (camera.k1 + r2 * (camera.k2 + r2 * camera.k3));
  const double g_by_r2 = camera.k1 + r2 * (2.0 * camera.k2 + r2 * 3.0 * camera.k3);
  const double p1 = camera.p1;
  const double p2 = camera.p2;
  Distorted out;
  out.point.x() = g * x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
  out.point.y() = g * y + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
  const double cross = 2.0 * (g_by_r2 * x * y + p1 * x + p2 * y);
  out.by_point << g + 2.0 * g_by_r2 * x * x + 2.0 * p1 * y + 6.0 * p2 * x, cross, cross,
      g + 2.0 * g_by_r2 * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
  return out;
}

}  // namespace

Eigen::Vector2d PixelFromNormalised(const CameraModel& camera, const NormalisedPoint& point) {
  const Eigen::Vector2d distorted = Distort(camera, point).point;
  return {camera.fx_px * distorted.x() + camera.cx_px, camera.fy_px * distorted.y() + camera.cy_px};
}

Eigen::Matrix2d PixelByNormalised(const CameraModel& camera, const NormalisedPoint& point) {
  Eigen::Matrix2d derivative = Distort(camera, point).by_point;
  derivative.row(0) *= camera.fx_px;
  derivative.row(1) *= camera.fy_px;
  return derivative;
}

Result<Projection, CameraModelFailure> Project(const CameraModel& camera,
                                               const Eigen::Vector3d& p_in_camera) {
  if (!(p_in_camera.z() > 1e-9)) return Failure{CameraModelFailure::kBehindCamera};
  const double inverse_z = 1.0 / p_in_camera.z();
  const NormalisedPoint point(p_in_camera.x() * inverse_z, p_in_camera.y() * inverse_z);
  const Distorted distorted = Distort(camera, point);
  Projection out;
  out.pixel_px.x() = camera.fx_px * distorted.point.x() + camera.cx_px;
  out.pixel_px.y() = camera.fy_px * distorted.point.y() + camera.cy_px;
  Eigen::Matrix<double, 2, 3> normalised_by_point;
  normalised_by_point << inverse_z, 0.0, -point.x() * inverse_z, 0.0, inverse_z,
      -point.y() * inverse_z;
  out.by_point_px_per_m.noalias() = distorted.by_point * normalised_by_point;
  out.by_point_px_per_m.row(0) *= camera.fx_px;
  out.by_point_px_per_m.row(1) *= camera.fy_px;
  return out;
}

Result<NormalisedPoint, CameraModelFailure> NormalisedFromPixel(const CameraModel& camera,
                                                                const Eigen::Vector2d& pixel_px) {
  const Eigen::Vector2d wanted((pixel_px.x() - camera.cx_px) / camera.fx_px,
                               (pixel_px.y() - camera.cy_px) / camera.fy_px);
  NormalisedPoint point = wanted;
  for (int iteration = 0; iteration < 30; ++iteration) {
    const Distorted distorted = Distort(camera, point);
    // A lens maps its image plane without folding; where the polynomial folds it no longer
    // describes the lens, and Newton would settle on a wrong branch.
    if (!(distorted.by_point.determinant() > 0.0) || !(distorted.by_point(0, 0) > 0.0)) {
      return Failure{CameraModelFailure::kBeyondLens};
    }
    const Eigen::Vector2d step = distorted.by_point.inverse() * (wanted - distorted.point);
    point += step;
    if (step.squaredNorm() < 1e-28) return point;
  }
  return Failure{CameraModelFailure::kBeyondLens};
}

Eigen::Matrix2d NormalisedByPixel(const CameraModel& camera, const NormalisedPoint& point) {
  return PixelByNormalised(camera, point).inverse();
}

}  // namespace tbm
