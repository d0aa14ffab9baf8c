#include "guidance/axis/design_axis.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/guidance/axis/made_axis.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using test::MadeAxis;
using test::Part;
using test::Placement;
using test::Real;
using test::TruthState;

DesignAxis Built(const AxisDescription& description) {
  auto axis = DesignAxis::Build(description);
  if (!axis) {
    for (const AxisRemark& remark : axis.error()) {
      ADD_FAILURE() << "remark " << static_cast<int>(remark.code) << ", size " << remark.size;
    }
    std::abort();
  }
  return std::move(axis).value();
}

Eigen::Vector3d WithHeight(const Eigen::Vector2d& plan, double up_m) {
  return {plan.x(), plan.y(), up_m};
}

ProfileElement Point(double at_m, double up_m) {
  ProfileElement element;
  element.at = {at_m};
  element.up_m = up_m;
  return element;
}
ProfileElement Rounded(ProfileKind kind,
                       double at_m,
                       double up_m,
                       double in_m,
                       double out_m = 0.0,
                       double radius_m = 0.0) {
  ProfileElement element = Point(at_m, up_m);
  element.kind = kind;
  element.length_in_m = in_m;
  element.length_out_m = out_m;
  element.radius_m = radius_m;
  return element;
}

Profile BuiltProfile(const std::vector<ProfileElement>& elements) {
  AxisRemarks remarks;
  auto profile = Profile::Build(elements, &remarks);
  EXPECT_TRUE(profile.has_value());
  EXPECT_TRUE(remarks.empty());
  return profile ? *profile : Profile();
}

TEST(DesignAxis, FindsEveryPointBesideItsAxisWithinAMicrometre) {
  test::Random random("beside the axis");
  for (const Eigen::Vector2d& origin :
       {Eigen::Vector2d(10.0, -20.0), Eigen::Vector2d(2'650'000.0, 4'100'000.0)}) {
    const MadeAxis made = test::MakeDrive({origin, random.Uniform(-3.0, 3.0)}, 1000.0);
    const DesignAxis axis = Built(made.description);
    std::vector<double> lengths_m;
    for (int i = 0; i < 400; ++i) lengths_m.push_back(random.Uniform(0.01, 699.99));
    for (double joint_m = 80.0; joint_m < 700.0; joint_m += 10.0) lengths_m.push_back(joint_m);
    std::sort(lengths_m.begin(), lengths_m.end());
    const auto states = made.States(lengths_m);
    double worst_m = 0.0;
    for (std::size_t i = 0; i < states.size(); ++i) {
      const double right_m = random.Uniform(-45.0, 45.0);
      const Eigen::Vector3d p = WithHeight(made.Beside(states[i], right_m), 7.0);
      EXPECT_EQ(axis.ProjectAll(p, 50.0).size(), 1u) << "also where two elements join";
      // The reach is as exact as the rest.
      const double reach_m = std::abs(right_m) + 1e-6;
      EXPECT_FALSE(axis.Project(p, {}, std::abs(right_m) - 1e-6).has_value());
      for (const bool has_hint : {false, true}) {
        const auto position = has_hint
                                  ? axis.Project(p, InternalChainage{990.0 + lengths_m[i]}, reach_m)
                                  : axis.Project(p, {}, reach_m);
        ASSERT_TRUE(position.has_value()) << lengths_m[i] << " " << right_m;
        worst_m = std::max({worst_m,
                            std::abs(position->chainage.m - 1000.0 - lengths_m[i]),
                            std::abs(position->deviation_right_m - right_m)});
        EXPECT_FALSE(position->deviation_up_m.has_value()) << "there is no profile";
        const double bearing = M_PI / 2.0 - made.Heading(states[i]);
        EXPECT_NEAR(std::remainder(position->bearing_rad - bearing, 2.0 * M_PI), 0.0, 1e-10);
      }
    }
    // Far from the origin the coordinates themselves are stored to 5e-10 m.
    EXPECT_LT(worst_m, origin.x() < 1e3 ? 1e-9 : 2e-8);
  }
}

