#include "pose/solve/penalty_pose.h"

#include <cmath>

#include <gtest/gtest.h>

#include "pose/solve/solve_pose.h"
#include "tests/pose/solve/independent_bound.h"
#include "tests/pose/solve/placements.h"

namespace tbm::test {
namespace {

TEST(PenaltyPose, IsExactForEverySignOfEveryTilt) {
  const std::vector<Placement> placements = EverySign();
  for (std::size_t i = 0; i < placements.size(); i += 7) {
    const Placement& at = placements[i];
    const PoseResult result = PenaltyPose(ExactProblem(at.rig, at.truth));
    ASSERT_TRUE(result) << at.name;
    EXPECT_LT(TurnErrorDeg(result->camera_from_target, at.truth), 1e-6) << at.name;
    EXPECT_LT(ShiftErrorMm(result->camera_from_target, at.truth), 1e-4) << at.name;
    EXPECT_TRUE(std::isnan(result->chi2));
  }
}

// Yaw of the target against the camera about the vertical: kappa of R^c in Eq. 5.
double RelativeYawDeg(const Rigid3& pose, const Truth& truth) {
  const Rigid3 facing{Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0), {}};
  const Eigen::Vector3d ahead_of_target =
      pose.rotation * (facing.rotation.conjugate() * Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d up = truth.up_in_camera;
  const Eigen::Vector3d right = -up.cross(Eigen::Vector3d::UnitZ()).normalized();
  const Eigen::Vector3d ahead = up.cross(right).normalized();
  return RadToDeg(std::atan2(ahead_of_target.dot(right), std::abs(ahead_of_target.dot(ahead))));
}

// k8 as it is printed asks cos^2 + cos^2 = 1 of the yaw.
TEST(PenaltyPose, K8AsPrintedDrivesTheRelativeYawTo45Degrees) {
  Random random("printed k8");
  const Rig rig = PublishedRig();
  SolveOptions no_gate;
  no_gate.max_sigma_rotation_rad = no_gate.max_sigma_translation_m = 1e6;
  for (int i = 0; i < 20; ++i) {
    // Level camera, upright target: the relative yaw of the level frames is that of the bodies.
    Truth truth;
    const double yaw_deg = random.Uniform(-5.0, 5.0);
    truth.camera_from_target.rotation =
        Eigen::Quaterniond(TurnDeg(0, yaw_deg, 0)) * Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);
    truth.camera_from_target.translation = {0.1, -0.1, 4.0};
    const PoseProblem problem = NoisyProblem(rig, truth, 0.1, DegToRad(0.005), random);
    const PoseResult corrected = PenaltyPose(problem);
    ASSERT_TRUE(corrected);
    EXPECT_NEAR(RelativeYawDeg(corrected->camera_from_target, truth),
                RelativeYawDeg(truth.camera_from_target, truth),
                0.3);
    const PoseResult printed = PenaltyPose(problem, std::nullopt, no_gate, {1e6, true});
    ASSERT_TRUE(printed);
    EXPECT_NEAR(std::abs(RelativeYawDeg(printed->camera_from_target, truth)), 45.0, 0.1);
    // At the shield's head, 1.6 m off, that is more than a metre.
    const Eigen::Vector3d head = rig.points[0].p_point_in_target;
    EXPECT_GT((printed->camera_from_target * head - truth.camera_from_target * head).norm(), 1.0);
  }
}

// The hard constraint believes the tilts: its error is what its covariance says, and in roll it
// stands above the bound (1.35 times at 4 m and 0.05 px).
TEST(PenaltyPose, ErrorsAreWhatItsCovarianceSaysAndAboveTheBoundInRoll) {
  Random random("penalty errors");
  const Rig rig = PublishedRig();
  const double tilt_sigma_rad = DegToRad(0.005);
  const int draws = 1200;
  double nees = 0.0;
  double roll_squared = 0.0;
  double bound_squared = 0.0;
  for (int i = 0; i < draws; ++i) {
    const Truth truth = DrawTruth(random, {4.0, 4.0});
    const PoseProblem problem = NoisyProblem(rig, truth, 0.05, tilt_sigma_rad, random);
    const PoseResult result = PenaltyPose(problem);
    ASSERT_TRUE(result);
    const PoseError e = ErrorBetween(result->camera_from_target, truth.camera_from_target);
    nees += e.dot(result->covariance.ldlt().solve(e));
    roll_squared += e[2] * e[2];
    if (i < 50) {
      const auto bound = IndependentBound(rig, truth, 0.05, tilt_sigma_rad);
      ASSERT_TRUE(bound);
      bound_squared += (*bound)(2, 2) / 50.0;
    }
  }
  // Sigma of the mean NEES: sqrt(12 / 1200) = 0.1; of the RMS ratio: 2 %.
  EXPECT_NEAR(nees / draws, 6.0, 0.4);
  EXPECT_NEAR(std::sqrt(roll_squared / draws / bound_squared), 1.35, 0.10);
}

TEST(PenaltyPose, NeedsThreeLedsAndBothTilts) {
  Random random("penalty needs");
  const Rig rig = PublishedRig();
  const Truth truth = DrawTruth(random, {4.0, 4.0});
  PoseProblem problem = ExactProblem(rig, truth);
  problem.leds.resize(2);
  EXPECT_EQ(PenaltyPose(problem).error(), PoseFailure::kTooFewLeds);
  problem = ExactProblem(rig, truth);
  problem.target_tilt.reset();
  EXPECT_EQ(PenaltyPose(problem).error(), PoseFailure::kNotObservable);
}

TEST(SolvePose, CallsTheMethodByName) {
  Random random("by method");
  const Rig rig = FieldRig();
  const Truth truth = DrawTruth(random, {4.0, 4.0});
  const PoseProblem problem = NoisyProblem(rig, truth, 0.1, DegToRad(0.005), random);
  const auto same = [](const PoseResult& a, const PoseResult& b) {
    return a && b && ErrorBetween(a->camera_from_target, b->camera_from_target).norm() == 0.0;
  };
  const PoseResult fused = SolvePose(PoseMethod::kFused, problem);
  const PoseResult vision = SolvePose(PoseMethod::kVision, problem);
  const PoseResult published = SolvePose(PoseMethod::kPublished, problem);
  EXPECT_TRUE(same(fused, SolveFused(problem)));
  EXPECT_TRUE(same(vision, SolveVision(problem)));
  EXPECT_TRUE(same(published, PenaltyPose(problem)));
  EXPECT_FALSE(same(fused, vision));
  EXPECT_FALSE(same(fused, published));
}

}  // namespace
}  // namespace tbm::test
