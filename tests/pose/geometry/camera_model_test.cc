#include "pose/geometry/camera_model.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include "tests/support/scene.h"

namespace tbm::test {
namespace {

struct NamedLens {
  const char* name;
  CameraModel camera;
};

CameraModel Lens(double k1, double k2, double p1, double p2, double k3) {
  CameraModel camera = FieldRig().camera;
  camera.k1 = k1;
  camera.k2 = k2;
  camera.p1 = p1;
  camera.p2 = p2;
  camera.k3 = k3;
  return camera;
}

// A wide lens: the corner is 37 degrees off the axis and distortion moves it by 70 px and more.
CameraModel Wide(double k1, double k2, double p1, double p2, double k3) {
  CameraModel camera = Lens(k1, k2, p1, p2, k3);
  camera.fx_px = 1103.0;
  camera.fy_px = 1098.5;
  return camera;
}

std::vector<NamedLens> Lenses() {
  return {{"none", Lens(0, 0, 0, 0, 0)},
          {"field", Lens(-0.093, 0.141, 2.1e-4, -1.6e-4, 0)},
          {"strong barrel", Wide(-0.28, 0.09, 1.2e-3, -8e-4, -0.011)},
          {"strong pincushion", Wide(0.21, 0.13, -1.5e-3, 9e-4, 0.06)},
          {"tangential", Wide(0.02, 0, 6e-3, -5e-3, 0)}};
}

cv::Matx33d Matrix(const CameraModel& c) {
  return {c.fx_px, 0, c.cx_px, 0, c.fy_px, c.cy_px, 0, 0, 1};
}
cv::Vec<double, 5> Coefficients(const CameraModel& c) { return {c.k1, c.k2, c.p1, c.p2, c.k3}; }

// Every 40th pixel of every 32nd row, border included.
std::vector<Eigen::Vector2d> PixelGrid(const CameraModel& camera) {
  std::vector<Eigen::Vector2d> pixels;
  for (int v = 0; v <= camera.image_height_px; v += 32) {
    for (int u = 0; u <= camera.image_width_px; u += 40) pixels.emplace_back(u - 0.5, v - 0.5);
  }
  return pixels;
}

TEST(CameraModel, ProjectsAsOpenCvOverTheWholeImage) {
  for (const auto& [name, camera] : Lenses()) {
    std::vector<cv::Point3d> points;
    for (const Eigen::Vector2d& pixel : PixelGrid(camera)) {
      const auto at_infinity = NormalisedFromPixel(camera, pixel);
      ASSERT_TRUE(at_infinity) << name << " " << pixel.transpose();
      const double z = 2.0 + 0.003 * pixel.x();
      points.emplace_back(at_infinity->x() * z, at_infinity->y() * z, z);
    }
    std::vector<cv::Point2d> theirs;
    cv::projectPoints(
        points, cv::Vec3d(), cv::Vec3d(), Matrix(camera), Coefficients(camera), theirs);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto ours = Project(camera, {points[i].x, points[i].y, points[i].z});
      ASSERT_TRUE(ours);
      EXPECT_NEAR(ours->pixel_px.x(), theirs[i].x, 1e-6) << name;
      EXPECT_NEAR(ours->pixel_px.y(), theirs[i].y, 1e-6) << name;
    }
  }
}

TEST(CameraModel, UndistortsAsOpenCvOverTheWholeImage) {
  const cv::TermCriteria to_rounding(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 500, 1e-14);
  for (const auto& [name, camera] : Lenses()) {
    std::vector<cv::Point2d> pixels;
    for (const Eigen::Vector2d& pixel : PixelGrid(camera))
      pixels.emplace_back(pixel.x(), pixel.y());
    std::vector<cv::Point2d> theirs;
    cv::undistortPoints(pixels,
                        theirs,
                        Matrix(camera),
                        Coefficients(camera),
                        cv::noArray(),
                        cv::noArray(),
                        to_rounding);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const auto ours = NormalisedFromPixel(camera, {pixels[i].x, pixels[i].y});
      ASSERT_TRUE(ours) << name;
      EXPECT_NEAR(camera.fx_px * ours->x(), camera.fx_px * theirs[i].x, 1e-6) << name;
      EXPECT_NEAR(camera.fy_px * ours->y(), camera.fy_px * theirs[i].y, 1e-6) << name;
    }
  }
}

