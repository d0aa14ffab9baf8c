#include "guidance/axis/plan.h"

#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/axis/design_axis.h"
#include "guidance/axis/plan_shape.h"
#include "tests/guidance/axis/truth.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using test::CurvatureOf;
using test::Placement;
using test::Real;
using test::TruthState;

struct OverLength {
  SpiralLaw law;
  const char* name;
  Real (*course)(Real);
};
const OverLength kOverLength[] = {
    {SpiralLaw::kClothoid, "clothoid", [](Real u) { return u; }},
    {SpiralLaw::kBloss, "bloss", test::BlossCourse},
    {SpiralLaw::kCosine, "cosine", test::CosineCourse},
    {SpiralLaw::kSinusoid, "sinusoid", test::SinusoidCourse},
    {SpiralLaw::kBiquadratic, "biquadratic", test::HelmertCourse},
    {SpiralLaw::kWienerBogen, "wiener bogen", test::WienerCourse},
};

AxisDescription OneElement(const PlanElement& element) {
  AxisDescription description;
  description.start = {1000.0};
  description.plan = {element};
  return description;
}

Plan PlanOf(const AxisDescription& description) {
  AxisRemarks remarks;
  auto plan = Plan::Build(description, &remarks);
  EXPECT_TRUE(plan.has_value());
  EXPECT_TRUE(remarks.empty()) << static_cast<int>(remarks.front().code) << " size "
                               << remarks.front().size;
  return plan ? *std::move(plan) : Plan();
}

// Largest distance between an axis and the truth along it; direction and curvature on the way.
double WorstDistance(const Plan& plan,
                     const CurvatureOf& curvature,
                     double length_m,
                     const Placement& placement) {
  double worst_m = 0.0;
  TruthState state;
  constexpr int kSteps = 25;
  for (int i = 0; i <= kSteps; ++i) {
    const Real from = static_cast<Real>(length_m) * std::max(i - 1, 0) / kSteps;
    const Real to = static_cast<Real>(length_m) * i / kSteps;
    state = test::Integrate(curvature, state, from, to);
    const PlanPoint point =
        plan.At({std::min(plan.start().m + static_cast<double>(to), plan.end().m)});
    worst_m = std::max(worst_m, (point.place - placement(state.x, state.y)).norm());
    const double heading = std::atan2(point.direction.y(), point.direction.x());
    const double turned = placement.heading_rad + static_cast<double>(state.heading);
    EXPECT_NEAR(std::remainder(heading - turned, 2.0 * M_PI), 0.0, 1e-10);
    EXPECT_NEAR(point.curvature_right_per_m, -static_cast<double>(curvature(to)), 1e-11);
  }
  return worst_m;
}

TEST(Plan, SpiralsOverLengthAgreeWithAnIntegrationThatSharesNoCode) {
  test::Random random("spirals over length");
  for (const OverLength& type : kOverLength) {
    // (start, end) curvatures: into a curve, out of it, between two curves, through an inflection.
    const std::pair<double, double> kEnds[] = {{0.0, 1.0 / 250.0},
                                               {1.0 / 250.0, 0.0},
                                               {1.0 / 900.0, 1.0 / 180.0},
                                               {-1.0 / 300.0, 1.0 / 500.0}};
    for (const auto& [first, last] : kEnds) {
      for (const Turning turning : {Turning::kLeft, Turning::kRight}) {
        SCOPED_TRACE(std::string(type.name) + " " + std::to_string(first));
        const double length_m = random.Uniform(40.0, 150.0);
        const Real side = turning == Turning::kLeft ? 1 : -1;
        const CurvatureOf curvature =
            [=, course = type.course, first = first, last = last](Real s) {
              return side * (first + (last - first) * course(s / length_m));
            };
        const Placement placement{{random.Uniform(-500.0, 500.0), random.Uniform(-500.0, 500.0)},
                                  random.Uniform(-3.1, 3.1)};
        const TruthState end = test::Integrate(curvature, {}, 0, length_m);
        SpiralElement spiral;
        spiral.start = placement(0, 0);
        spiral.end = placement(end.x, end.y);
        spiral.law = type.law;
        spiral.length_m = length_m;
        spiral.curvature_start_per_m = first;
        spiral.curvature_end_per_m = last;
        spiral.turning = turning;
        const Plan plan = PlanOf(OneElement({spiral, {}, 0}));
        EXPECT_LT(WorstDistance(plan, curvature, length_m, placement), 1e-9);
      }
    }
  }
}

