#pragma once

#include <cstddef>
#include <vector>

namespace tbm {

// A twice continuously differentiable cubic through values at increasing knots. The slopes at both
// ends are those of the cubic through the first, or last, four points: the error is of fourth order
// in the spacing everywhere, ends included.
class CubicSpline {
 public:
  // Two knots or more, increasing; as many values.
  CubicSpline(std::vector<double> knots, std::vector<double> values);

  // Coefficients of 1, t, t^2, t^3 from knot `interval` on.
  struct Cubic {
    double a = 0.0;
    double b = 0.0;
    double c = 0.0;
    double d = 0.0;
  };
  Cubic On(std::size_t interval) const;
  std::size_t interval_count() const { return knots_.size() - 1; }
  const std::vector<double>& knots() const { return knots_; }

 private:
  std::vector<double> knots_;
  std::vector<double> values_;
  std::vector<double> slopes_;
};

}  // namespace tbm
