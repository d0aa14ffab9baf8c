#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include "guidance/rail_vision/edge_fit.h"
#include "guidance/rail_vision/found_mark.h"

namespace tbm {
namespace {

constexpr std::size_t kMostBlobs = 400;
constexpr double kLeastFill = 0.85;    // area of a blob by that of the ellipse of its moments
constexpr double kLeastAspect = 0.25;  // shorter by longer diameter
// Of the edge's rms: what the model itself does not get nearer than.
constexpr double kFloor_px = 0.01;
constexpr double kMostRms_px = 0.35;

struct Blob {
  Ellipse ellipse;  // in pixels
};

// A blob whose outline is an ellipse, more or less.
std::optional<Blob> RoundBlob(const std::vector<cv::Point>& outline,
                              double least_px,
                              double most_px) {
  const cv::Moments moments = cv::moments(outline);
  const double area = moments.m00;
  if (!(area > 0.2 * least_px * least_px * kLeastAspect) || area > most_px * most_px) return {};
  Eigen::Matrix2d second;
  second << moments.mu20 / area, moments.mu11 / area, moments.mu11 / area, moments.mu02 / area;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(second);
  if (!(axes.eigenvalues()[0] > 0.0)) return {};
  const Eigen::Vector2d radii = 2.0 * axes.eigenvalues().cwiseSqrt();
  // The outline runs through the outermost pixels' middles: half a pixel inside of the edge.
  const Eigen::Vector2d grown = radii + Eigen::Vector2d::Constant(0.5);
  if (2.0 * grown[1] < least_px || 2.0 * grown[1] > most_px) return {};
  if (grown[0] < kLeastAspect * grown[1]) return {};
  const double fill = area / (std::numbers::pi * radii[0] * radii[1]);
  if (fill < kLeastFill || fill > 1.0 / kLeastFill) return {};
  Blob blob;
  blob.ellipse.middle = {moments.m10 / area, moments.m01 / area};
  blob.ellipse.shape =
      axes.eigenvectors() * grown.cwiseInverse().asDiagonal() * axes.eigenvectors().transpose();
  return blob;
}

std::vector<Eigen::Vector2d> EdgeOf(const cv::Mat& grey, const Ellipse& ellipse) {
  const double shorter_px = ellipse.ShorterRadius();
  const double reach_px = std::clamp(0.5 * shorter_px, 2.0, 5.0);
  const auto count = static_cast<int>(std::clamp(4.0 * ellipse.LongerRadius(), 24.0, 96.0));
  const Eigen::Matrix2d place = ellipse.shape.inverse();
  std::vector<Eigen::Vector2d> edge;
  for (int i = 0; i < count; ++i) {
    const double angle_rad = 2.0 * std::numbers::pi * i / count;
    const Eigen::Vector2d on(std::cos(angle_rad), std::sin(angle_rad));
    const Eigen::Vector2d at_px = ellipse.middle + place * on;
    const Eigen::Vector2d outward = (ellipse.shape * on).normalized();
    const auto edge_px = EdgeAlong(grey, at_px, outward, reach_px);
    if (edge_px) edge.emplace_back(at_px + *edge_px * outward);
  }
  if (static_cast<double>(edge.size()) < 0.66 * count) edge.clear();
  return edge;
}

// The two points whose picture the circle's middle may be, in the ideal image plane. With the cone
// of rays through the ellipse as a quadric, a plane that cuts it in a circle has one of two normals
// (Chen et al. 2004), and the middle is the pole of the plane's vanishing line.
std::optional<std::pair<Eigen::Vector2d, Eigen::Vector2d>> Middles(const Ellipse& ellipse) {
  const Eigen::Matrix2d square = ellipse.shape * ellipse.shape;
  Eigen::Matrix3d cone;
  cone.topLeftCorner<2, 2>() = square;
  cone.topRightCorner<2, 1>() = -square * ellipse.middle;
  cone.bottomLeftCorner<1, 2>() = cone.topRightCorner<2, 1>().transpose();
  cone(2, 2) = ellipse.middle.dot(square * ellipse.middle) - 1.0;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(cone);
  const Eigen::Vector3d& value = axes.eigenvalues();  // one below zero, two above
  if (!(value[0] < 0.0 && value[1] > 0.0)) return {};
  const double across = std::sqrt((value[2] - value[1]) / (value[2] - value[0]));
  const double along = std::sqrt((value[1] - value[0]) / (value[2] - value[0]));
  const Eigen::Matrix3d pole = cone.inverse();
  const Eigen::Vector3d a =
      pole * (across * axes.eigenvectors().col(2) + along * axes.eigenvectors().col(0));
  const Eigen::Vector3d b =
      pole * (-across * axes.eigenvectors().col(2) + along * axes.eigenvectors().col(0));
  return std::pair(Eigen::Vector2d(a.hnormalized()), Eigen::Vector2d(b.hnormalized()));
}

std::optional<FoundMark> Measure(const cv::Mat& grey,
                                 const CameraModel& camera,
                                 Ellipse ellipse_px) {
  // The first fit brings the profiles onto the edge, the second measures.
  std::vector<Eigen::Vector2d> edge;
  for (int round = 0; round < 2; ++round) {
    edge = EdgeOf(grey, ellipse_px);
    const auto fit = FitEllipse(edge, ellipse_px);
    if (!fit) return {};
    ellipse_px = fit->ellipse;
  }
  edge = EdgeOf(grey, ellipse_px);
  // In the ideal image plane, in units of about a pixel.
  const double f_px = camera.fx_px;
  const auto middle = NormalisedFromPixel(camera, ellipse_px.middle);
  if (!middle) return {};
  for (Eigen::Vector2d& p : edge) {
    const auto ideal = NormalisedFromPixel(camera, p);
    if (!ideal) return {};
    p = f_px * *ideal;
  }
  Ellipse start = ellipse_px;
  start.middle = f_px * *middle;
  const auto fit = FitEllipse(edge, start);
  if (!fit || fit->rms > kMostRms_px) return {};
  Ellipse ideal = fit->ellipse;
  ideal.middle /= f_px;
  ideal.shape *= f_px;
  const auto middles = Middles(ideal);
  if (!middles) return {};
  const auto& [a, b] = *middles;
  FoundMark mark;
  mark.pixel_px = PixelFromNormalised(camera, 0.5 * (a + b));
  mark.diameter_px = 2.0 * ellipse_px.LongerRadius();
  mark.bias_px = 0.5 * f_px * (a - b).norm();
  const double sigma2 = 0.5 * fit->covariance.trace() + 0.5 * mark.bias_px * mark.bias_px;
  mark.sigma_px = std::sqrt(sigma2 + kFloor_px * kFloor_px);
  return mark;
}

}  // namespace

std::vector<FoundMark> FindCircles(const cv::Mat& grey,
                                   const CameraModel& camera,
                                   double least_px,
                                   double most_px) {
  // Against what is around: a window wider than the widest disc.
  constexpr double kLeastStep_dn = 8.0;
  const int limit = std::min(grey.cols, grey.rows);
  const int window = std::min(2 * static_cast<int>(most_px) + 3, (limit - 1) | 1);
  std::vector<FoundMark> found;
  if (window < 3) return found;
  for (const int kind : {cv::THRESH_BINARY_INV, cv::THRESH_BINARY}) {
    const double step_dn = kind == cv::THRESH_BINARY_INV ? kLeastStep_dn : -kLeastStep_dn;
    cv::Mat mask;
    cv::adaptiveThreshold(grey, mask, 255.0, cv::ADAPTIVE_THRESH_MEAN_C, kind, window, step_dn);
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(mask, outlines, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
    for (const auto& outline : outlines) {
      if (found.size() >= kMostBlobs) return found;
      const auto blob = RoundBlob(outline, least_px, most_px);
      if (!blob) continue;
      const auto mark = Measure(grey, camera, blob->ellipse);
      if (!mark || mark->diameter_px < least_px) continue;
      // The same edge, as dark in light and as light in dark.
      const bool is_known = std::any_of(found.begin(), found.end(), [&](const FoundMark& other) {
        return (other.pixel_px - mark->pixel_px).norm() < 0.5 &&
               std::abs(other.diameter_px - mark->diameter_px) < 1.0;
      });
      if (!is_known) found.push_back(*mark);
    }
  }
  return found;
}

}  // namespace tbm
