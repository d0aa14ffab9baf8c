#include "pose/solve/cubic.h"

#include <algorithm>
#include <cmath>

namespace tbm {

FixedVector<double, 3> CubicRoots(double c3, double c2, double c1, double c0) {
  const double a = c2 / c3;
  const double b = c1 / c3;
  const double c = c0 / c3;
  const double q = (a * a - 3.0 * b) / 9.0;
  const double r = (2.0 * a * a * a - 9.0 * a * b + 27.0 * c) / 54.0;
  FixedVector<double, 3> roots;
  if (r * r < q * q * q) {
    const double third_rad = std::acos(std::clamp(r / std::sqrt(q * q * q), -1.0, 1.0)) / 3.0;
    constexpr double kThirdTurn = 2.0943951023931954923;
    for (int k = -1; k <= 1; ++k) {
      roots.push_back(-2.0 * std::sqrt(q) * std::cos(third_rad + k * kThirdTurn) - a / 3.0);
    }
  } else {
    const double s = -std::copysign(std::cbrt(std::abs(r) + std::sqrt(r * r - q * q * q)), r);
    roots.push_back(s + (s == 0.0 ? 0.0 : q / s) - a / 3.0);
  }
  for (double& x : roots) {
    for (int i = 0; i < 2; ++i) {
      const double slope = (3.0 * x + 2.0 * a) * x + b;
      if (slope == 0.0) break;
      x -= (((x + a) * x + b) * x + c) / slope;
    }
  }
  return roots;
}

}  // namespace tbm