// Feet by brute force: where the distance along the axis changes its sign, every centimetre.
std::vector<double> FeetByScan(const MadeAxis& made,
                               const std::vector<TruthState>& states,
                               double step_m,
                               const Eigen::Vector2d& p,
                               double reach_m) {
  std::vector<double> feet_m;
  const auto ahead = [&](std::size_t i) {
    const double heading = made.Heading(states[i]);
    return (p - made.Place(states[i])).dot(Eigen::Vector2d(std::cos(heading), std::sin(heading)));
  };
  for (std::size_t i = 1; i < states.size(); ++i) {
    const double before = ahead(i - 1);
    const double behind = ahead(i);
    if (!(before >= 0.0 && behind < 0.0)) continue;
    if ((p - made.Place(states[i])).norm() > reach_m) continue;
    feet_m.push_back(step_m * (static_cast<double>(i) - 1.0 + before / (before - behind)));
  }
  return feet_m;
}

TEST(DesignAxis, FindsAllFeetThatABruteForceScanFinds) {
  // A loop: the axis crosses itself, and comes near itself without crossing.
  const double bend = 1.0 / 60.0;
  const MadeAxis made = test::Make({{Part::kLine, 60.0, 0.0, 0.0},
                                    {Part::kClothoid, 30.0, 0.0, bend},
                                    {Part::kArc, 250.0, bend, bend},
                                    {Part::kClothoid, 30.0, bend, 0.0},
                                    {Part::kLine, 120.0, 0.0, 0.0}},
                                   {{0.0, 0.0}, 0.2},
                                   0.0);
  const DesignAxis axis = Built(made.description);
  constexpr double kStep_m = 0.1;
  std::vector<double> lengths_m;
  for (double at_m = 0.0; at_m < 490.0; at_m += kStep_m) lengths_m.push_back(at_m);
  const auto states = made.States(lengths_m);
  test::Random random("all feet");
  int several = 0;
  for (int draw = 0; draw < 300; ++draw) {
    const Eigen::Vector2d p =
        made.Place(states[static_cast<std::size_t>(random.Index(4900))]) + random.Normal2(12.0);
    const auto expected = FeetByScan(made, states, kStep_m, p, 40.0);
    const auto found = axis.ProjectAll(WithHeight(p, 0.0), 40.0);
    ASSERT_EQ(found.size(), expected.size()) << draw;
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_NEAR(found[i].chainage.m, expected[i], 2e-3);
    }
    several += found.size() > 1 ? 1 : 0;
    if (found.empty()) continue;
    // With a hint: the foot nearest to it in chainage, whichever is nearer in space.
    for (int i = 0; i < 10; ++i) {
      const InternalChainage hint{random.Uniform(-20.0, 510.0)};
      const auto hinted = axis.Project(WithHeight(p, 0.0), hint, 40.0);
      ASSERT_TRUE(hinted.has_value());
      const auto expected_foot = std::min_element(
          found.begin(), found.end(), [hint](const AxisPosition& a, const AxisPosition& b) {
            return std::abs(a.chainage.m - hint.m) < std::abs(b.chainage.m - hint.m);
          });
      EXPECT_NEAR(hinted->chainage.m, expected_foot->chainage.m, 1e-9) << hint.m;
    }
    const auto nearest = axis.Project(WithHeight(p, 0.0), {}, 40.0);
    if (!nearest) continue;
    for (const AxisPosition& foot : found) {
      EXPECT_LE(std::abs(nearest->deviation_right_m), std::abs(foot.deviation_right_m) + 1e-9);
    }
    EXPECT_EQ(nearest->other_foot.has_value(), found.size() > 1);
  }
  EXPECT_GT(several, 30);
}

