#include "guidance/rail_vision/edge_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <opencv2/core.hpp>

namespace tbm {
namespace {

constexpr double kStep_px = 0.5;
constexpr double kLevels = 0.35;  // of the reach, at either end, tells the grey value there
constexpr double kLeastContrast_dn = 12.0;
// Of the median distance: further out it is no noise.
constexpr double kFarOff = 5.0;
constexpr double kLeastFarOff_px = 0.12;
constexpr double kLeastKept = 0.66;

double GreyAt(const cv::Mat& grey, const Eigen::Vector2d& at_px) {
  const auto u = static_cast<int>(std::floor(at_px.x()));
  const auto v = static_cast<int>(std::floor(at_px.y()));
  const double a = at_px.x() - u;
  const double b = at_px.y() - v;
  const unsigned char* top = grey.ptr<unsigned char>(v) + u;
  const unsigned char* below = grey.ptr<unsigned char>(v + 1) + u;
  return (1.0 - b) * ((1.0 - a) * top[0] + a * top[1]) + b * ((1.0 - a) * below[0] + a * below[1]);
}

bool IsInside(const cv::Mat& grey, const Eigen::Vector2d& at_px) {
  return at_px.x() >= 0.0 && at_px.y() >= 0.0 && at_px.x() < grey.cols - 1.0 &&
         at_px.y() < grey.rows - 1.0;
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Distance, about, and its derivative by middle (2) and shape (xx, xy, yy).
struct EllipseRow {
  double distance;
  Eigen::Matrix<double, 1, 5> by;
};
EllipseRow RowOf(const Ellipse& ellipse, const Eigen::Vector2d& p) {
  const Eigen::Vector2d off = p - ellipse.middle;
  const Eigen::Vector2d turned = ellipse.shape * off;
  const double d = std::max(turned.norm(), 1e-12);
  const Eigen::Vector2d by_point = ellipse.shape * turned / d;
  const double slope = std::max(by_point.norm(), 1e-12);
  EllipseRow row;
  row.distance = (d - 1.0) / slope;
  row.by << -by_point.x(), -by_point.y(), turned.x() * off.x() / d,
      (turned.x() * off.y() + turned.y() * off.x()) / d, turned.y() * off.y() / d;
  row.by /= slope;
  return row;
}

// One fit to the points that are not left out; false where it runs away.
bool Settle(const std::vector<Eigen::Vector2d>& points,
            const std::vector<bool>& is_kept,
            Ellipse* ellipse,
            Eigen::Matrix<double, 5, 5>* information) {
  constexpr int kRounds = 20;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> right = Eigen::Matrix<double, 5, 1>::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!is_kept[i]) continue;
      const EllipseRow row = RowOf(*ellipse, points[i]);
      normal += row.by.transpose() * row.by;
      right -= row.by.transpose() * row.distance;
    }
    const Eigen::LDLT<Eigen::Matrix<double, 5, 5>> solver(normal);
    if (solver.info() != Eigen::Success || !solver.isPositive()) return false;
    const Eigen::Matrix<double, 5, 1> step = solver.solve(right);
    if (!step.allFinite()) return false;
    ellipse->middle += step.head<2>();
    ellipse->shape(0, 0) += step[2];
    ellipse->shape(0, 1) += step[3];
    ellipse->shape(1, 0) += step[3];
    ellipse->shape(1, 1) += step[4];
    if (!(ellipse->shape(0, 0) > 0.0) || !(ellipse->shape.determinant() > 0.0)) return false;
    *information = normal;
    if (step.head<2>().norm() < 1e-9 * ellipse->LongerRadius()) return true;
  }
  return false;
}

}  // namespace

