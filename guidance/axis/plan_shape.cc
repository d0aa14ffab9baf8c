#include "guidance/axis/plan_shape.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "guidance/axis/quadrature.h"
#include "pose/base/check.h"

namespace tbm {
namespace {

constexpr double kPi = std::numbers::pi;

// Every law of the second group takes the course of one of the first.
SpiralLaw CourseOf(SpiralLaw law) {
  switch (law) {
    case SpiralLaw::kCubicSpiral:
    case SpiralLaw::kCubicParabola:
    case SpiralLaw::kJapaneseCubic:
      return SpiralLaw::kClothoid;
    case SpiralLaw::kSineHalfWave:
      return SpiralLaw::kCosine;
    case SpiralLaw::kBiquadraticParabola:
      return SpiralLaw::kBiquadratic;
    default:
      return law;
  }
}

double SideOf(Turning turning) { return turning == Turning::kLeft ? 1.0 : -1.0; }

// Curvature over length: k(s) = k0 + (k1 - k0) f(s / L).
PlanShape ShapeOverLength(const SpiralElement& element) {
  const double side = SideOf(element.turning);
  const double length_m = element.length_m;
  const double first = side * element.curvature_start_per_m;
  const double change = side * (element.curvature_end_per_m - element.curvature_start_per_m);
  const SpiralLaw law = element.law;
  PlanShape shape;
  shape.length_m = length_m;
  shape.turn_rad = [=](double s_m) {
    return first * s_m + change * length_m * TurnShare(law, s_m / length_m);
  };
  shape.curvature_left_per_m = [=](double s_m) {
    return first + change * CurvatureShare(law, s_m / length_m);
  };
  if (law == SpiralLaw::kBiquadratic) shape.breaks_m = {0.5 * length_m};
  return shape;
}

// A curve that leaves its tangent at the origin, seen from there: x along the tangent, y over it.
//   y'' = c f(x / X),  y' = c X F(x / X),  c = k X / D
// with k the stated curvature of the other end; D is X, except for the cubic parabola over its
// length.
struct HeightOverTangent {
  SpiralLaw course = SpiralLaw::kClothoid;
  double extent_m = 0.0;     // X
  double scale_per_m = 0.0;  // c

