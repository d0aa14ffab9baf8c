#include "pose/calibrate/target_calibration.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

// The LEDs of the pose paper's Table 1 and what was really built.
struct Workshop {
  std::vector<Eigen::Vector3d> nominal_m = {
      {-0.3, 0.2, 0.0}, {0.3, 0.2, 0.0}, {-0.3, -0.2, 0.0}, {0.3, -0.2, 0.0}, {0.0, 0.0, 0.3}};
  std::vector<Eigen::Vector3d> built_m;
  Eigen::Matrix3d housing_from_target;
  std::vector<TargetPlacement> placements;
  double sigma_m = 1e-4;

  explicit Workshop(unsigned seed, int count = 5, double tilt_deg = 8.0) : engine_(seed) {
    housing_from_target =
        Eigen::AngleAxisd(0.02, Eigen::Vector3d(0.4, -0.5, 0.8).normalized()).toRotationMatrix();
    for (const Eigen::Vector3d& led : nominal_m) built_m.push_back(led + Normal3(1e-3));
    Place(count, tilt_deg);
  }

  void Place(int count, double tilt_deg) {
    for (int i = 0; i < count; ++i) {
      const Eigen::Matrix3d site_from_target =
          (Eigen::AngleAxisd(Normal(1.0), Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(DegToRad(Normal(tilt_deg)), Eigen::Vector3d::UnitX()) *
           Eigen::AngleAxisd(DegToRad(Normal(tilt_deg)), Eigen::Vector3d::UnitY()))
              .toRotationMatrix();
      const Eigen::Vector3d origin_m = Eigen::Vector3d(1000.0, 5000.0, 100.0) + Normal3(2.0);
      TargetPlacement placement;
      placement.sigma_m = sigma_m;
      placement.tilt_sigma_rad = DegToRad(0.005);
      for (const Eigen::Vector3d& led : built_m) {
        placement.led_in_site_m.emplace_back(site_from_target * led + origin_m + Normal3(sigma_m));
      }
      const Eigen::Vector3d up =
          housing_from_target * site_from_target.transpose() * Eigen::Vector3d::UnitZ();
      const double x = up.x() + Normal(placement.tilt_sigma_rad);
      const double y = up.y() + Normal(placement.tilt_sigma_rad);
      placement.up_in_housing = {x, y, std::sqrt(1.0 - x * x - y * y)};
      placements.push_back(placement);
    }
  }

  double Normal(double sigma) { return sigma * normal_(engine_); }
  Eigen::Vector3d Normal3(double sigma) { return {Normal(sigma), Normal(sigma), Normal(sigma)}; }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

// Distances do not know of frames.
double WorstDistance_m(const std::vector<Eigen::Vector3d>& a,
                       const std::vector<Eigen::Vector3d>& b) {
  double worst = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      worst = std::max(worst, std::abs((a[i] - a[j]).norm() - (b[i] - b[j]).norm()));
    }
  }
  return worst;
}

TEST(TargetCalibration, FindsWhatWasBuiltAndHowTheInclinometerSits) {
  double chi2 = 0.0;
  double dof = 0.0;
  double mounting = 0.0;
  constexpr int kDraws = 40;
  for (unsigned seed = 1; seed <= kDraws; ++seed) {
    const Workshop workshop(seed);
    const auto found = CalibrateTarget(workshop.nominal_m, workshop.placements);
    ASSERT_TRUE(found) << seed;
    EXPECT_LT(WorstDistance_m(found->led_in_target_m, workshop.built_m), 4e-4) << seed;
    for (const double sigma_m : found->led_sigma_m) {
      EXPECT_GT(sigma_m, 2e-5);
      EXPECT_LT(sigma_m, 1e-4);
    }
    chi2 += found->chi2;
    dof += found->dof;
    ASSERT_TRUE(found->housing_from_target) << seed;
    // The built board lies in the nominal frame only as well as it fits it: a degree in a thousand.
    const Eigen::AngleAxisd off(
        Eigen::Matrix3d(*found->housing_from_target * workshop.housing_from_target.transpose()));
    mounting += off.angle() * off.angle() / kDraws;
  }
  EXPECT_NEAR(chi2 / dof, 1.0, 0.1);
  EXPECT_LT(RadToDeg(std::sqrt(mounting)), 0.25);
}

