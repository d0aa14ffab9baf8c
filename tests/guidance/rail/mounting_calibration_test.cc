#include "guidance/rail/mounting_calibration.h"

#include <cmath>
#include <random>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/rail_study/rail_scene.h"
#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

using ::testing::Contains;

RailScene Scene(std::uint64_t seed, double turns_deg) {
  RailScene scene;
  scene.seed = seed;
  scene.has_spread_targets = true;
  scene.turns_deg = turns_deg;
  scene.speed_m_s = 0.1;
  scene.image_late_s = 0.005;
  return scene;
}

// The first guess is about a degree, three centimetres and six milliseconds from the truth, and
// nobody knows well where the unit stands: turning alone tells the lever arm.
GeneratedRun Spoilt(const RailScene& scene) {
  GeneratedRun run = GenerateRail(scene);
  std::mt19937_64 random(500 + scene.seed);
  std::normal_distribution<double> normal;
  const auto draw3 = [&](double sigma) {
    return Eigen::Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  RailCamera& camera = *run.setup.camera;
  camera.camera_from_imu = ExpRotation(draw3(DegToRad(0.6))) * run.camera_from_imu;
  camera.in_imu_m = run.camera_in_imu_m + draw3(0.02);
  camera.time_offset_s = -scene.image_late_s + 0.006 * normal(random);
  run.setup.start.sigma_position_m = 0.02;
  run.setup.start.position_world_m += draw3(0.02);
  return run;
}

struct Tally {
  double nees = 0.0;  // over its size
  double most_turn_deg = 0.0;
  double most_off_mm = 0.0;
  double most_late_ms = 0.0;
  std::size_t gone = 0;
};

void Add(const GeneratedRun& run, const MountingCalibration& found, Tally* tally) {
  const Eigen::Vector3d turn_rad =
      LogRotation(run.camera_from_imu * found.camera_from_imu.conjugate());
  const Eigen::Vector3d off_m = run.camera_in_imu_m - found.camera_in_imu_m;
  const double late_s = -0.005 - found.time_offset_s;
  Eigen::Matrix<double, 13, 1> error;
  error << run.gyro_bias_rad_s - found.gyro_bias_rad_s, run.accel_bias_m_s2 - found.accel_bias_m_s2,
      late_s, turn_rad, off_m;
  tally->nees += error.dot(found.covariance.llt().solve(error)) / 13.0;
  tally->most_turn_deg = std::max(tally->most_turn_deg, RadToDeg(turn_rad.norm()));
  tally->most_off_mm = std::max(tally->most_off_mm, 1e3 * off_m.norm());
  tally->most_late_ms = std::max(tally->most_late_ms, 1e3 * std::abs(late_s));
  tally->gone += found.points_left_out;
}

TEST(MountingCalibration, FindsItWithItsCovariance) {
  constexpr int kSeeds = 8;
  Tally tally;
  double chi2 = 0.0;
  double dof = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const GeneratedRun run = Spoilt(Scene(seed, 10.0));
    const auto found = CalibrateMounting(run.setup, run.recording, {});
    ASSERT_TRUE(found) << "seed " << seed << " fault " << static_cast<int>(found.error().fault);
    Add(run, *found, &tally);
    chi2 += found->chi2;
    dof += found->dof;
    EXPECT_LE(found->rounds, 24);
  }
  std::printf("at most %.4f deg, %.2f mm, %.2f ms off; NEES over its size %.2f; chi2 %.4f\n",
              tally.most_turn_deg,
              tally.most_off_mm,
              tally.most_late_ms,
              tally.nees / kSeeds,
              chi2 / dof);
  EXPECT_LT(tally.most_turn_deg, 0.05);
  EXPECT_LT(tally.most_off_mm, 18.0);
  EXPECT_LT(tally.most_late_ms, 1.0);
  EXPECT_LT(tally.gone, 8u * 4u);
  // Chi-squared with 104 degrees of freedom: 95 % lie in 0.74..1.29. Over 48 runs it is 1.03.
  EXPECT_GT(tally.nees / kSeeds, 0.7);
  EXPECT_LT(tally.nees / kSeeds, 1.29);
  EXPECT_NEAR(chi2 / dof, 1.0, 0.02);
}

TEST(MountingCalibration, WrongMatchesAreLeftOut) {
  RailScene scene = Scene(20, 10.0);
  scene.wrong_matches = 0.02;
  const GeneratedRun run = Spoilt(scene);
  const auto found = CalibrateMounting(run.setup, run.recording, {});
  ASSERT_TRUE(found) << static_cast<int>(found.error().fault);
  Tally tally;
  Add(run, *found, &tally);
  EXPECT_GT(tally.gone, found->points / 70);
  EXPECT_LT(tally.gone, found->points / 40);
  EXPECT_LT(tally.most_turn_deg, 0.05);
  EXPECT_LT(tally.nees, 2.5);
}

TEST(MountingCalibration, ARunWithoutTurnsIsRefusedWithTheMotionThatIsMissing) {
  const GeneratedRun run = Spoilt(Scene(3, 0.0));
  const auto found = CalibrateMounting(run.setup, run.recording, {});
  ASSERT_FALSE(found);
  ASSERT_EQ(found.error().fault, MountingFault::kDegenerate);
  EXPECT_THAT(found.error().weak, Contains(MountingWeakness::kPosition));
}

TEST(MountingCalibration, WhatCannotBeUsedIsSaid) {
  const GeneratedRun run = GenerateRail(Scene(4, 6.0));
  GeneratedRun moving = run;
  moving.setup.start.at_rest_s = 14.0;
  const auto moves = CalibrateMounting(moving.setup, moving.recording, {});
  ASSERT_FALSE(moves);
  EXPECT_EQ(moves.error().fault, MountingFault::kStart);
  EXPECT_EQ(moves.error().start.fault, RailStartFault::kMovesAtStart);

  GeneratedRun blind = run;
  blind.recording.images.resize(5);
  const auto few = CalibrateMounting(blind.setup, blind.recording, {});
  ASSERT_FALSE(few);
  EXPECT_EQ(few.error().fault, MountingFault::kTooFewImages);

  GeneratedRun none = run;
  none.setup.camera.reset();
  none.setup.start.heading_rad = -DegToRad(90.0);
  none.setup.start.sigma_heading_rad = 1e-3;
  const auto without = CalibrateMounting(none.setup, none.recording, {});
  ASSERT_FALSE(without);
  EXPECT_EQ(without.error().fault, MountingFault::kNoCamera);

  // Half of the targets are not where the survey has them.
  GeneratedRun elsewhere = run;
  for (std::size_t i = 0; i < elsewhere.recording.targets.size(); i += 2) {
    elsewhere.recording.targets[i].in_world_m.x() += 0.01;
  }
  const auto off = CalibrateMounting(elsewhere.setup, elsewhere.recording, {});
  ASSERT_FALSE(off);
  EXPECT_EQ(off.error().fault, MountingFault::kDoesNotFit);
}

}  // namespace
}  // namespace tbm
