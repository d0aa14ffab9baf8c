#include "guidance/shield/deviation.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "guidance/shield/attitude.h"
#include "pose/base/angle.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using test::Random;

constexpr double kPi = std::numbers::pi;

// x forward to the east, y left to the north, z up; then turned.
Rigid3 Shield(double heading_rad, double pitch_rad, double roll_rad) {
  const Eigen::Quaterniond heading = ExpRotation({0.0, 0.0, kPi / 2 - heading_rad});
  const Eigen::Quaterniond pitch =
      ExpRotation({0.0, -pitch_rad, 0.0});  // nose up is negative about y
  const Eigen::Quaterniond roll =
      ExpRotation({roll_rad, 0.0, 0.0});  // right side down is positive about x
  return {heading * pitch * roll, {0.0, 0.0, 0.0}};
}

TEST(Attitude, RaisedNoseIsPositivePitch) {
  const Rigid3 shield = Shield(1.0, 0.02, 0.0);
  EXPECT_GT((shield * Eigen::Vector3d(3.0, 0.0, 0.0)).z(), 0.0);
  EXPECT_NEAR(AttitudeOf(shield).pitch_rad, 0.02, 1e-12);
}

TEST(Attitude, RightSideDownIsPositiveRoll) {
  const Rigid3 shield = Shield(1.0, 0.0, 0.03);
  EXPECT_LT((shield * Eigen::Vector3d(0.0, -2.0, 0.0)).z(), 0.0);
  EXPECT_NEAR(AttitudeOf(shield).roll_rad, 0.03, 1e-12);
}

TEST(Attitude, HeadingPitchAndRollComeBack) {
  Random random("attitude_round_trip");
  for (int i = 0; i < 1000; ++i) {
    const double heading = random.Uniform(-kPi, kPi);
    const double pitch = random.Uniform(-0.6, 0.6);
    const double roll = random.Uniform(-0.5, 0.5);
    const Attitude attitude = AttitudeOf(Shield(heading, pitch, roll));
    EXPECT_NEAR(std::remainder(attitude.heading_rad - heading, 2 * kPi), 0.0, 1e-12);
    EXPECT_NEAR(attitude.pitch_rad, pitch, 1e-12);
    EXPECT_NEAR(attitude.roll_rad, roll, 1e-12);
  }
}

TEST(Articulation, FrontShieldThatLooksRightAndUp) {
  const Rigid3 site_from_rear = Shield(0.5, 0.01, 0.02);
  const Rigid3 site_from_front = Shield(0.53, 0.03, 0.02);
  const Articulation bend = ArticulationOf(Inverse(site_from_rear) * site_from_front);
  EXPECT_NEAR(bend.right_rad, 0.03, 1e-3);
  EXPECT_NEAR(bend.up_rad, 0.02, 1e-3);
}

TEST(Attitude, CovarianceIsWhatIsSeen) {
  Random random("attitude_covariance");
  UncertainRigid3 shield{Shield(2.2, 0.05, -0.1), PoseCovariance::Zero()};
  shield.covariance.topLeftCorner<3, 3>().diagonal() = Eigen::Vector3d(1e-8, 4e-8, 9e-8);
  shield.covariance(0, 2) = shield.covariance(2, 0) = 1e-8;
  const Eigen::Matrix3d root = shield.covariance.topLeftCorner<3, 3>().llt().matrixL();
  const Attitude middle = AttitudeOf(shield.b_from_a);
  Eigen::Matrix3d seen = Eigen::Matrix3d::Zero();
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) {
    PoseError e = PoseError::Zero();
    e.head<3>() = root * random.Normal3();
    const Attitude drawn = AttitudeOf(Moved(shield.b_from_a, e));
    const Eigen::Vector3d off(drawn.heading_rad - middle.heading_rad,
                              drawn.pitch_rad - middle.pitch_rad,
                              drawn.roll_rad - middle.roll_rad);
    seen += off * off.transpose() / kDraws;
  }
  EXPECT_LT((seen - CovarianceOfAttitude(shield)).norm() / seen.norm(), 0.03);
}

UncertainPoint Exactly(const Eigen::Vector3d& p) { return {p, Eigen::Matrix3d::Zero()}; }

// A curve to the right of 400 m radius from north, climbing at 2 %.
DesignAxis RightCurve() {
  AxisDescription description;
  CurveElement curve;
  curve.start = {1000.0, 2000.0};
  curve.centre = Eigen::Vector2d(1400.0, 2000.0);
  curve.end = {1400.0 - 400.0 * std::cos(0.8), 2000.0 + 400.0 * std::sin(0.8)};
  curve.turning = Turning::kRight;
  description.plan.push_back({curve, {}, 0});
  description.start = {500.0};
  description.profile.push_back({ProfileKind::kPoint, {500.0}, 30.0, 0.0, 0.0, 0.0, 0});
  description.profile.push_back({ProfileKind::kPoint, {820.0}, 36.4, 0.0, 0.0, 0.0, 0});
  return DesignAxis::Build(description).value();
}

// A point of the curve by the compass: `angle` from its start, then off to the right and up.
Eigen::Vector3d OnCurve(double angle_rad, double right_m, double up_m) {
  const double radius = 400.0 - right_m;
  return {1400.0 - radius * std::cos(angle_rad),
          2000.0 + radius * std::sin(angle_rad),
          30.0 + 0.02 * 400.0 * angle_rad + up_m};
}

