#include "pose/calibrate/target_calibration.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"

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
  for (TargetPlacement& placement : workshop.placements) placement.sigma_m = 0.25e-4;
  const auto scaled = CalibrateTarget(workshop.nominal_m, workshop.placements);
  ASSERT_TRUE(scaled) << "no single point is to blame";
  EXPECT_NEAR(scaled->sigma_factor, 4.0, 1.0);
  EXPECT_NEAR(scaled->led_sigma_m[2] / honest->led_sigma_m[2], 1.0, 0.3);
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
    EXPECT_EQ(found.error().led, led);
    EXPECT_EQ(found.error().placement, placement);
    EXPECT_FALSE(found.error().or_placement);
    EXPECT_NEAR(found.error().off_m, 0.002, 0.0006);
  }
  // Metres away it is seen before any adjustment.
  Workshop far(41);
  *far.placements[1].led_in_site_m[4] += Eigen::Vector3d(0.0, 0.0, 1.5);
  auto found = CalibrateTarget(far.nominal_m, far.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kDoesNotFit);
  EXPECT_EQ(found.error().led, 4u);
  EXPECT_EQ(found.error().placement, 1u);
  EXPECT_NEAR(found.error().off_m, 1.5, 0.01);
  // Of two placements nobody can tell which one is right.
  Workshop two(42, 2);
  *two.placements[1].led_in_site_m[2] += Eigen::Vector3d(0.0, 0.003, 0.0);
  found = CalibrateTarget(two.nominal_m, two.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().led, 2u);
  ASSERT_TRUE(found.error().or_placement);
  EXPECT_EQ(found.error().placement + *found.error().or_placement, 1u);
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
