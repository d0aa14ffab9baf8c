#include "pose/calibrate/view_fit.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <Eigen/LU>

#include "pose/base/check.h"

namespace tbm {
namespace {

// From the picture of a circle's middle to the middle of its pictured area.
//
// Eight points at radius / sqrt(2), each with the picture's scale of area there, have the disc's
// own moments up to the third order: what is left is below 1e-4 px for circles of 50 px.
std::optional<Eigen::Vector2d> DiscShift(double radius_m,
                                         const Eigen::Vector3d& middle,
                                         const CameraModel& camera,
                                         const Rigid3& camera_from_board,
                                         const Eigen::Vector2d& middle_px) {
  constexpr int kPlaces = 8;
  const Eigen::Matrix3d rotation = camera_from_board.rotation.toRotationMatrix();
  const double ring_m = radius_m / std::numbers::sqrt2;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double area = 0.0;
  for (int k = 0; k < kPlaces; ++k) {
    const double angle_rad = 2.0 * std::numbers::pi * k / kPlaces;
    const Eigen::Vector3d place =
        middle + ring_m * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0);
    const auto seen = Project(camera, camera_from_board * place);
    if (!seen) return std::nullopt;
    const Eigen::Matrix2d by_board = seen->by_point_px_per_m * rotation.leftCols<2>();
    const double scale = std::abs(by_board.determinant());
    sum += scale * (seen->pixel_px - middle_px);
    area += scale;
  }
  if (!(area > 0.0)) return std::nullopt;
  return sum / area;
}

// Derivative of a pixel by the camera's parameters.
Eigen::Matrix<double, 2, kIntrinsics> PixelByCamera(const CameraModel& camera,
                                                    const Eigen::Vector3d& p_in_camera,
                                                    const Eigen::Vector2d& pixel_px) {
  const double x = p_in_camera.x() / p_in_camera.z();
  const double y = p_in_camera.y() / p_in_camera.z();
  const double r2 = x * x + y * y;
  const double fx = camera.fx_px;
  const double fy = camera.fy_px;
  Eigen::Matrix<double, 2, kIntrinsics> by;
  by.row(0) << (pixel_px.x() - camera.cx_px) / fx, 0.0, 1.0, 0.0, fx * x * r2, fx * x * r2 * r2,
      fx * 2.0 * x * y, fx * (r2 + 2.0 * x * x), fx * x * r2 * r2 * r2;
  by.row(1) << 0.0, (pixel_px.y() - camera.cy_px) / fy, 0.0, 1.0, fy * y * r2, fy * y * r2 * r2,
      fy * (r2 + 2.0 * y * y), fy * 2.0 * x * y, fy * y * r2 * r2 * r2;
  return by;
}

}  // namespace

IntrinsicVector IntrinsicsOf(const CameraModel& camera) {
  IntrinsicVector v;
  v << camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, camera.k1, camera.k2, camera.p1,
      camera.p2, camera.k3;
  return v;
}

CameraModel MovedCamera(const CameraModel& camera, const IntrinsicVector& step) {
  CameraModel moved = camera;
  const std::array<double*, kIntrinsics> values = {&moved.fx_px,
                                                   &moved.fy_px,
                                                   &moved.cx_px,
                                                   &moved.cy_px,
                                                   &moved.k1,
                                                   &moved.k2,
                                                   &moved.p1,
                                                   &moved.p2,
                                                   &moved.k3};
  for (int i = 0; i < kIntrinsics; ++i) *values[static_cast<std::size_t>(i)] += step(i);
  return moved;
}

std::optional<ViewNormal> LinearisedView(const Board& board,
                                         std::span<const Eigen::Vector3d> points,
                                         std::span<const Eigen::Vector2d> pixels,
                                         const CameraModel& camera,
                                         const Rigid3& camera_from_board) {
  TBM_CHECK(points.size() == pixels.size());
  ViewNormal normal;
  normal.residuals_px.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p_in_camera = camera_from_board * points[i];
    const auto seen = Project(camera, p_in_camera);
    if (!seen) return std::nullopt;
    Eigen::Vector2d expected_px = seen->pixel_px;
    if (board.diameter_m) {
      const auto shift =
          DiscShift(0.5 * *board.diameter_m, points[i], camera, camera_from_board, seen->pixel_px);
      if (!shift) return std::nullopt;
      expected_px += *shift;
    }
    const Eigen::Vector2d residual = pixels[i] - expected_px;
    const Eigen::Matrix<double, 2, kIntrinsics> by_camera =
        PixelByCamera(camera, p_in_camera, seen->pixel_px);
    const Eigen::Matrix<double, 2, 6> by_pose =
        seen->by_point_px_per_m * PointByError(camera_from_board, points[i]);
    normal.by_camera.noalias() += by_camera.transpose() * by_camera;
    normal.between.noalias() += by_camera.transpose() * by_pose;
    normal.by_pose.noalias() += by_pose.transpose() * by_pose;
    normal.pull_camera.noalias() += by_camera.transpose() * residual;
    normal.pull_pose.noalias() += by_pose.transpose() * residual;
    normal.sum_px2 += residual.squaredNorm();
    normal.residuals_px.push_back(residual);
  }
  return normal;
}

}  // namespace tbm