  double Slope(double x_m) const {
    return scale_per_m * extent_m * TurnShare(course, x_m / extent_m);
  }
  double SecondDerivative(double x_m) const {
    return scale_per_m * CurvatureShare(course, x_m / extent_m);
  }
  double LengthBetween(double from_m, double to_m) const {
    return IntegrateGauss([this](double x_m) { return std::hypot(1.0, Slope(x_m)); },
                          from_m,
                          to_m,
                          /*pieces=*/12);
  }
  // Split where the law of the biquadratic parabola changes.
  double Length(double x_m) const {
    const double middle_m = 0.5 * extent_m;
    if (x_m <= middle_m) return LengthBetween(0.0, x_m);
    return LengthBetween(0.0, middle_m) + LengthBetween(middle_m, x_m);
  }
  // Newton; a unit of length is at least a unit of x and at most 1.5, so it converges from the
  // side.
  double PlaceAt(double s_m) const {
    double x_m = std::min(s_m, extent_m);
    for (int iteration = 0; iteration < 20; ++iteration) {
      const double step_m = (s_m - Length(x_m)) / std::hypot(1.0, Slope(x_m));
      x_m += step_m;
      if (std::abs(step_m) < 1e-14 * extent_m) break;
    }
    return x_m;
  }
};

HeightOverTangent MakeHeight(SpiralLaw law, double curvature, double length_m, double extent_m) {
  const double denominator_m = law == SpiralLaw::kCubicParabola ? length_m : extent_m;
  return {CourseOf(law), extent_m, curvature * extent_m / denominator_m};
}

// The extent along the tangent of a curve of that length. Its length grows with the extent.
HeightOverTangent HeightOfLength(SpiralLaw law, double curvature, double length_m) {
  double low_m = 0.0;
  double high_m = length_m;
  while (true) {
    const double extent_m = 0.5 * (low_m + high_m);
    const HeightOverTangent height = MakeHeight(law, curvature, length_m, extent_m);
    if (extent_m <= low_m || extent_m >= high_m) return height;
    (height.Length(extent_m) < length_m ? low_m : high_m) = extent_m;
  }
}

// A shape by turn and curvature since its straight end, given for the way away from it.
struct FromStraightEnd {
  double length_m = 0.0;
  std::function<double(double)> turn_rad;
  std::function<double(double)> curvature_per_m;
  std::vector<double> breaks_m;
};

// Walked from the straight end, or towards it; to the left or to the right.
PlanShape Walked(const FromStraightEnd& way, bool starts_straight, double side) {
  PlanShape shape;
  const double length_m = way.length_m;
  shape.length_m = length_m;
  shape.breaks_m = way.breaks_m;
  if (starts_straight) {
    shape.turn_rad = [turn = way.turn_rad, side](double s_m) { return side * turn(s_m); };
    shape.curvature_left_per_m = [curvature = way.curvature_per_m, side](double s_m) {
      return side * curvature(s_m);
    };
    return shape;
  }
  for (double& at_m : shape.breaks_m) at_m = length_m - at_m;
  const double whole_rad = way.turn_rad(length_m);
  shape.turn_rad = [turn = way.turn_rad, side, length_m, whole_rad](double s_m) {
    return side * (whole_rad - turn(length_m - s_m));
  };
  shape.curvature_left_per_m = [curvature = way.curvature_per_m, side, length_m](double s_m) {
    return side * curvature(length_m - s_m);
  };
  return shape;
}

// sin(turn) = k L F(l / L): the height over the tangent is a cubic of the length.
FromStraightEnd CubicSpiral(double curvature, double length_m) {
  const auto sine = [=](double s_m) { return 0.5 * curvature * s_m * s_m / length_m; };
  FromStraightEnd way;
  way.length_m = length_m;
  way.turn_rad = [=](double s_m) { return std::asin(sine(s_m)); };
  way.curvature_per_m = [=](double s_m) {
    return curvature * s_m / length_m / std::sqrt(1.0 - sine(s_m) * sine(s_m));
  };
  return way;
}

FromStraightEnd OverTangent(const HeightOverTangent& height) {
  FromStraightEnd way;
  way.length_m = height.Length(height.extent_m);
  way.turn_rad = [=](double s_m) { return std::atan(height.Slope(height.PlaceAt(s_m))); };
  way.curvature_per_m = [=](double s_m) {
    const double x_m = height.PlaceAt(s_m);
    const double stretch = std::hypot(1.0, height.Slope(x_m));
    return height.SecondDerivative(x_m) / (stretch * stretch * stretch);
  };
  if (height.course == SpiralLaw::kBiquadratic) {
    way.breaks_m = {height.Length(0.5 * height.extent_m)};
  }
  return way;
}

}  // namespace

PlanShape LineShape(double length_m) { return ArcShape(length_m, 0.0); }

PlanShape ArcShape(double length_m, double curvature_left_per_m) {
  PlanShape shape;
  shape.length_m = length_m;
  shape.turn_rad = [=](double s_m) { return curvature_left_per_m * s_m; };
  shape.curvature_left_per_m = [=](double) { return curvature_left_per_m; };
  return shape;
}

bool IsHeightOverTangent(SpiralLaw law) {
  return law == SpiralLaw::kCubicParabola || law == SpiralLaw::kJapaneseCubic ||
         law == SpiralLaw::kSineHalfWave || law == SpiralLaw::kBiquadraticParabola;
}

Result<PlanShape, SpiralFailure> SpiralShape(const SpiralElement& element, LengthMeaning meaning) {
  if (!IsHeightOverTangent(element.law) && element.law != SpiralLaw::kCubicSpiral) {
    return ShapeOverLength(element);
  }
  const bool starts_straight = element.curvature_start_per_m == 0.0;
  const bool ends_straight = element.curvature_end_per_m == 0.0;
  if (starts_straight == ends_straight) return Failure{SpiralFailure::kBetweenCurves};
  const double signed_curvature =
      starts_straight ? element.curvature_end_per_m : element.curvature_start_per_m;
  const double side = SideOf(element.turning) * (signed_curvature < 0.0 ? -1.0 : 1.0);
  const double curvature = std::abs(signed_curvature);
  // Sine, or slope, of the turn at the end: beyond 45 degrees none of these is a transition.
  if (!(0.5 * curvature * element.length_m <= 0.7)) return Failure{SpiralFailure::kTurnsTooFar};
  if (element.law == SpiralLaw::kCubicSpiral) {
    return Walked(CubicSpiral(curvature, element.length_m), starts_straight, side);
  }
  const HeightOverTangent height =
      meaning == LengthMeaning::kAlongTangent
          ? MakeHeight(element.law, curvature, element.length_m, element.length_m)
          : HeightOfLength(element.law, curvature, element.length_m);
  return Walked(OverTangent(height), starts_straight, side);
}

double CurvatureShare(SpiralLaw law, double u) {
  switch (law) {
    case SpiralLaw::kClothoid:
      return u;
    case SpiralLaw::kBloss:
      return u * u * (3.0 - 2.0 * u);
    case SpiralLaw::kCosine:
      return 0.5 * (1.0 - std::cos(kPi * u));
    case SpiralLaw::kSinusoid:
      return u - std::sin(2.0 * kPi * u) / (2.0 * kPi);
    case SpiralLaw::kBiquadratic:
      return u <= 0.5 ? 2.0 * u * u : 1.0 - 2.0 * (1.0 - u) * (1.0 - u);
    case SpiralLaw::kWienerBogen:
      return u * u * u * u * (35.0 + u * (-84.0 + u * (70.0 - 20.0 * u)));
    default:
      TBM_CHECK(false);
  }
}

double TurnShare(SpiralLaw law, double u) {
  switch (law) {
    case SpiralLaw::kClothoid:
      return 0.5 * u * u;
    case SpiralLaw::kBloss:
      return u * u * u * (1.0 - 0.5 * u);
    case SpiralLaw::kCosine:
      return 0.5 * u - std::sin(kPi * u) / (2.0 * kPi);
    case SpiralLaw::kSinusoid: {
      const double sine = std::sin(kPi * u);
      return 0.5 * u * u - 0.5 * sine * sine / (kPi * kPi);
    }
    case SpiralLaw::kBiquadratic:
      return u <= 0.5 ? 2.0 / 3.0 * u * u * u
                      : u - 0.5 + 2.0 / 3.0 * (1.0 - u) * (1.0 - u) * (1.0 - u);
    case SpiralLaw::kWienerBogen:
      return u * u * u * u * u * (7.0 + u * (-14.0 + u * (10.0 - 2.5 * u)));
    default:
      TBM_CHECK(false);
  }
}

}  // namespace tbm