// A curve given as a height over its tangent: the same points, with their lengths.
struct Graph {
  SpiralLaw law;
  const char* name;
  bool has_own_extent;  // X in the formula, and not L
  Real (*height)(Real x, Real extent, Real radius);
  Real (*slope)(Real x, Real extent, Real radius);
};
const Graph kGraphs[] = {
    {SpiralLaw::kCubicParabola,
     "cubic parabola",
     false,
     [](Real x, Real l, Real r) { return x * x * x / (6 * r * l); },
     [](Real x, Real l, Real r) { return x * x / (2 * r * l); }},
    {SpiralLaw::kJapaneseCubic,
     "japanese cubic",
     true,
     [](Real x, Real e, Real r) { return x * x * x / (6 * r * e); },
     [](Real x, Real e, Real r) { return x * x / (2 * r * e); }},
    {SpiralLaw::kSineHalfWave,
     "sine half-wave",
     true,
     [](Real x, Real e, Real r) {
       const Real a = x / e;
       return e * e / r *
              (a * a / 4 - (1 - std::cos(test::kPiL * a)) / (2 * test::kPiL * test::kPiL));
     },
     [](Real x, Real e, Real r) {
       return e / r * (x / e / 2 - std::sin(test::kPiL * x / e) / (2 * test::kPiL));
     }},
    {SpiralLaw::kBiquadraticParabola,
     "biquadratic parabola",
     true,
     [](Real x, Real e, Real r) {
       if (x <= e / 2) return x * x * x * x / (6 * r * e * e);
       return -x * x * x * x / (6 * r * e * e) + 2 * x * x * x / (3 * r * e) - x * x / (2 * r) +
              e * x / (6 * r) - e * e / (48 * r);
     },
     [](Real x, Real e, Real r) {
       if (x <= e / 2) return 2 * x * x * x / (3 * r * e * e);
       return -2 * x * x * x / (3 * r * e * e) + 2 * x * x / (r * e) - x / r + e / (6 * r);
     }},
};

TEST(Plan, HeightsOverTheTangentAgreeWithTheirFormula) {
  constexpr Real kRadius = 400;
  constexpr Real kExtent = 120;
  for (const Graph& graph : kGraphs) {
    for (const bool leaves_curve : {false, true}) {
      SCOPED_TRACE(graph.name);
      // The formula's parameter: X itself, or the length, found by halving.
      Real parameter = kExtent;
      const auto length_with = [&](Real p) {
        return test::GraphLength([&](Real x) { return graph.slope(x, p, kRadius); }, 0, kExtent);
      };
      if (!graph.has_own_extent) {
        for (int i = 0; i < 100; ++i) parameter = length_with(parameter);
      }
      const Real length = length_with(parameter);
      const Placement placement{{20.0, -70.0}, 0.7};
      const Eigen::Vector2d straight_end = placement(0, 0);
      const Eigen::Vector2d curved_end =
          placement(kExtent, graph.height(kExtent, parameter, kRadius));
      SpiralElement spiral;
      spiral.start = leaves_curve ? curved_end : straight_end;
      spiral.end = leaves_curve ? straight_end : curved_end;
      spiral.law = graph.law;
      spiral.length_m = static_cast<double>(length);
      (leaves_curve ? spiral.curvature_start_per_m : spiral.curvature_end_per_m) =
          1.0 / static_cast<double>(kRadius);
      // Left of its tangent, or walked back: to the right.
      spiral.turning = leaves_curve ? Turning::kRight : Turning::kLeft;
      const Plan plan = PlanOf(OneElement({spiral, {}, 0}));
      for (int i = 0; i <= 40; ++i) {
        const Real x = kExtent * i / 40;
        const Real s =
            test::GraphLength([&](Real at) { return graph.slope(at, parameter, kRadius); }, 0, x);
        const double along_m = static_cast<double>(leaves_curve ? length - s : s);
        const PlanPoint point =
            plan.At({std::clamp(1000.0 + along_m, plan.start().m, plan.end().m)});
        const Eigen::Vector2d expected = placement(x, graph.height(x, parameter, kRadius));
        EXPECT_LT((point.place - expected).norm(), 1e-9) << static_cast<double>(x);
      }
    }
  }
}

// A negative radius turns to the other side: the mirrored spiral written the other way.
TEST(Plan, NegativeRadiusTurnsToTheOtherSide) {
  for (const SpiralLaw law :
       {SpiralLaw::kClothoid, SpiralLaw::kJapaneseCubic, SpiralLaw::kCubicSpiral}) {
    SpiralElement spiral;
    spiral.law = law;
    spiral.length_m = 80.0;
    spiral.turning = Turning::kLeft;
    spiral.curvature_end_per_m = -1.0 / 300.0;
    const auto negative = SpiralShape(spiral, LengthMeaning::kAlongCurve);
    spiral.turning = Turning::kRight;
    spiral.curvature_end_per_m = 1.0 / 300.0;
    const auto mirrored = SpiralShape(spiral, LengthMeaning::kAlongCurve);
    ASSERT_TRUE(negative && mirrored);
    EXPECT_LT(negative->turn_rad(80.0), -0.1);
    for (const double s_m : {10.0, 40.0, 80.0}) {
      EXPECT_NEAR(negative->turn_rad(s_m), mirrored->turn_rad(s_m), 1e-15);
      EXPECT_NEAR(negative->curvature_left_per_m(s_m), mirrored->curvature_left_per_m(s_m), 1e-15);
    }
  }
}