// A spiral tunnel: three turns one above the other, 22 m apart.
TEST(DesignAxis, HeightDecidesWhereTheAxisPassesOverItself) {
  const double bend = 1.0 / 140.0;
  std::vector<Part> parts;
  for (int i = 0; i < 9; ++i) parts.push_back({Part::kArc, 2.0 * M_PI / 3.0 / bend, bend, bend});
  MadeAxis made = test::Make(parts, {{0.0, 0.0}, 0.0}, 0.0);
  const double turn_m = 2.0 * M_PI / bend;
  made.description.profile = {Point(0.0, 100.0), Point(3.0 * turn_m, 166.0)};
  const DesignAxis axis = Built(made.description);
  const auto states = made.States({100.0});
  for (int level = 0; level < 3; ++level) {
    const double chainage_m = 100.0 + level * turn_m;
    const double up_m = 100.0 + chainage_m * 66.0 / (3.0 * turn_m);
    const Eigen::Vector3d p = WithHeight(made.Beside(states[0], 0.5), up_m - 0.25);
    const auto position = axis.Project(p);
    ASSERT_TRUE(position.has_value());
    EXPECT_NEAR(position->chainage.m, chainage_m, 1e-6);
    EXPECT_NEAR(position->deviation_right_m, 0.5, 1e-6);
    EXPECT_NEAR(*position->deviation_up_m, -0.25, 1e-6);
    ASSERT_TRUE(position->other_foot.has_value());
  }
  // Half-way between two turns the height does not decide either, a hint does.
  const Eigen::Vector3d between = WithHeight(made.Beside(states[0], 0.5), 0.0) +
                                  Eigen::Vector3d(0.0, 0.0, *axis.At({100.0})->up_m + 11.0);
  ASSERT_FALSE(axis.Project(between).has_value());
  EXPECT_EQ(axis.Project(between).error(), AxisFailure::kAmbiguous);
  EXPECT_NEAR(
      axis.Project(between, InternalChainage{90.0 + turn_m})->chainage.m, 100.0 + turn_m, 1e-6);
}

AxisDescription Corner(double turn_rad) {
  AxisDescription description;
  const Eigen::Vector2d corner(100.0, 0.0);
  const Eigen::Vector2d end =
      corner + 100.0 * Eigen::Vector2d(std::cos(turn_rad), std::sin(turn_rad));
  description.plan = {{LineElement{{0.0, 0.0}, corner}, {}, 1}, {LineElement{corner, end}, {}, 2}};
  return description;
}

TEST(DesignAxis, OutsideOfACornerTheCornerIsTheFoot) {
  const DesignAxis axis = Built(Corner(0.1));  // to the left
  const Eigen::Vector2d outside =
      Eigen::Vector2d(100.0, 0.0) + 3.0 * Eigen::Vector2d(std::sin(0.04), -std::cos(0.04));
  const auto position = axis.Project(WithHeight(outside, 0.0));
  ASSERT_TRUE(position.has_value());
  EXPECT_NEAR(position->chainage.m, 100.0, 1e-12);
  EXPECT_NEAR(position->deviation_right_m, 3.0, 1e-12);
  EXPECT_NEAR(position->bearing_rad, M_PI / 2.0 - 0.04, 1e-12);
  // Inside there are two feet, one on either line.
  const Eigen::Vector2d inside =
      Eigen::Vector2d(100.0, 0.0) + 3.0 * Eigen::Vector2d(-std::sin(0.04), std::cos(0.04));
  EXPECT_EQ(axis.ProjectAll(WithHeight(inside, 0.0), 50.0).size(), 2u);
}

