#include "pose/solve/start_pose.h"

#include <gtest/gtest.h>

#include "tests/pose/solve/placements.h"

namespace tbm::test {
namespace {

constexpr TruthRange kWide{2.5, 6.0, 0.3, 0.25, 0.4};

TEST(StartPose, IsExactForEverySignOfEveryTilt) {
  for (const Placement& at : EverySign()) {
    const auto starts = StartPose(ExactProblem(at.rig, at.truth));
    ASSERT_TRUE(starts) << at.name;
    ASSERT_EQ(starts->camera_from_target.size(), 1u);
    EXPECT_LT(TurnErrorDeg(starts->camera_from_target[0], at.truth), 1e-6) << at.name;
    EXPECT_LT(ShiftErrorMm(starts->camera_from_target[0], at.truth), 1e-4) << at.name;
  }
}

TEST(StartPoseLinear, IsExactForEverySignOfEveryTilt) {
  for (const Placement& at : EverySign()) {
    const auto start = StartPoseLinear(ExactProblem(at.rig, at.truth));
    ASSERT_TRUE(start) << at.name;
    EXPECT_LT(TurnErrorDeg(*start, at.truth), 1e-6) << at.name;
    EXPECT_LT(ShiftErrorMm(*start, at.truth), 1e-4) << at.name;
  }
}

// Both level frames are free about the vertical; yaw of any size must come out, not only small
// ones.
TEST(StartPose, FindsEveryYaw) {
  Random random("start yaw");
  const Rig rig = FieldRig();
  for (int i = 0; i < 500; ++i) {
    Truth truth = DrawTruth(random, kWide);
    // Pitched and turned at will; the tilt of the target stays within what its plate can read.
    const Eigen::AngleAxisd yaw(random.Uniform(-3.14, 3.14), truth.up_in_camera);
    truth.camera_from_target.rotation = yaw * truth.camera_from_target.rotation;
    const auto starts = StartPose(ExactProblem(rig, truth));
    ASSERT_TRUE(starts);
    EXPECT_LT(TurnErrorDeg(starts->camera_from_target[0], truth), 1e-6);
  }
}

// The circle alpha^2 + beta^2 = 1 keeps what the raw Eq. 14 loses: with every LED at one height
// nothing in the linear system holds alpha and beta away from zero.
TEST(StartPose, WorksWithAllLedsAtOneHeightWhereTheLinearFormCollapses) {
  Random random("one height");
  Rig rig = PublishedRig();
  rig.leds.clear();
  const Eigen::Vector3d p_in_target_m[4] = {
      {-0.25, 0.1, 0.1}, {0.25, 0.1, 0.1}, {0.0, 0.1, 0.0}, {0.08, 0.1, 0.25}};
  for (int i = 0; i < 4; ++i) rig.leds.push_back({std::to_string(i), p_in_target_m[i], 0.0});
  int collapsed = 0;
  for (int i = 0; i < 200; ++i) {
    // The target stands upright: its LEDs are at one height in the world, not only on the board.
    Truth truth = DrawTruth(random, {4.0, 4.0, 0.2, 0.0, 0.05});
    const Eigen::Vector3d up = truth.up_in_camera;
    const Eigen::Quaterniond upright =
        TurnBetween(truth.camera_from_target.rotation * Eigen::Vector3d::UnitY(), up);
    const Eigen::AngleAxisd yaw(random.Uniform(-0.1, 0.1), up);
    truth.camera_from_target.rotation = yaw * (upright * truth.camera_from_target.rotation);

    const auto exact = StartPose(ExactProblem(rig, truth));
    ASSERT_TRUE(exact);
    EXPECT_LT(TurnErrorDeg(exact->camera_from_target[0], truth), 1e-6);

    const PoseProblem noisy = NoisyProblem(rig, truth, 0.05, DegToRad(0.005), random);
    const auto start = StartPose(noisy);
    ASSERT_TRUE(start);
    EXPECT_LT(TurnErrorDeg(start->camera_from_target[0], truth), 1.0);
    EXPECT_LT(ShiftErrorMm(start->camera_from_target[0], truth), 30.0);
    const auto linear = StartPoseLinear(noisy);
    const bool is_lost =
        !linear || TurnErrorDeg(*linear, truth) > 5.0 || ShiftErrorMm(*linear, truth) > 500.0;
    collapsed += is_lost ? 1 : 0;
  }
  EXPECT_GT(collapsed, 180);
}

TEST(StartPose, IsGoodEnoughToStartFromUnderNoise) {
  Random random("start noise");
  const Rig rig = FieldRig();
  for (int i = 0; i < 2000; ++i) {
    const Truth truth = DrawTruth(random, kWide);
    const auto starts = StartPose(NoisyProblem(rig, truth, 0.5, DegToRad(0.02), random));
    ASSERT_TRUE(starts);
    EXPECT_LT(TurnErrorDeg(starts->camera_from_target[0], truth), 3.0);
    EXPECT_LT(ShiftErrorMm(starts->camera_from_target[0], truth),
              20.0 * truth.camera_from_target.translation.z());
  }
}

TEST(StartPose, NeedsBothTiltsAndTwoLeds) {
  Random random("start needs");
  const Rig rig = FieldRig();
  const Truth truth = DrawTruth(random, kWide);
  PoseProblem problem = ExactProblem(rig, truth);
  problem.leds.resize(1);
  EXPECT_EQ(StartPose(problem).error(), PoseFailure::kTooFewLeds);
  problem = ExactProblem(rig, truth);
  problem.leds.resize(2);
  EXPECT_EQ(StartPoseLinear(problem).error(), PoseFailure::kTooFewLeds);
  problem = ExactProblem(rig, truth);
  problem.camera_tilt.reset();
  EXPECT_EQ(StartPose(problem).error(), PoseFailure::kNotObservable);
  EXPECT_EQ(StartPoseLinear(problem).error(), PoseFailure::kNotObservable);
  problem = ExactProblem(rig, truth);
  for (LedObservation& led : problem.leds) led.pixel_px = problem.leds[0].pixel_px;
  EXPECT_EQ(StartPose(problem).error(), PoseFailure::kNotObservable);
}

// Seen through a point-reflected image the same board would stand behind the lens.
TEST(StartPose, RefusesABoardBehindTheCamera) {
  const Rig rig = PublishedRig();
  Truth truth;
  truth.camera_from_target.rotation = Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);
  truth.camera_from_target.translation = {0.0, 0.0, 4.0};
  PoseProblem problem = ExactProblem(rig, truth);
  const Eigen::Vector2d centre(rig.camera.cx_px, rig.camera.cy_px);
  for (LedObservation& led : problem.leds) led.pixel_px = 2.0 * centre - led.pixel_px;
  const auto starts = StartPose(problem);
  ASSERT_FALSE(starts);
  EXPECT_EQ(starts.error(), PoseFailure::kBehindCamera);
}

}  // namespace
}  // namespace tbm::test