std::optional<double> EdgeAlong(const cv::Mat& grey,
                                const Eigen::Vector2d& at_px,
                                const Eigen::Vector2d& outward,
                                double reach_px) {
  const int half = static_cast<int>(std::floor(reach_px / kStep_px));
  const int count = 2 * half + 1;
  constexpr int kMost = 65;
  if (half < 3 || count > kMost) return {};
  const Eigen::Vector2d from = at_px - half * kStep_px * outward;
  const Eigen::Vector2d to = at_px + half * kStep_px * outward;
  if (!IsInside(grey, from) || !IsInside(grey, to)) return {};
  std::array<double, kMost> values{};
  for (int i = 0; i < count; ++i) {
    values[static_cast<std::size_t>(i)] = GreyAt(grey, from + i * kStep_px * outward);
  }
  const int ends = std::max(2, static_cast<int>(kLevels * half));
  double inside = 0.0;
  double outside = 0.0;
  for (int i = 0; i < ends; ++i) {
    inside += values[static_cast<std::size_t>(i)] / ends;
    outside += values[static_cast<std::size_t>(count - 1 - i)] / ends;
  }
  if (std::abs(outside - inside) < kLeastContrast_dn) return {};
  std::optional<double> crossing;
  for (int i = 0; i + 1 < count; ++i) {
    const double a = (values[static_cast<std::size_t>(i)] - inside) / (outside - inside) - 0.5;
    const double b = (values[static_cast<std::size_t>(i + 1)] - inside) / (outside - inside) - 0.5;
    if ((a < 0.0) == (b < 0.0)) continue;
    if (crossing) return {};
    crossing = (i + a / (a - b) - half) * kStep_px;
  }
  return crossing;
}

double Ellipse::LongerRadius() const {
  return 1.0 / Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(shape).eigenvalues()[0];
}
double Ellipse::ShorterRadius() const {
  return 1.0 / Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(shape).eigenvalues()[1];
}

std::optional<EllipseFit> FitEllipse(const std::vector<Eigen::Vector2d>& points,
                                     const Ellipse& start) {
  constexpr std::size_t kLeastPoints = 10;
  if (points.size() < kLeastPoints) return {};
  EllipseFit fit;
  fit.ellipse = start;
  std::vector<bool> is_kept(points.size(), true);
  Eigen::Matrix<double, 5, 5> information = Eigen::Matrix<double, 5, 5>::Identity();
  for (int round = 0; round < 4; ++round) {
    if (!Settle(points, is_kept, &fit.ellipse, &information)) return {};
    std::vector<double> distances;
    for (const Eigen::Vector2d& p : points) {
      distances.push_back(std::abs(RowOf(fit.ellipse, p).distance));
    }
    const double most = std::max(kFarOff * Median(distances), kLeastFarOff_px);
    std::vector<bool> keeps;
    for (const double distance : distances) keeps.push_back(distance <= most);
    const bool is_same = keeps == is_kept;
    is_kept = std::move(keeps);
    fit.kept = static_cast<std::size_t>(std::count(is_kept.begin(), is_kept.end(), true));
    if (static_cast<double>(fit.kept) < kLeastKept * static_cast<double>(points.size()) ||
        fit.kept < kLeastPoints) {
      return {};
    }
    if (!is_same && round < 3) continue;
    double sum = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (is_kept[i]) sum += distances[i] * distances[i];
    }
    fit.rms = std::sqrt(sum / static_cast<double>(fit.kept - 5));
    fit.covariance = fit.rms * fit.rms * information.inverse().topLeftCorner<2, 2>();
    return fit;
  }
  return {};
}

std::optional<LineFit> FitLine(std::vector<Eigen::Vector2d> points) {
  constexpr std::size_t kLeastPoints = 5;
  const std::size_t given = points.size();
  for (int round = 0; round < 4; ++round) {
    if (points.size() < kLeastPoints) return {};
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& p : points) mean += p / static_cast<double>(points.size());
    Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
    for (const Eigen::Vector2d& p : points) spread += (p - mean) * (p - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(spread);
    LineFit line;
    line.normal = axes.eigenvectors().col(0);
    line.offset = line.normal.dot(mean);
    line.kept = points.size();
    std::vector<double> distances;
    for (const Eigen::Vector2d& p : points) {
      distances.push_back(std::abs(line.normal.dot(p) - line.offset));
      line.sum_squared += distances.back() * distances.back();
    }
    const double most = std::max(kFarOff * Median(distances), kLeastFarOff_px);
    std::vector<Eigen::Vector2d> left;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (distances[i] <= most) left.push_back(points[i]);
    }
    if (left.size() == points.size()) return line;
    if (static_cast<double>(left.size()) < kLeastKept * static_cast<double>(given)) return {};
    points = std::move(left);
  }
  return {};
}

std::optional<Eigen::Vector2d> Meeting(const LineFit& a, const LineFit& b) {
  Eigen::Matrix2d normals;
  normals.row(0) = a.normal.transpose();
  normals.row(1) = b.normal.transpose();
  if (std::abs(normals.determinant()) < 0.1) return {};
  return Eigen::Vector2d(normals.inverse() * Eigen::Vector2d(a.offset, b.offset));
}

}  // namespace tbm