TEST(DesignAxis, SaysWhyThereIsNoFoot) {
  const MadeAxis made = test::MakeDrive({{0.0, 0.0}, 0.0}, 1000.0);
  const DesignAxis axis = Built(made.description);
  const auto failure = [&](const Eigen::Vector3d& p) {
    const auto position = axis.Project(p);
    EXPECT_FALSE(position.has_value());
    const auto hinted = axis.Project(p, InternalChainage{1100.0});
    EXPECT_FALSE(hinted.has_value());
    return position.has_value() ? AxisFailure::kAmbiguous : position.error();
  };
  EXPECT_EQ(failure({-0.1, 3.0, 0.0}), AxisFailure::kBeforeStart);
  EXPECT_EQ(failure({40.0, 51.0, 0.0}), AxisFailure::kTooFar);
  const auto last = axis.At(axis.end());
  const Eigen::Vector2d beyond = last->p_plan_in_site + 0.1 * last->direction_plan_in_site;
  EXPECT_EQ(failure(WithHeight(beyond, 0.0)), AxisFailure::kBeyondEnd);
  EXPECT_EQ(failure({std::nan(""), 0.0, 0.0}), AxisFailure::kNotFinite);
  // The very ends belong to the axis.
  EXPECT_NEAR(axis.Project({0.0, 3.0, 0.0})->chainage.m, 1000.0, 1e-9);
  EXPECT_NEAR(axis.Project(WithHeight(last->p_plan_in_site, 0.0))->chainage.m, 1700.0, 1e-6);
  EXPECT_EQ(axis.At({999.9}).error(), AxisFailure::kBeforeStart);
  EXPECT_EQ(axis.At({1700.1}).error(), AxisFailure::kBeyondEnd);
  EXPECT_EQ(axis.At({std::nan("")}).error(), AxisFailure::kNotFinite);
  // Near the centre of the curve all of it is about as near: no foot, although 300 m are in reach.
  const auto in_curve = axis.At({1200.0});
  const Eigen::Vector2d right(in_curve->direction_plan_in_site.y(),
                              -in_curve->direction_plan_in_site.x());
  for (const double inside_m : {275.0, 300.0}) {
    for (const AxisPosition& foot :
         axis.ProjectAll(WithHeight(in_curve->p_plan_in_site + inside_m * right, 0.0), 400.0)) {
      EXPECT_GT(std::abs(foot.chainage.m - 1210.0), 70.0) << foot.chainage.m;
    }
  }
  EXPECT_EQ(
      axis.ProjectAll(WithHeight(in_curve->p_plan_in_site + 265.0 * right, 0.0), 270.0).size(), 1u);
}

// A file that counts a line of 80 m as 80.004 m: both directions use its counting.
TEST(DesignAxis, CountsChainageAsTheFileDoes) {
  MadeAxis made = test::MakeDrive({{0.0, 0.0}, 0.0}, 0.0);
  made.description.plan[0].stated.length_m = 80.004;
  const DesignAxis axis = Built(made.description);
  EXPECT_NEAR(axis.plan().element_start(1).m, 80.004, 1e-12);
  EXPECT_NEAR(axis.end().m, 700.004, 1e-9);
  EXPECT_NEAR(axis.At({40.002})->p_plan_in_site.x(), 40.0, 1e-12);
  EXPECT_NEAR(axis.Project({40.0, 1.0, 0.0})->chainage.m, 40.002, 1e-12);
}

// An element as short as the rounding of its length keeps the length it has.
TEST(DesignAxis, AnElementOfMillimetresHasALength) {
  AxisDescription description;
  description.plan = {{LineElement{{0.0, 0.0}, {10.0, 0.0}}, {}, 1},
                      {LineElement{{10.0, 0.0}, {10.004, 0.0}}, {}, 2},
                      {LineElement{{10.004, 0.0}, {20.0, 0.0}}, {}, 3}};
  description.plan[1].stated.length_m = 0.0;
  const DesignAxis axis = Built(description);
  EXPECT_NEAR(axis.end().m, 20.0, 1e-12);
  EXPECT_NEAR(axis.At({10.002})->p_plan_in_site.x(), 10.002, 1e-12);
}

TEST(DesignAxis, FrameOfTheAxisHasThePointsDeviationsAsCoordinates) {
  MadeAxis made = test::MakeDrive({{500.0, -300.0}, 2.0}, 0.0);
  const DesignAxis flat = Built(made.description);
  EXPECT_EQ(flat.AxisFromSite({100.0}).error(), AxisFailure::kNoProfile);
  made.description.profile = {Point(0.0, 30.0), Point(700.0, 44.0)};
  const DesignAxis axis = Built(made.description);
  const Eigen::Vector3d p = WithHeight(made.Beside(made.States({333.0})[0], 1.5), 40.0);
  const auto position = axis.Project(p);
  const auto axis_from_site = axis.AxisFromSite(position->chainage);
  ASSERT_TRUE(axis_from_site.has_value());
  const Eigen::Vector3d p_in_axis = *axis_from_site * p;
  EXPECT_NEAR(p_in_axis.x(), 0.0, 1e-9);
  EXPECT_NEAR(p_in_axis.y(), -1.5, 1e-8) << "left is positive in the frame";
  EXPECT_NEAR(p_in_axis.z(), 40.0 - (30.0 + 333.0 * 0.02), 1e-8);
  EXPECT_NEAR(*position->deviation_up_m, p_in_axis.z(), 1e-12);
  const auto point = axis.At({333.0});
  EXPECT_NEAR(point->direction_in_site()->norm(), 1.0, 1e-12);
  EXPECT_NEAR(point->direction_in_site()->z(), 0.02 / std::hypot(1.0, 0.02), 1e-12);
}

