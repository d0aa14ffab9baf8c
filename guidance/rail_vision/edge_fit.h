#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace cv {
class Mat;
}

namespace tbm {

// How far along `outward` (a unit vector) from `at_px` the grey value crosses half way between what
// it is inside and what it is outside; |result| < reach_px. Both levels are taken beside the edge
// itself, so that uneven light moves nothing. Nothing where there is no edge, or two.
std::optional<double> EdgeAlong(const cv::Mat& grey,
                                const Eigen::Vector2d& at_px,
                                const Eigen::Vector2d& outward,
                                double reach_px);

// Points p with |shape (p - middle)| = 1; shape is symmetric and positive definite.
struct Ellipse {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();

  double LongerRadius() const;
  double ShorterRadius() const;
};

struct EllipseFit {
  Ellipse ellipse;
  Eigen::Matrix2d covariance;  // of the middle, from what the points leave
  double rms = 0.0;            // distance of the points that were kept
  std::size_t kept = 0;
};
// Least squares of the points' distances, from `start`; those that fit far worse than most are left
// out. Nothing where fewer than two thirds are left or the fit does not settle.
std::optional<EllipseFit> FitEllipse(const std::vector<Eigen::Vector2d>& points,
                                     const Ellipse& start);

// A straight line: points p with normal . p = offset.
struct LineFit {
  Eigen::Vector2d normal;
  double offset = 0.0;
  double sum_squared = 0.0;  // of the distances
  std::size_t kept = 0;
};
std::optional<LineFit> FitLine(std::vector<Eigen::Vector2d> points);

// Where two lines meet; nothing where they hardly do.
std::optional<Eigen::Vector2d> Meeting(const LineFit& a, const LineFit& b);

}  // namespace tbm