TEST(Plan, CubicSpiralRisesWithTheCubeOfItsLength) {
  constexpr Real kLength = 90;
  constexpr Real kRadius = 300;
  const auto sine = [](Real s) { return s * s / (2 * kRadius * kLength); };
  const auto curvature = [&](Real s) {
    return s / (kRadius * kLength) / std::sqrt(1 - sine(s) * sine(s));
  };
  const TruthState end = test::Integrate(curvature, {}, 0, kLength);
  EXPECT_NEAR(static_cast<double>(end.y), 90.0 * 90.0 / (6.0 * 300.0), 1e-12);
  const Placement placement{{3.0, 4.0}, 1.0};
  SpiralElement spiral;
  spiral.start = placement(0, 0);
  spiral.end = placement(end.x, end.y);
  spiral.law = SpiralLaw::kCubicSpiral;
  spiral.length_m = 90.0;
  spiral.curvature_end_per_m = 1.0 / 300.0;
  const Plan plan = PlanOf(OneElement({spiral, {}, 0}));
  EXPECT_LT(WorstDistance(plan, curvature, 90.0, placement), 1e-9);
}

TEST(Plan, ArcsOfLessAndMoreThanHalfACircleKeepTheirRadius) {
  for (const double turn_rad : {1e-5, 0.02, 1.0, 3.0, M_PI, 3.3, 5.5}) {
    for (const Turning turning : {Turning::kLeft, Turning::kRight}) {
      SCOPED_TRACE(turn_rad);
      const double side = turning == Turning::kLeft ? 1.0 : -1.0;
      const double radius_m = 325.0;
      const Eigen::Vector2d centre(1200.0, -340.0);
      const auto on_circle = [&](double angle_rad) -> Eigen::Vector2d {
        return centre + radius_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
      };
      CurveElement curve;
      curve.start = on_circle(0.4);
      curve.end = on_circle(0.4 + side * turn_rad);
      curve.centre = centre;
      curve.turning = turning;
      PlanElement element{curve, {}, 0};
      element.stated.length_m = radius_m * turn_rad;
      const Plan plan = PlanOf(OneElement(element));
      for (double share = 0.0; share <= 1.0; share += 0.125) {
        const PlanPoint point =
            plan.At({std::min(1000.0 + share * radius_m * turn_rad, plan.end().m)});
        EXPECT_LT((point.place - on_circle(0.4 + side * share * turn_rad)).norm(), 2e-10);
        EXPECT_NEAR(point.curvature_right_per_m, -side / radius_m, 2e-8 / turn_rad / radius_m);
      }
    }
  }
}

TEST(Plan, HoldsAMicrometreFourThousandKilometresFromTheOrigin) {
  const double length_m = 110.0;
  const CurvatureOf curvature = [=](Real s) { return s / length_m / 280; };
  const Placement placement{{4'312'345.678, 5'512'345.678}, 2.1};
  const TruthState end = test::Integrate(curvature, {}, 0, length_m);
  SpiralElement spiral;
  spiral.start = placement(0, 0);
  spiral.end = placement(end.x, end.y);
  spiral.length_m = length_m;
  spiral.curvature_end_per_m = 1.0 / 280.0;
  const Plan plan = PlanOf(OneElement({spiral, {}, 0}));
  TruthState state;
  for (int i = 1; i <= 20; ++i) {
    state =
        test::Integrate(curvature, state, Real(length_m) * (i - 1) / 20, Real(length_m) * i / 20);
    const PlanPoint point = plan.At({std::min(1000.0 + length_m * i / 20, plan.end().m)});
    EXPECT_LT((point.place - placement(state.x, state.y)).norm(), 3e-9);
  }
}

// Points of a known curve every metre.
TEST(Plan, TableOfPointsIsFollowedWithoutChords) {
  AxisDescription description;
  description.start = {0.0};
  const CurvatureOf curvature = [](Real s) { return s < 100 ? s / 100 / 300 : Real(1) / 300; };
  const Placement placement{{100.0, 200.0}, 0.3};
  TruthState state;
  std::vector<Eigen::Vector2d> middles;
  for (int i = 0; i <= 200; ++i) {
    description.table.push_back({placement(state.x, state.y), {}, {}, i});
    state = test::Integrate(curvature, state, i, i + 0.5L);
    middles.push_back(placement(state.x, state.y));
    state = test::Integrate(curvature, state, i + 0.5L, i + 1);
  }
  const Plan plan = PlanOf(description);
  EXPECT_NEAR(plan.end().m, 200.0, 1e-6);
  for (int i = 0; i < 200; ++i) {
    const PlanPoint point = plan.At({i + 0.5});
    // The chord lies 0.4 mm inside.
    EXPECT_LT((point.place - middles[static_cast<std::size_t>(i)]).norm(), 1e-7) << i;
    EXPECT_NEAR(point.curvature_right_per_m,
                -static_cast<double>(curvature(i + 0.5L)),
                std::abs(i + 0.5 - 100.0) < 6.0 || i < 3 || i > 196 ? 3e-5 : 1e-7)
        << i;
  }
}

}  // namespace
}  // namespace tbm