TEST(CameraModel, ThereAndBackIsTheSamePixel) {
  for (const auto& [name, camera] : Lenses()) {
    for (const Eigen::Vector2d& pixel : PixelGrid(camera)) {
      const auto point = NormalisedFromPixel(camera, pixel);
      ASSERT_TRUE(point) << name;
      EXPECT_LT((PixelFromNormalised(camera, *point) - pixel).norm(), 1e-9) << name;
    }
  }
}

// Central differences with a step of 1e-5 err by about step^2 times the third derivative (1e-7 of
// the derivative for these lenses) plus rounding (1e-13 * 1e3 px / 1e-5).
TEST(CameraModel, JacobiansAgreeWithCentralDifferences) {
  constexpr double kStep = 1e-5;
  Random random("camera model jacobians");
  for (const auto& [name, camera] : Lenses()) {
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d p(random.Uniform(-1.0, 1.0), random.Uniform(-0.8, 0.8), 2.5);
      const auto at = Project(camera, p);
      ASSERT_TRUE(at);
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
        const Eigen::Vector2d difference =
            (ExactPixel(camera, p + step) - ExactPixel(camera, p - step)) / (2.0 * kStep);
        EXPECT_LT((difference - at->by_point_px_per_m.col(axis)).norm(), 1e-4) << name;
      }
      const NormalisedPoint point = p.hnormalized();
      const Eigen::Matrix2d forward = PixelByNormalised(camera, point);
      for (int axis = 0; axis < 2; ++axis) {
        const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(axis);
        const Eigen::Vector2d difference = (PixelFromNormalised(camera, point + step) -
                                            PixelFromNormalised(camera, point - step)) /
                                           (2.0 * kStep);
        EXPECT_LT((difference - forward.col(axis)).norm(), 1e-4) << name;
      }
      const Eigen::Matrix2d round = NormalisedByPixel(camera, point) * forward;
      EXPECT_LT((round - Eigen::Matrix2d::Identity()).norm(), 1e-12) << name;
    }
  }
}

TEST(CameraModel, RefusesWhatIsNotInFront) {
  const CameraModel camera = FieldRig().camera;
  for (const double z : {-1.0, 0.0, 1e-10, std::nan("")}) {
    const auto projection = Project(camera, {0.1, 0.1, z});
    ASSERT_FALSE(projection) << z;
    EXPECT_EQ(projection.error(), CameraModelFailure::kBehindCamera);
  }
}

// r (1 - 0.3 r^2) turns back at r = 1.054, where it is worth 0.703.
TEST(CameraModel, RefusesPixelsBeyondTheFoldOfThePolynomial) {
  const CameraModel camera = Wide(-0.3, 0, 0, 0, 0);
  const auto before =
      NormalisedFromPixel(camera, {camera.cx_px + 0.70 * camera.fx_px, camera.cy_px});
  EXPECT_TRUE(before);
  const auto beyond =
      NormalisedFromPixel(camera, {camera.cx_px + 0.71 * camera.fx_px, camera.cy_px});
  ASSERT_FALSE(beyond);
  EXPECT_EQ(beyond.error(), CameraModelFailure::kBeyondLens);
  const auto not_finite = NormalisedFromPixel(camera, {std::nan(""), 1.0});
  EXPECT_FALSE(not_finite);
}

TEST(CameraModel, RightIsRightAndDownIsDown) {
  const CameraModel camera = PublishedRig().camera;
  const auto centre = Project(camera, {0.0, 0.0, 4.0});
  const auto right = Project(camera, {0.1, 0.0, 4.0});
  const auto down = Project(camera, {0.0, 0.1, 4.0});
  ASSERT_TRUE(centre && right && down);
  EXPECT_GT(right->pixel_px.x(), centre->pixel_px.x());
  EXPECT_GT(down->pixel_px.y(), centre->pixel_px.y());
  EXPECT_NEAR(right->pixel_px.x() - centre->pixel_px.x(), 16.0 / 0.0053 * 0.1 / 4.0, 1e-9);
}

}  // namespace
}  // namespace tbm::test
