#include "pose/geometry/rigid3.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace tbm::test {
namespace {

Rigid3 DrawRigid(Random& random) { return {random.Rotation(), random.Normal3(3.0)}; }

double Apart(const Rigid3& a, const Rigid3& b) { return ErrorBetween(a, b).norm(); }

TEST(Rigid3, ObeysTheLawsOfAGroup) {
  Random random("rigid3 laws");
  for (int i = 0; i < 500; ++i) {
    const Rigid3 b_from_a = DrawRigid(random);
    const Rigid3 c_from_b = DrawRigid(random);
    const Rigid3 d_from_c = DrawRigid(random);
    const Eigen::Vector3d p_in_a = random.Normal3(2.0);
    EXPECT_LT(Apart((d_from_c * c_from_b) * b_from_a, d_from_c * (c_from_b * b_from_a)), 1e-13);
    EXPECT_LT(Apart(b_from_a * Inverse(b_from_a), Rigid3{}), 1e-13);
    EXPECT_LT(Apart(Inverse(c_from_b * b_from_a), Inverse(b_from_a) * Inverse(c_from_b)), 1e-13);
    EXPECT_LT(((c_from_b * b_from_a) * p_in_a - c_from_b * (b_from_a * p_in_a)).norm(), 1e-13);
    const Eigen::Vector3d there =
        b_from_a.rotation.toRotationMatrix() * p_in_a + b_from_a.translation;
    EXPECT_LT((b_from_a * p_in_a - there).norm(), 1e-13);
  }
}

TEST(Rigid3, TurnBetweenIsTheShortestAndKnowsOppositeDirections) {
  Random random("rigid3 turn between");
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d from = random.Normal3(2.0);
    const Eigen::Vector3d to = random.Normal3(0.1);
    const Eigen::Quaterniond turn = TurnBetween(from, to);
    EXPECT_NEAR(turn.norm(), 1.0, 1e-12);
    EXPECT_LT((turn * from.normalized() - to.normalized()).norm(), 1e-10);
    EXPECT_NEAR(turn.vec().dot(from), 0.0, 1e-12);
    EXPECT_NEAR(turn.vec().dot(to), 0.0, 1e-12);
    EXPECT_NEAR(TurnBetween(from, 2.0 * from).w(), 1.0, 1e-15);

    for (const double off_by_rad : {0.0, 1e-12, 1e-7, 1e-5}) {
      const Eigen::Vector3d opposite = -(ExpRotation(off_by_rad * from.unitOrthogonal()) * from);
      const Eigen::Quaterniond half_turn = TurnBetween(from, opposite);
      EXPECT_NEAR(half_turn.norm(), 1.0, 1e-4);
      EXPECT_LT((half_turn * from.normalized() - opposite.normalized()).norm(), 2e-5) << off_by_rad;
    }
  }
}

TEST(Rigid3, ExpAndLogAgreeWithAngleAndAxisAtEveryAngle) {
  Random random("rigid3 exp");
  for (const double angle_rad :
       {0.0, 1e-12, 1e-8, 1e-5, 9.99e-4, 1.01e-3, 0.1, 1.0, 3.0, 3.14159}) {
    const Eigen::Vector3d axis = random.Normal3().normalized();
    const Eigen::Quaterniond turn = ExpRotation(angle_rad * axis);
    const Eigen::Matrix3d expected = Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix();
    EXPECT_LT((turn.toRotationMatrix() - expected).norm(), 2e-15) << angle_rad;
    EXPECT_NEAR(turn.norm(), 1.0, 1e-15) << angle_rad;
    EXPECT_LT((LogRotation(turn) - angle_rad * axis).norm(), 1e-14 * std::max(1.0, angle_rad))
        << angle_rad;
    const Eigen::Quaterniond same(-turn.w(), -turn.x(), -turn.y(), -turn.z());
    EXPECT_LT((LogRotation(same) - angle_rad * axis).norm(), 1e-14 * std::max(1.0, angle_rad));
  }
}

TEST(Rigid3, ErrorLeadsFromTheEstimateToTheTruth) {
  Random random("rigid3 error");
  for (int i = 0; i < 200; ++i) {
    const Rigid3 estimate = DrawRigid(random);
    const Rigid3 truth = DrawRigid(random);
    EXPECT_LT(Apart(Moved(estimate, ErrorBetween(estimate, truth)), truth), 1e-13);
  }
  // Turn and shift stand for themselves: a pure turn leaves the printed translation alone.
  PoseError turn = PoseError::Zero();
  turn[1] = 0.01;
  const Rigid3 pose{Eigen::Quaterniond::Identity(), {1.0, 2.0, 3.0}};
  EXPECT_EQ(Moved(pose, turn).translation, pose.translation);
}

TEST(Rigid3, PointByErrorAgreesWithCentralDifferences) {
  Random random("rigid3 jacobian");
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 100; ++i) {
    const Rigid3 pose = DrawRigid(random);
    const Eigen::Vector3d p = random.Normal3();
    const Eigen::Matrix<double, 3, 6> derivative = PointByError(pose, p);
    for (int axis = 0; axis < 6; ++axis) {
      const PoseError step = kStep * PoseError::Unit(axis);
      const Eigen::Vector3d difference =
          (Moved(pose, step) * p - Moved(pose, -step) * p) / (2.0 * kStep);
      EXPECT_LT((difference - derivative.col(axis)).norm(), 1e-8);
    }
  }
}

}  // namespace
}  // namespace tbm::test
