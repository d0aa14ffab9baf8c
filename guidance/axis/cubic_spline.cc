#include "guidance/axis/cubic_spline.h"

#include <algorithm>
#include <utility>

#include "pose/base/check.h"

namespace tbm {
namespace {

// Slope at knots[first] of the polynomial through `count` points that begin there, in steps of
// `step` (+1 or -1): Newton's divided differences.
double EndSlope(const std::vector<double>& knots,
                const std::vector<double>& values,
                std::ptrdiff_t first,
                std::ptrdiff_t step,
                std::size_t count) {
  const auto index = [=](std::size_t i) {
    return static_cast<std::size_t>(first + step * static_cast<std::ptrdiff_t>(i));
  };
  std::vector<double> difference(count);
  for (std::size_t i = 0; i < count; ++i) difference[i] = values[index(i)];
  double slope = 0.0;
  double product = 1.0;  // derivative of (t - t0)(t - t1).. at t0
  for (std::size_t order = 1; order < count; ++order) {
    for (std::size_t i = count - 1; i >= order; --i) {
      difference[i] =
          (difference[i] - difference[i - 1]) / (knots[index(i)] - knots[index(i - order)]);
    }
    slope += difference[order] * product;
    product *= knots[index(0)] - knots[index(order)];
  }
  return slope;
}

}  // namespace

CubicSpline::CubicSpline(std::vector<double> knots, std::vector<double> values)
    : knots_(std::move(knots)), values_(std::move(values)), slopes_(knots_.size()) {
  const std::size_t n = knots_.size();
  TBM_CHECK(n >= 2 && values_.size() == n);
  const std::size_t at_ends = std::min<std::size_t>(n, 4);
  slopes_.front() = EndSlope(knots_, values_, 0, 1, at_ends);
  slopes_.back() = EndSlope(knots_, values_, static_cast<std::ptrdiff_t>(n) - 1, -1, at_ends);
  // Continuous second derivative: h1 s0 + 2 (h0 + h1) s1 + h0 s2 = 3 (h1 d0 + h0 d1); Thomas.
  std::vector<double> upper(n);
  upper[0] = 0.0;
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double before = knots_[i] - knots_[i - 1];
    const double after = knots_[i + 1] - knots_[i];
    const double right = 3.0 * (after * (values_[i] - values_[i - 1]) / before +
                                before * (values_[i + 1] - values_[i]) / after);
    const double pivot = 2.0 * (before + after) - after * upper[i - 1];
    upper[i] = before / pivot;
    slopes_[i] = (right - after * slopes_[i - 1]) / pivot;
  }
  for (std::size_t i = n - 1; i-- > 1;) slopes_[i] -= upper[i] * slopes_[i + 1];
}

CubicSpline::Cubic CubicSpline::On(std::size_t interval) const {
  const double h = knots_[interval + 1] - knots_[interval];
  const double mean = (values_[interval + 1] - values_[interval]) / h;
  const double from = slopes_[interval];
  const double to = slopes_[interval + 1];
  return {values_[interval],
          from,
          (3.0 * mean - 2.0 * from - to) / h,
          (from + to - 2.0 * mean) / (h * h)};
}

}  // namespace tbm
