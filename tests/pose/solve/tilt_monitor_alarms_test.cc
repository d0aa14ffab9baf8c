#include <gtest/gtest.h>

#include "tests/pose/solve/tilt_story.h"

namespace tbm {
namespace {

using test::Body;
using test::Heard;
using test::Listen;
using test::Random;
using test::Story;

// Issue: at most 0.1 % false alarms in 200 frames. A run of 500 frames holds two such stretches in
// which the absolute test speaks and one in which the change does: none of 2400 may sound falsely,
// which a rate of 0.1 % would let pass once in eleven times, and a rate of 0.2 % once in a hundred.
int FalseAlarms(const Rig& rig, double outliers, Random& random) {
  int alarms = 0;
  for (int run = 0; run < 800; ++run) {
    Story story;
    story.outliers = outliers;
    const Heard heard = Listen(rig, story, random);
    alarms += (heard.absolute_at >= 0 ? 1 : 0) + (heard.change_at >= 0 ? 1 : 0);
  }
  return alarms;
}

TEST(TiltMonitorAlarms, NeverSoundsForSoundMountings) {
  Random random("TiltMonitorAlarms.NeverSoundsForSoundMountings");
  EXPECT_EQ(FalseAlarms(test::FieldRig(), 0.0, random), 0);
}

TEST(TiltMonitorAlarms, NeverSoundsForTheErrorsOfAFieldCalibrationOrOutliers) {
  Random random("TiltMonitorAlarms.NeverSoundsForTheErrorsOfAFieldCalibrationOrOutliers");
  EXPECT_EQ(FalseAlarms(test::CalibratedRig(), 0.05, random), 0);
}

// Pitch is what the image knows least: 0.05 degree is 10 sigma of the change.
TEST(TiltMonitorAlarms, MissNoPitchOfATwentiethOfADegree) {
  Random random("TiltMonitorAlarms.MissNoPitchOfATwentiethOfADegree");
  double sum_squared = 0.0;
  constexpr int kRuns = 150;
  for (int run = 0; run < kRuns; ++run) {
    Story story;
    story.body = run % 2 == 0 ? Body::kCamera : Body::kTarget;
    story.turn_deg.x() = run % 4 < 2 ? 0.05 : -0.05;
    story.over_frames = run % 3 == 0 ? 100 : 1;
    const Heard heard = Listen(test::CalibratedRig(), story, random);
    EXPECT_GE(heard.change_at, 300);
    ASSERT_TRUE(heard.last.change);
    const double sign = story.body == Body::kCamera ? 1.0 : -1.0;
    const double off_rad = heard.last.change->pitch_rad - sign * DegToRad(story.turn_deg.x());
    sum_squared += off_rad * off_rad / std::pow(heard.last.change->pitch_sigma_rad, 2);
  }
  // The stated sigma is the true one: chi-squared with 150 degrees of freedom, 4 sigma either way.
  EXPECT_NEAR(sum_squared / kRuns, 1.0, 4.0 * std::sqrt(2.0 / kRuns));
}

}  // namespace
}  // namespace tbm
