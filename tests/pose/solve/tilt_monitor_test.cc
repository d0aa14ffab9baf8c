#include "pose/solve/tilt_monitor.h"

#include <gtest/gtest.h>

#include "tests/pose/solve/tilt_story.h"

namespace tbm {
namespace {

using test::Body;
using test::CalibratedRig;
using test::Heard;
using test::Listen;
using test::Random;
using test::Story;

// 0.05 degree about one axis, within 200 frames: both inclinometers, both axes, knocked or
// creeping.
void ExpectFound(const Rig& rig, bool absolute_too, double outliers, int runs, Random& random) {
  for (const Body body : {Body::kCamera, Body::kTarget}) {
    for (const Eigen::Vector3d& axis : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 0, -1)}) {
      for (const int over_frames : {1, 100}) {
        for (int run = 0; run < runs; ++run) {
          Story story;
          story.body = body;
          story.turn_deg = 0.05 * axis;
          story.over_frames = over_frames;
          story.outliers = outliers;
          const Heard heard = Listen(rig, story, random);
          EXPECT_GE(heard.change_at, 300);
          EXPECT_LT(heard.change_at, 500);
          EXPECT_TRUE(heard.last.change->moved);
          EXPECT_TRUE(!absolute_too || heard.absolute_at >= 300);
        }
      }
    }
  }
}

TEST(TiltMonitor, FindsATwentiethOfADegreeWithinTwoHundredFrames) {
  Random random("TiltMonitor.FindsATwentiethOfADegreeWithinTwoHundredFrames");
  ExpectFound(test::FieldRig(), true, 0.0, 1, random);
}

TEST(TiltMonitor, FindsItUnderTheErrorsOfAFieldCalibrationAsAChange) {
  Random random("TiltMonitor.FindsItUnderTheErrorsOfAFieldCalibrationAsAChange");
  ExpectFound(CalibratedRig(), false, 0.0, 1, random);
}

TEST(TiltMonitor, FindsItAmongOutliers) {
  Random random("TiltMonitor.FindsItAmongOutliers");
  ExpectFound(CalibratedRig(), false, 0.1, 1, random);
}

TEST(TiltMonitor, HasTheSignsOfTheCamerasAxes) {
  Random random("TiltMonitor.HasTheSignsOfTheCamerasAxes");
  const Rig rig = test::FieldRig();
  for (const double sign : {1.0, -1.0}) {
    Story story;
    story.turn_deg = sign * Eigen::Vector3d(0.3, 0.0, 0.2);
    story.body = Body::kCamera;
    const Heard camera = Listen(rig, story, random);
    ASSERT_TRUE(camera.last.change);
    const MountingOffset& of_camera = *camera.last.change;
    EXPECT_NEAR(RadToDeg(of_camera.pitch_rad), sign * 0.3, 0.02);
    EXPECT_NEAR(RadToDeg(of_camera.roll_rad), sign * 0.2, 0.02);
    story.body = Body::kTarget;
    const Heard target = Listen(rig, story, random);
    ASSERT_TRUE(target.last.change);
    EXPECT_NEAR(RadToDeg(target.last.change->pitch_rad), -sign * 0.3, 0.02);
    EXPECT_NEAR(RadToDeg(target.last.change->roll_rad), -sign * 0.2, 0.02);
  }
}

TEST(TiltMonitor, IsSilentWhenAnLedIsCovered) {
  Random random("TiltMonitor.IsSilentWhenAnLedIsCovered");
  for (int run = 0; run < 5; ++run) {
    Story story;
    story.loses_led = true;
    const Heard heard = Listen(CalibratedRig(), story, random);
    EXPECT_EQ(heard.absolute_at, -1);
    EXPECT_EQ(heard.change_at, -1);
    // The calibration's errors no longer drop out, and the report knows.
    EXPECT_GT(RadToDeg(heard.last.change->pitch_sigma_rad), 0.02);
  }
}

TEST(TiltMonitor, SaysNothingOfFramesItCannotUse) {
  Random random("TiltMonitor.SaysNothingOfFramesItCannotUse");
  const Rig rig = CalibratedRig();
  TiltMonitor monitor(rig);
  const test::Drawn drawn = test::Draw(rig, 4.0, 4.0, random);
  const auto checked = CheckPose(drawn.problem, std::nullopt, std::nullopt);
  ASSERT_TRUE(checked);
  PoseProblem without_tilt = drawn.problem;
  without_tilt.camera_tilt.reset();
  CheckedPose two_leds = *checked;
  two_leds.leds_used = 0b11;
  for (int i = 0; i < 300; ++i) {
    monitor.Add(without_tilt, *checked);
    monitor.Add(drawn.problem, two_leds);
  }
  EXPECT_EQ(monitor.report().frames, 0);
  EXPECT_FALSE(monitor.report().absolute);
  EXPECT_FALSE(monitor.report().moved());
}

TEST(TiltMonitor, ForgetsWhenToldTo) {
  Random random("TiltMonitor.ForgetsWhenToldTo");
  const Rig rig = test::FieldRig();
  TiltMonitor monitor(rig, {20, 1});
  for (int i = 0; i < 60; ++i) {
    const test::Drawn drawn = test::Draw(rig, 4.0, 4.0, random);
    const auto checked = CheckPose(drawn.problem, std::nullopt, std::nullopt);
    if (checked) monitor.Add(drawn.problem, *checked);
  }
  EXPECT_TRUE(monitor.report().change);
  monitor.Restart();
  EXPECT_EQ(monitor.report().frames, 0);
  EXPECT_FALSE(monitor.report().absolute);
  EXPECT_FALSE(monitor.report().change);
}

}  // namespace
}  // namespace tbm
