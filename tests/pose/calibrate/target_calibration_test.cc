#include "pose/calibrate/target_calibration.h"

#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Geometry>
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
  EXPECT_EQ(found->mounting_missing, TiltRotationFault::kTooFew);
  const Workshop level(5, 4, 0.01);
  const auto flat = CalibrateTarget(level.nominal_m, level.placements);
  ASSERT_TRUE(flat);
  EXPECT_EQ(flat->mounting_missing, TiltRotationFault::kNoTilt);
}

TEST(TargetCalibration, AWrongPointIsNamed) {
  Workshop workshop(6);
  *workshop.placements[2].led_in_site_m[3] += Eigen::Vector3d(0.0, 0.002, 0.0);
  const auto found = CalibrateTarget(workshop.nominal_m, workshop.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kDoesNotFit);
  EXPECT_EQ(found.error().led, 3u);
  EXPECT_EQ(found.error().placement, 2u);
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
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kTooFewLeds);
  EXPECT_EQ(found.error().led, 4u);

  Workshop swapped(9);
  std::swap(swapped.placements[0].led_in_site_m[0], swapped.placements[0].led_in_site_m[4]);
  found = CalibrateTarget(swapped.nominal_m, swapped.placements);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TargetCalibrationFault::kOtherBoard);

  Workshop line(10, 2);
  for (TargetPlacement& placement : line.placements) {
    for (std::size_t j : {0u, 1u, 3u}) placement.led_in_site_m[j].reset();
  }
  line.placements[0].led_in_site_m[0] = line.placements[0].led_in_site_m[2];
  found = CalibrateTarget(line.nominal_m, line.placements);
  ASSERT_FALSE(found);
}

}  // namespace
}  // namespace tbm