TEST(TargetCalibration, TheFrameIsThatOfTheDrawing) {
  const Workshop workshop(3);
  const auto found = CalibrateTarget(workshop.nominal_m, workshop.placements);
  ASSERT_TRUE(found);
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& led : workshop.nominal_m) mean += led / 5.0;
  for (std::size_t i = 0; i < 5; ++i) {
    const Eigen::Vector3d off = found->led_in_target_m[i] - workshop.nominal_m[i];
    shift += off;
    turn += (workshop.nominal_m[i] - mean).cross(off);
  }
  EXPECT_LT(shift.norm(), 1e-9);
  EXPECT_LT(turn.norm(), 1e-9);
}

TEST(TargetCalibration, OnePlacementGivesTheLedsAndSaysWhyNotTheMounting) {
  const Workshop workshop(4, 1);
  const auto found = CalibrateTarget(workshop.nominal_m, workshop.placements);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->dof, 0);
  EXPECT_FALSE(found->housing_from_target);
  EXPECT_EQ(found->mounting_missing->fault, TiltRotationFault::kTooFew);
  const Workshop level(5, 4, 0.01);
  const auto flat = CalibrateTarget(level.nominal_m, level.placements);
  ASSERT_TRUE(flat);
  EXPECT_EQ(flat->mounting_missing->fault, TiltRotationFault::kNoTilt);
}

// Built as drawn, so that the frame of the LEDs is the drawing's and the true mounting is known in
// it.
TEST(TargetCalibration, SigmasAreWhatTheErrorsAre) {
  constexpr int kDraws = 300;
  double led = 0.0;
  double mounting = 0.0;
  for (unsigned seed = 1; seed <= kDraws; ++seed) {
    Workshop exact(seed + 1000, 0);
    exact.built_m = exact.nominal_m;
    exact.Place(6, 8.0);
    const auto found = CalibrateTarget(exact.nominal_m, exact.placements);
    ASSERT_TRUE(found) << seed;
    for (std::size_t j = 0; j < 5; ++j) {
      led +=
          ((found->led_in_target_m[j] - exact.nominal_m[j]) / found->led_sigma_m[j]).squaredNorm() /
          (15.0 * kDraws);
    }
    const Eigen::AngleAxisd off(
        Eigen::Matrix3d(exact.housing_from_target.transpose() * *found->housing_from_target));
    const Eigen::Vector3d e = off.angle() * off.axis();
    mounting += e.dot(found->mounting_covariance.inverse() * e) / (3.0 * kDraws);
  }
  EXPECT_NEAR(led, 1.0, 0.1);
  EXPECT_NEAR(mounting, 1.0, 0.15);
}

TEST(TargetCalibration, PointsThatScatterMoreThanDeclaredMakeEverySigmaLarger) {
  Workshop workshop(11, 6);
  const auto honest = CalibrateTarget(workshop.nominal_m, workshop.placements);
  ASSERT_TRUE(honest);
  EXPECT_EQ(honest->sigma_factor, 1.0);
  for (TargetPlacement& placement : workshop.placements) placement.sigma_m = 0.45e-4;
  const auto scaled = CalibrateTarget(workshop.nominal_m, workshop.placements);
  ASSERT_TRUE(scaled) << "no single point is to blame";
  EXPECT_NEAR(scaled->sigma_factor, 2.2, 0.6);
  EXPECT_NEAR(scaled->led_sigma_m[2] / honest->led_sigma_m[2], 1.0, 0.3);
  // More than three times is another total station than the one that was declared.
  for (TargetPlacement& placement : workshop.placements) placement.sigma_m = 0.25e-4;
  const auto refused = CalibrateTarget(workshop.nominal_m, workshop.placements);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, TargetCalibrationFault::kScatters);
  EXPECT_NEAR(refused.error().sigma_factor, 4.0, 1.0);
  ASSERT_EQ(refused.error().wrong.size(), 1u) << "the worst, to look at";
  EXPECT_GT(refused.error().wrong[0].off_m, 1e-4);
}

TEST(TargetCalibration, HonestScatterBlamesNobody) {
  int taken = 0;
  constexpr int kDraws = 100;
  for (unsigned seed = 1; seed <= kDraws; ++seed) {
    Workshop workshop(seed + 2000, seed % 2 == 0 ? 6 : 3);
    for (TargetPlacement& placement : workshop.placements) {
      placement.sigma_m = seed % 4 < 2 ? 1e-4 : 0.5e-4;
    }
    const auto found = CalibrateTarget(workshop.nominal_m, workshop.placements);
    taken += found ? 1 : 0;
    EXPECT_TRUE(found || seed % 4 >= 2) << seed << ": scatters as declared";
  }
  EXPECT_GE(taken, kDraws - 5) << "twice as much as declared";
}