TEST(Deviation, RightIsTowardsTheCentreOfARightCurve) {
  const DesignAxis axis = RightCurve();
  const auto deviation = DeviationOf(axis, Exactly(OnCurve(0.3, 0.05, -0.02)), {});
  ASSERT_TRUE(deviation);
  EXPECT_NEAR(deviation->right_m, 0.05, 1e-9);
  EXPECT_NEAR(*deviation->up_m, -0.02, 1e-9);
  EXPECT_NEAR(deviation->chainage.m, 500.0 + 400.0 * 0.3, 1e-8);
}

TEST(Deviation, SigmasAreWhatIsSeen) {
  const DesignAxis axis = RightCurve();
  Random random("deviation_sigma");
  UncertainPoint point = Exactly(OnCurve(0.4, 3.0, 2.0));
  point.covariance << 9e-6, 2e-6, 1e-6, 2e-6, 4e-6, -2e-6, 1e-6, -2e-6, 1e-5;
  const Eigen::Matrix3d root = point.covariance.llt().matrixL();
  const Deviation said = *DeviationOf(axis, point, {});
  Eigen::Vector3d seen = Eigen::Vector3d::Zero();
  double mixed = 0.0;
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) {
    const Deviation drawn = *DeviationOf(axis, Exactly(point.p + root * random.Normal3()), {});
    const Eigen::Vector3d off(
        drawn.chainage.m - said.chainage.m, drawn.right_m - said.right_m, *drawn.up_m - *said.up_m);
    seen += off.cwiseAbs2() / kDraws;
    mixed += off.y() * off.z() / kDraws;
  }
  EXPECT_NEAR(std::sqrt(seen[0]) / said.along_sigma_m, 1.0, 0.02);
  EXPECT_NEAR(std::sqrt(seen[1]) / said.right_sigma_m, 1.0, 0.02);
  EXPECT_NEAR(std::sqrt(seen[2]) / said.up_sigma_m, 1.0, 0.02);
  EXPECT_NEAR(mixed / std::sqrt(seen[1] * seen[2]), said.right_up_correlation, 0.02);
}

TEST(Deviation, WithoutAProfileThereIsNoHeight) {
  AxisDescription description;
  description.plan.push_back({LineElement{{0.0, 0.0}, {100.0, 0.0}}, {}, 0});
  const DesignAxis axis = DesignAxis::Build(description).value();
  const auto deviation =
      DeviationOf(axis, {{50.0, -0.03, 7.0}, 1e-6 * Eigen::Matrix3d::Identity()}, {});
  ASSERT_TRUE(deviation);
  EXPECT_NEAR(deviation->right_m, 0.03, 1e-12);
  EXPECT_FALSE(deviation->up_m);
  EXPECT_NEAR(deviation->up_sigma_m, 1e-3, 1e-12);
}

TEST(Deviation, OffTheEndsThereIsNone) {
  const DesignAxis axis = RightCurve();
  EXPECT_EQ(DeviationOf(axis, Exactly({1000.0, 1990.0, 30.0}), {}).error(),
            AxisFailure::kBeforeStart);
}

// Against the deviation itself: one shield length of a millimetre further on along its axis.
TEST(Lead, IsTheChangeOfTheDeviation) {
  const DesignAxis axis = RightCurve();
  for (const double heading_off : {-0.01, 0.0, 0.02}) {
    for (const double pitch_off : {-0.01, 0.0, 0.015}) {
      // Bearing of the axis at angle a is a; its slope angle is atan 0.02.
      Rigid3 shield = Shield(0.3 + heading_off, std::atan(0.02) + pitch_off, 0.04);
      shield.translation = OnCurve(0.3, 0.0, 0.0);
      const auto lead = LeadOf(axis, {shield, PoseCovariance::Zero()}, {});
      ASSERT_TRUE(lead);
      const Deviation here = *DeviationOf(axis, Exactly(shield.translation), {});
      const Deviation there =
          *DeviationOf(axis, Exactly(shield * Eigen::Vector3d(1e-3, 0.0, 0.0)), {});
      const double on = there.chainage.m - here.chainage.m;
      EXPECT_NEAR(lead->right_per_m, (there.right_m - here.right_m) / on, 3e-6);
      EXPECT_NEAR(*lead->up_per_m, (*there.up_m - *here.up_m) / on, 3e-6);
      EXPECT_EQ(lead->right_per_m > 1e-6, heading_off > 0.0);
    }
  }
}

TEST(Lead, SigmasAreThoseOfTheHeadingAndThePitch) {
  const DesignAxis axis = RightCurve();
  UncertainRigid3 shield{Shield(0.3, 0.02, 0.0), PoseCovariance::Zero()};
  shield.b_from_a.translation = OnCurve(0.3, 0.0, 0.0);
  shield.covariance.diagonal() << 4e-8, 4e-8, 1e-8, 1.0, 1.0, 1.0;
  const auto lead = LeadOf(axis, shield, {});
  ASSERT_TRUE(lead);
  EXPECT_NEAR(lead->right_sigma_per_m, 1e-4, 1e-6);
  EXPECT_NEAR(lead->up_sigma_per_m, 2e-4, 1e-6);
}

}  // namespace
}  // namespace tbm
