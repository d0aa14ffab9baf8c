#include "pose/solve/tails.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Eigenvalues>

namespace tbm {
namespace {

// Dawson's integral exp(-x^2) * integral of exp(t^2) from 0 to x, x >= 0.
double Dawson(double x) {
  const double x_squared = x * x;
  if (x < 5.0) {
    // All terms are positive once exp(-x^2) is in front: no cancellation.
    double term = x;
    double sum = x;
    for (int k = 1; term > 1e-17 * sum; ++k) {
      term *= x_squared / k;
      sum += term / (2 * k + 1);
    }
    return std::exp(-x_squared) * sum;
  }
  // Asymptotic; its terms shrink until k ~ x^2, the smallest is below 1e-11 of the sum here.
  double term = 0.5 / x;
  double sum = term;
  for (int k = 1; k < 20; ++k) {
    const double next = term * (2 * k - 1) / (2.0 * x_squared);
    if (next >= term || next < 1e-17 * sum) break;
    term = next;
    sum += term;
  }
  return sum;
}

struct Tail {
  double beyond = 0.0;
  double slope = 0.0;  // derivative by the radius
};

// P(x^2 + (b y)^2 + (b z)^2 > radius^2) for independent standard normal x, y, z and 0 <= b <= 1.
Tail TailAt(double radius, double b) {
  const double one_direction = std::erfc(radius / std::numbers::sqrt2);
  const double density = std::sqrt(2.0 / std::numbers::pi) * std::exp(-0.5 * radius * radius);
  if (b < 1e-9) return {one_direction, -density};
  const double growth = std::sqrt(std::max(0.0, 0.5 * (1.0 / (b * b) - 1.0)));
  // Dawson(g r) / g, whose limit for g -> 0 is r: the three-dimensional Maxwell tail.
  const double others = growth < 1e-9 ? radius : Dawson(growth * radius) / growth;
  return {one_direction + density * others, -density * radius * others / (b * b)};
}

// Radius beyond which the tail is `risk`, to kRadiusKnown of itself: Newton on the logarithm, which
// is nearly a parabola. NaN where it does not settle.
constexpr double kRadiusKnown = 1e-6;
double RadiusAt(double risk, double b) {
  double radius = 3.5;
  for (int i = 0; i < 12; ++i) {
    const Tail tail = TailAt(radius, b);
    const double step = std::log(tail.beyond / risk) * tail.beyond / tail.slope;
    if (!(std::abs(step) < 0.5 * radius)) break;
    radius -= step;
    if (std::abs(step) < 1e-3 * std::sqrt(kRadiusKnown) * radius) return radius;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

double ChiSquaredTail(double chi2, int dof) {
  if (std::isnan(chi2)) return 0.0;
  if (chi2 <= 0.0) return 1.0;
  if (std::isinf(chi2)) return 0.0;
  // Recurrence Q(k + 2) = Q(k) + (chi2 / 2)^(k / 2) exp(-chi2 / 2) / Gamma(k / 2 + 1).
  const bool even = dof % 2 == 0;
  double tail = even ? std::exp(-0.5 * chi2) : std::erfc(std::sqrt(0.5 * chi2));
  double step = even ? 0.5 * chi2 * std::exp(-0.5 * chi2)
                     : std::sqrt(2.0 * chi2 / std::numbers::pi) * std::exp(-0.5 * chi2);
  for (int k = even ? 2 : 1; k < dof; k += 2) {
    tail += step;
    step *= chi2 / (k + 2);
  }
  return std::min(tail, 1.0);
}

double ErrorRadius(const Eigen::Matrix3d& covariance, double risk) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(covariance, Eigen::EigenvaluesOnly);
  const Eigen::Vector3d variance = eigen.eigenvalues().cwiseMax(0.0);
  if (variance[2] <= 0.0) return 0.0;
  const double b = std::sqrt(variance[1] / variance[2]);
  // The tail falls with the radius: bisect, keeping the upper end, which errs outwards. Only where
  // a middle is as close to the root as that is known must the tail itself be asked.
  const double root = RadiusAt(risk, b);
  const auto is_beyond_risk = [&](double radius) {
    if (std::abs(radius - root) > kRadiusKnown * root) return radius < root;
    return TailAt(radius, b).beyond > risk;
  };
  double low = 0.0;
  double high = 2.0;
  while (is_beyond_risk(high)) {
    low = high;
    high *= 2.0;
  }
  while (high - low > 1e-4 * high) {
    const double middle = 0.5 * (low + high);
    (is_beyond_risk(middle) ? low : high) = middle;
  }
  return high * std::sqrt(variance[2]);
}

}  // namespace tbm