TEST(DesignAxis, TouchesNoHeap) {
  MadeAxis made = test::MakeDrive({{0.0, 0.0}, 0.0}, 0.0);
  made.description.profile = {Point(0.0, 30.0), Point(700.0, 44.0)};
  made.description.equations = {{{300.0}, 350.0, true, {}, 0}};
  const DesignAxis axis = Built(made.description);
  const test::HeapCounter counter;
  double sum = 0.0;
  for (double at_m = 1.0; at_m < 699.0; at_m += 7.0) {
    const auto point = axis.At({at_m});
    const Eigen::Vector3d p = *point->p_in_site() + Eigen::Vector3d(0.1, 0.2, 0.3);
    sum += axis.Project(p)->deviation_right_m;
    sum += axis.Project(p, InternalChainage{at_m + 3.0})->deviation_right_m;
    sum += axis.AxisFromSite({at_m})->translation.x();
  }
  EXPECT_EQ(counter.Count(), 0) << sum;
}

TEST(Profile, ParabolaTouchesBothGradientsAndBendsEvenly) {
  const Profile profile = BuiltProfile(
      {Point(0.0, 10.0), Rounded(ProfileKind::kParabola, 100.0, 12.0, 60.0), Point(200.0, 11.0)});
  EXPECT_NEAR(profile.At({70.0})->up_m, 11.4, 1e-12);
  EXPECT_NEAR(profile.At({130.0})->up_m, 11.7, 1e-12);
  EXPECT_NEAR(profile.At({70.0})->gradient, 0.02, 1e-12);
  EXPECT_NEAR(profile.At({130.0})->gradient, -0.01, 1e-12);
  EXPECT_NEAR(profile.At({100.0})->up_m, 12.0 - 60.0 * 0.03 / 8.0, 1e-12) << "g L / 8";
  EXPECT_NEAR(profile.At({85.0})->curvature_up_per_m, -0.03 / 60.0, 1e-15);
  EXPECT_EQ(profile.At({50.0})->curvature_up_per_m, 0.0);
  EXPECT_FALSE(profile.At({-0.1}).has_value());
  EXPECT_FALSE(profile.At({200.1}).has_value());
  EXPECT_TRUE(profile.At({200.0}).has_value());
}

TEST(Profile, UnequalParabolasMeetOverThePointWithOneGradient) {
  const Profile profile =
      BuiltProfile({Point(0.0, 10.0),
                    Rounded(ProfileKind::kUnequalParabolas, 100.0, 8.0, 40.0, 20.0),
                    Point(200.0, 11.0)});
  // A L1 L2 / (2 (L1 + L2)) over the point.
  EXPECT_NEAR(profile.At({100.0})->up_m, 8.0 + 0.05 * 40.0 * 20.0 / 120.0, 1e-12);
  EXPECT_NEAR(profile.At({100.0 - 1e-9})->gradient, profile.At({100.0})->gradient, 1e-9);
  EXPECT_NEAR(profile.At({60.0})->gradient, -0.02, 1e-12);
  EXPECT_NEAR(profile.At({120.0})->gradient, 0.03, 1e-12);
  EXPECT_NEAR(profile.At({120.0})->up_m, 8.6, 1e-12);
}