TEST(TargetCalibration, SeveralWrongPointsDoNotHideOneAnother) {
  test::Random random("several wrong points");
  for (const int count : {2, 3, 4}) {
    for (const double off_m : {0.002, 0.015}) {
      for (unsigned draw = 0; draw < 20; ++draw) {
        SCOPED_TRACE(testing::Message() << count << " by " << off_m << " m, draw " << draw);
        Workshop workshop(draw + 3000, 6);
        std::set<std::pair<std::size_t, std::size_t>> wrong;
        while (static_cast<int>(wrong.size()) < count) {
          const auto placement = static_cast<std::size_t>(random.Index(6));
          const auto led = static_cast<std::size_t>(random.Index(5));
          const bool has_one = std::any_of(
              wrong.begin(), wrong.end(), [&](const auto& one) { return one.first == placement; });
          // Two in a placement are now and then explained by another in it, which is named.
          if (has_one || !wrong.emplace(placement, led).second) continue;
          *workshop.placements[placement].led_in_site_m[led] +=
              off_m * random.Normal3().normalized();
        }
        const auto found = CalibrateTarget(workshop.nominal_m, workshop.placements);
        ASSERT_FALSE(found);
        ASSERT_EQ(found.error().fault, TargetCalibrationFault::kDoesNotFit);
        std::set<std::pair<std::size_t, std::size_t>> named;
        for (const WrongTargetPoint& one : found.error().wrong) {
          named.emplace(one.point.placement, one.point.led);
          EXPECT_NEAR(one.off_m, off_m, 0.0008);
        }
        EXPECT_EQ(named, wrong);
      }
    }
  }
}

// Three LEDs control one another along their plane, and nothing does across it.
TEST(TargetCalibration, ABoardOfThreeLedsIsControlledInItsPlane) {
  for (unsigned draw = 0; draw < 20; ++draw) {
    SCOPED_TRACE(draw);
    Workshop workshop(draw + 4000, 0);
    workshop.nominal_m.resize(3);
    workshop.built_m.resize(3);
    workshop.Place(6, 8.0);
    auto found = CalibrateTarget(workshop.nominal_m, workshop.placements);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->dof, 3 * 5);
    for (const TargetSighting& sighting : found->sightings) EXPECT_EQ(sighting.controlled, 2);
    // Away from the LED across the board, so that both distances change.
    auto& led = *workshop.placements[2].led_in_site_m[0];
    led += 0.002 * (led - *workshop.placements[2].led_in_site_m[1]).normalized();
    led += 0.002 * (led - *workshop.placements[2].led_in_site_m[2]).normalized();
    found = CalibrateTarget(workshop.nominal_m, workshop.placements);
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().fault, TargetCalibrationFault::kDoesNotFit);
    ASSERT_EQ(found.error().wrong.size(), 1u);
    EXPECT_EQ(found.error().wrong[0].point.placement, 2u);
    EXPECT_EQ(found.error().wrong[0].point.led, 0u);
    EXPECT_NEAR(found.error().wrong[0].off_m, 0.0028, 0.0006);
  }
}

TEST(TargetCalibration, AWrongPointIsNamedWithItsPlacementAndSize) {
  for (unsigned seed = 20; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    Workshop workshop(seed);
    const auto led = static_cast<std::size_t>(seed % 5);
    const auto placement = static_cast<std::size_t>(seed / 5 % 5);
    *workshop.placements[placement].led_in_site_m[led] += Eigen::Vector3d(0.0, 0.002, 0.0);
    const auto found = CalibrateTarget(workshop.nominal_m, workshop.placements);
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().fault, TargetCalibrationFault::kDoesNotFit);
    ASSERT_EQ(found.error().wrong.size(), 1u);
    const WrongTargetPoint& wrong = found.error().wrong[0];
    EXPECT_EQ(wrong.point.led, led);
    EXPECT_EQ(wrong.point.placement, placement);
    EXPECT_TRUE(wrong.or_rather.empty());
    EXPECT_NEAR(wrong.off_m, 0.002, 0.0006);
  }
  // Metres away it is seen before any adjustment.
  Workshop far(41);
  *far.placements[1].led_in_site_m[4] += Eigen::Vector3d(0.0, 0.0, 1.5);
  auto found = CalibrateTarget(far.nominal_m, far.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kDoesNotFit);
  ASSERT_EQ(found.error().wrong.size(), 1u);
  EXPECT_EQ(found.error().wrong[0].point.led, 4u);
  EXPECT_EQ(found.error().wrong[0].point.placement, 1u);
  EXPECT_NEAR(found.error().wrong[0].off_m, 1.5, 0.01);
  // Of two placements nobody can tell which one is right.
  Workshop two(42, 2);
  *two.placements[1].led_in_site_m[2] += Eigen::Vector3d(0.0, 0.003, 0.0);
  found = CalibrateTarget(two.nominal_m, two.placements);
  ASSERT_FALSE(found);
  ASSERT_EQ(found.error().wrong.size(), 1u);
  const WrongTargetPoint& either = found.error().wrong[0];
  EXPECT_EQ(either.point.led, 2u);
  ASSERT_EQ(either.or_rather.size(), 1u);
  EXPECT_EQ(either.or_rather[0].led, 2u);
  EXPECT_EQ(either.point.placement + either.or_rather[0].placement, 1u);
}

