#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include <Eigen/Core>

// Curves of the plane by numerical integration in long double, for comparison with the axis. Shares
// nothing with it: formulas of the curvature are written out a second time, places come from an
// adaptive Runge-Kutta of the natural equation, lengths of graphs from an adaptive Simpson rule.
namespace tbm::test {

using Real = long double;
inline constexpr Real kPiL = std::numbers::pi_v<Real>;

struct TruthState {
  Real x = 0;
  Real y = 0;
  Real heading = 0;  // counter-clockwise from x
};

using CurvatureOf = std::function<Real(Real)>;  // of the length; left is positive

// Classical Runge-Kutta of fourth order, one step.
inline TruthState Step(const CurvatureOf& curvature, const TruthState& from, Real s, Real h) {
  const auto rate = [&](Real at, const TruthState& z) {
    return std::array<Real, 3>{std::cos(z.heading), std::sin(z.heading), curvature(at)};
  };
  const auto moved = [&](const std::array<Real, 3>& k, Real by) {
    return TruthState{from.x + by * k[0], from.y + by * k[1], from.heading + by * k[2]};
  };
  const auto k1 = rate(s, from);
  const auto k2 = rate(s + h / 2, moved(k1, h / 2));
  const auto k3 = rate(s + h / 2, moved(k2, h / 2));
  const auto k4 = rate(s + h, moved(k3, h));
  TruthState to = from;
  to.x += h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]);
  to.y += h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1]);
  to.heading += h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2]);
  return to;
}

// From one length to another; steps are halved until two halves agree with the whole.
inline TruthState Integrate(const CurvatureOf& curvature, TruthState state, Real from, Real to) {
  constexpr Real kTolerance = 1e-13L;  // of a step, in metres
  Real s = from;
  Real h = to - from;
  while (s < to) {
    h = std::min(h, to - s);
    const TruthState whole = Step(curvature, state, s, h);
    const TruthState half = Step(curvature, state, s, h / 2);
    const TruthState two = Step(curvature, half, s + h / 2, h / 2);
    const Real error =
        std::hypot(two.x - whole.x, two.y - whole.y) + h * std::abs(two.heading - whole.heading);
    if (error > kTolerance && h > 1e-6L) {
      h /= 2;
      continue;
    }
    state = two;
    s += h;
    if (error < kTolerance / 64) h *= 2;
  }
  return state;
}

// The part of the whole change of curvature after the part u of the length, as published.
inline Real BlossCourse(Real u) { return 3 * u * u - 2 * u * u * u; }
inline Real CosineCourse(Real u) { return (1 - std::cos(kPiL * u)) / 2; }
inline Real SinusoidCourse(Real u) { return u - std::sin(2 * kPiL * u) / (2 * kPiL); }
inline Real HelmertCourse(Real u) { return u < 0.5L ? 2 * u * u : -1 + 4 * u - 2 * u * u; }
inline Real WienerCourse(Real u) {
  return 35 * std::pow(u, Real(4)) - 84 * std::pow(u, Real(5)) + 70 * std::pow(u, Real(6)) -
         20 * std::pow(u, Real(7));
}

// Length of the graph y(x) from its slope.
inline Real GraphLength(const std::function<Real(Real)>& slope, Real from, Real to) {
  const auto rate = [&](Real x) { return std::sqrt(1 + slope(x) * slope(x)); };
  const std::function<Real(Real, Real, Real, Real, Real, int)> simpson =
      [&](Real a, Real b, Real fa, Real fm, Real fb, int depth) -> Real {
    const Real m = (a + b) / 2;
    const Real fl = rate((a + m) / 2);
    const Real fr = rate((m + b) / 2);
    const Real whole = (b - a) / 6 * (fa + 4 * fm + fb);
    const Real halves = (b - a) / 12 * (fa + 4 * fl + 2 * fm + 4 * fr + fb);
    if (depth > 30 || std::abs(halves - whole) < 1e-15L * (1 + std::abs(b - a))) {
      return halves + (halves - whole) / 15;
    }
    return simpson(a, m, fa, fl, fm, depth + 1) + simpson(m, b, fm, fr, fb, depth + 1);
  };
  if (to <= from) return 0;
  return simpson(from, to, rate(from), rate((from + to) / 2), rate(to), 0);
}

// A frame in which a truth is put down: x along `heading`.
struct Placement {
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;

  Eigen::Vector2d operator()(Real x, Real y) const {
    const Real c = std::cos(static_cast<Real>(heading_rad));
    const Real s = std::sin(static_cast<Real>(heading_rad));
    return {static_cast<double>(static_cast<Real>(origin.x()) + c * x - s * y),
            static_cast<double>(static_cast<Real>(origin.y()) + s * x + c * y)};
  }
};

}  // namespace tbm::test