TEST(Profile, CircleHasItsRadiusInACrestAndInASag) {
  for (const double side : {1.0, -1.0}) {
    const Profile profile =
        BuiltProfile({Point(0.0, 0.0),
                      Rounded(ProfileKind::kCircle, 150.0, side * 6.0, 0.0, 0.0, -700.0),
                      Point(300.0, -side * 3.0)});
    // Circle through three of its points, by their perpendicular bisectors.
    const auto point = [&](double at_m) { return Eigen::Vector2d(at_m, profile.At({at_m})->up_m); };
    const Eigen::Vector2d a = point(125.0);
    const Eigen::Vector2d b = point(150.0);
    const Eigen::Vector2d c = point(180.0);
    const double twice_area = (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
    const double radius_m =
        (a - b).norm() * (b - c).norm() * (c - a).norm() / (2.0 * std::abs(twice_area));
    EXPECT_NEAR(radius_m, 700.0, 1e-5);
    EXPECT_LT(side * twice_area, 0.0) << "crest when the gradient falls";
    // Tangent length on the slope: R tan(delta / 2).
    const double tangent_m = 700.0 * std::tan(0.5 * (std::atan(0.04) + std::atan(0.06)));
    const double first_m = 150.0 - tangent_m * std::cos(std::atan(0.04));
    EXPECT_NEAR(profile.At({first_m + 1e-7})->gradient, side * 0.04, 1e-9);
    EXPECT_NEAR(profile.At({first_m + 1e-7})->up_m, side * 0.04 * first_m, 1e-8);
    const double last_m = 150.0 + tangent_m * std::cos(std::atan(0.06));
    EXPECT_NEAR(profile.At({last_m - 1e-7})->gradient, -side * 0.06, 1e-9);
    const double bend = (profile.At({150.01})->gradient - profile.At({149.99})->gradient) / 0.02;
    EXPECT_NEAR(profile.At({150.0})->curvature_up_per_m, bend, 1e-9);
    EXPECT_LT(side * bend, 0.0);
    // Height as the integral of the gradient.
    double integral_m = 0.0;
    constexpr int kSteps = 4000;
    for (int i = 0; i < kSteps; ++i) {
      integral_m += profile.At({60.0 + (i + 0.5) * 150.0 / kSteps})->gradient * 150.0 / kSteps;
    }
    EXPECT_NEAR(point(210.0).y() - point(60.0).y(), integral_m, 1e-7);
  }
}

TEST(Chainage, ShortChainSkipsNumbersAndLongChainRepeatsThem) {
  const ChainageEquations equations({{{300.0}, 350.0, true, {}, 0}, {{650.0}, 680.0, true, {}, 0}});
  EXPECT_EQ(equations.ToOfficial({299.0}), (OfficialChainage{299.0, 0}));
  EXPECT_EQ(equations.ToOfficial({300.0}), (OfficialChainage{350.0, 1}));
  EXPECT_EQ(equations.ToOfficial({649.0}), (OfficialChainage{699.0, 1}));
  EXPECT_EQ(equations.ToOfficial({650.0}), (OfficialChainage{680.0, 2}));
  const auto places = [&](double official_m) {
    return equations.ToInternal(official_m, {0.0}, {1000.0});
  };
  EXPECT_TRUE(places(320.0).empty()) << "no such number on the wall";
  EXPECT_THAT(places(690.0),
              ::testing::ElementsAre(InternalChainage{640.0}, InternalChainage{660.0}));
  EXPECT_THAT(places(100.0), ::testing::ElementsAre(InternalChainage{100.0}));
  EXPECT_TRUE(places(-1.0).empty());
  EXPECT_EQ(equations.ToInternal({690.0, 2}), InternalChainage{660.0});
  EXPECT_EQ(equations.ToInternal({690.0, 0}), std::nullopt);
  EXPECT_EQ(equations.ToInternal({690.0, 3}), std::nullopt);
  for (double at_m = 0.0; at_m < 1000.0; at_m += 12.5) {
    EXPECT_EQ(equations.ToInternal(equations.ToOfficial({at_m})), InternalChainage{at_m});
  }
}

TEST(Chainage, MayCountDown) {
  const ChainageEquations equations({{{100.0}, 5000.0, false, {}, 0}});
  EXPECT_EQ(equations.ToOfficial({130.0}), (OfficialChainage{4970.0, 1}));
  EXPECT_EQ(equations.ToInternal({4970.0, 1}), InternalChainage{130.0});
  EXPECT_EQ(equations.ToInternal({5001.0, 1}), std::nullopt);
}

}  // namespace
}  // namespace tbm