TEST(TargetCalibration, AWrongReadingIsNamedByItsPlacement) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Workshop workshop(seed + 5000, 6);
    workshop.placements[1].up_in_housing.reset();
    Eigen::Vector3d& up = *workshop.placements[4].up_in_housing;
    up = (up + Eigen::Vector3d(DegToRad(0.4), 0.0, 0.0)).normalized();
    const auto found = CalibrateTarget(workshop.nominal_m, workshop.placements);
    ASSERT_TRUE(found) << "the LEDs are good";
    EXPECT_FALSE(found->housing_from_target);
    ASSERT_TRUE(found->mounting_missing);
    EXPECT_EQ(found->mounting_missing->fault, TiltRotationFault::kDoesNotFit) << seed;
    ASSERT_EQ(found->mounting_missing->wrong.size(), 1u);
    EXPECT_EQ(found->mounting_missing->wrong[0].placement, 4u);
    EXPECT_NEAR(RadToDeg(found->mounting_missing->wrong[0].off_rad), 0.4, 0.1);
  }
}

TEST(TargetCalibration, NamesThatWereExchangedAreFound) {
  Workshop swapped(9);
  std::swap(swapped.placements[1].led_in_site_m[0], swapped.placements[1].led_in_site_m[4]);
  auto found = CalibrateTarget(swapped.nominal_m, swapped.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kExchanged);
  EXPECT_EQ(found.error().placement, 1u);
  EXPECT_THAT(found.error().really, ::testing::ElementsAre(4u, 1u, 2u, 3u, 0u));

  Workshop turned(10);
  auto& points = turned.placements[0].led_in_site_m;
  const auto first = points[0];
  points[0] = points[1];  // the point named P1 is P2, ..
  points[1] = points[4];
  points[4] = first;
  found = CalibrateTarget(turned.nominal_m, turned.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kExchanged);
  EXPECT_THAT(found.error().really, ::testing::ElementsAre(1u, 4u, 2u, 3u, 0u));
}

TEST(TargetCalibration, RefusesWhatIsTooLittleOrAnotherBoard) {
  Workshop few(7);
  for (std::size_t j = 0; j < 3; ++j) few.placements[1].led_in_site_m[j].reset();
  auto found = CalibrateTarget(few.nominal_m, few.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kTooFewLeds);
  EXPECT_EQ(found.error().placement, 1u);

  Workshop never(8);
  for (TargetPlacement& placement : never.placements) placement.led_in_site_m[4].reset();
  found = CalibrateTarget(never.nominal_m, never.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kNeverMeasured);
  EXPECT_EQ(found.error().led, 4u);

  Workshop line(10, 2);
  line.nominal_m[1] = {0.0, 0.002, 0.0};  // with the first and the last corner on one line
  line.nominal_m[0] = {-0.3, 0.2, 0.0};
  line.nominal_m[3] = {0.3, -0.2, 0.0};
  for (TargetPlacement& placement : line.placements) {
    for (const std::size_t j : {2u, 4u}) placement.led_in_site_m[j].reset();
  }
  found = CalibrateTarget(line.nominal_m, line.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kOnOneLine);

  // East and north in each other's column.
  Workshop mirrored(12, 2);
  for (auto& led : mirrored.placements[1].led_in_site_m) std::swap(led->x(), led->y());
  found = CalibrateTarget(mirrored.nominal_m, mirrored.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kMirrored);
  EXPECT_EQ(found.error().placement, 1u);

  // Millimetres taken for metres.
  Workshop scaled(13, 2);
  for (auto& led : scaled.placements[0].led_in_site_m) *led *= 1e-3;
  found = CalibrateTarget(scaled.nominal_m, scaled.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kOtherBoard);
  EXPECT_NEAR(found.error().scale, 1e-3, 1e-4);
  EXPECT_GT(found.error().off_m, 0.3);
}

}  // namespace
}  // namespace tbm
