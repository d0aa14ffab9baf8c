#include "pose/solve/linearised.h"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/pose/solve/as_built.h"
#include "tests/pose/solve/independent_bound.h"

namespace tbm::test {
namespace {

constexpr TruthRange kWide{2.5, 6.0, 0.3, 0.3, 0.5};

// Central differences of the residuals. Step 1e-6: truncation 1e-12 of third derivatives below 1e4
// px, rounding 1e-12 px / 1e-6.
TEST(Linearise, JacobianAgreesWithCentralDifferences) {
  Random random("linearise jacobian");
  const Rig rig = FieldRig();
  constexpr double kStep = 1e-6;
  for (int draw = 0; draw < 50; ++draw) {
    const Truth truth = DrawTruth(random, kWide);
    const PoseProblem problem = NoisyProblem(rig, truth, 0.1, DegToRad(0.005), random);
    const auto at = Linearise(problem, truth.camera_from_target);
    ASSERT_TRUE(at);
    ASSERT_EQ(at->led_rows, 10);
    ASSERT_EQ(at->tilt_rows, 2);
    for (int axis = 0; axis < 6; ++axis) {
      const PoseError step = kStep * PoseError::Unit(axis);
      const auto ahead = Linearise(problem, Displaced(truth.camera_from_target, step));
      const auto behind = Linearise(problem, Displaced(truth.camera_from_target, -step));
      ASSERT_TRUE(ahead && behind);
      // Towards the truth the residual shrinks by what by_pose says.
      const Eigen::VectorXd difference = (behind->residual - ahead->residual) / (2.0 * kStep);
      const Eigen::VectorXd analytic = at->by_pose.col(axis);
      EXPECT_LT((difference - analytic).head(10).norm(), 1e-4);
      EXPECT_LT((difference - analytic).tail(2).norm(), 1e-8);
    }
  }
}

TEST(Linearise, ResidualIsObservedMinusExactProjection) {
  Random random("linearise residual");
  const Rig rig = FieldRig();
  const Truth truth = DrawTruth(random, kWide);
  PoseProblem problem = ExactProblem(rig, truth);
  problem.leds[2].pixel_px += Eigen::Vector2d(0.25, -0.5);
  const auto linear = Linearise(problem, truth.camera_from_target);
  ASSERT_TRUE(linear);
  EXPECT_NEAR(linear->residual[4], 0.25, 1e-9);
  EXPECT_NEAR(linear->residual[5], -0.5, 1e-9);
  EXPECT_LT(linear->residual.head(4).norm() + linear->residual.tail(6).norm(), 1e-9);
}

// Residuals at the truth over many rigs as built: their sample covariance is the declared one.
// 40 000 draws: one element of a correlation has a sigma of 0.005.
TEST(Linearise, CovarianceIsThatOfResidualsOverManyCalibrations) {
  Random random("linearise covariance");
  Rig rig = FieldRig();
  rig.intrinsics_sigma_px << 0.9, 0.7, 0.5, 0.6;
  rig.calibration_residual_px = 0.03;
  for (std::size_t i = 0; i < rig.leds.size(); ++i) {
    rig.leds[i].sigma_m = 1e-5 * static_cast<double>(i + 1);
  }
  rig.target_tilt.mounting_sigma_rad = DegToRad(0.006);
  rig.camera_tilt.mounting_sigma_rad = DegToRad(0.004);
  const double tilt_sigma_rad = DegToRad(0.005);
  const Truth truth = DrawTruth(random, kWide);
  PoseProblem nominal = ExactProblem(rig, truth);
  for (LedObservation& led : nominal.leds) led.sigma_px = 0.05;
  nominal.target_tilt->sigma_rad = nominal.camera_tilt->sigma_rad = tilt_sigma_rad;
  const auto declared = Linearise(nominal, truth.camera_from_target);
  ASSERT_TRUE(declared);

  const int draws = 40000;
  Eigen::Matrix<double, 12, 12> sample = Eigen::Matrix<double, 12, 12>::Zero();
  for (int i = 0; i < draws; ++i) {
    const AsBuilt built = DrawAsBuilt(rig, random);
    const PoseProblem problem = Observe(built, rig, truth, 0.05, tilt_sigma_rad, random);
    const auto linear = Linearise(problem, truth.camera_from_target);
    ASSERT_TRUE(linear);
    sample += linear->residual * linear->residual.transpose();
  }
  sample /= draws;
  const Eigen::VectorXd scale = declared->covariance.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd apart =
      scale.asDiagonal() * (sample - declared->covariance) * scale.asDiagonal();
  EXPECT_LT(apart.cwiseAbs().maxCoeff(), 0.03);
}

// (J^T S^-1 J)^-1 is the bound with all nuisances as unknowns: the marginalisation is exact.
TEST(Linearise, GivesTheIndependentBound) {
  Random random("linearise bound");
  for (const bool with_tilts : {true, false}) {
    for (int draw = 0; draw < 20; ++draw) {
      Rig rig = FieldRig();
      if (draw % 2 == 0) DeclareFieldSigmas(rig);
      const Truth truth = DrawTruth(random, kWide);
      PoseProblem problem = ExactProblem(rig, truth);
      for (LedObservation& led : problem.leds) led.sigma_px = 0.1;
      problem.target_tilt->sigma_rad = problem.camera_tilt->sigma_rad = DegToRad(0.005);
      const auto linear = Linearise(problem, truth.camera_from_target, with_tilts);
      ASSERT_TRUE(linear);
      const Eigen::MatrixXd j = linear->by_pose;
      const Eigen::MatrixXd s = linear->covariance;
      const Eigen::MatrixXd covariance = (j.transpose() * s.inverse() * j).inverse();
      const auto bound = IndependentBound(rig, truth, 0.1, DegToRad(0.005), with_tilts);
      ASSERT_TRUE(bound);
      EXPECT_LT((covariance - *bound).norm(), 1e-4 * bound->norm());
      for (int axis = 0; axis < 6; ++axis) {
        EXPECT_NEAR(covariance(axis, axis) / (*bound)(axis, axis), 1.0, 1e-4);
      }
    }
  }
}

TEST(Linearise, SaysNothingAboutLedsBehindTheCameraOrTiltsWithoutUp) {
  const Rig rig = FieldRig();
  Random random("linearise empty");
  const Truth truth = DrawTruth(random, kWide);
  PoseProblem problem = ExactProblem(rig, truth);
  Rigid3 behind = truth.camera_from_target;
  behind.translation.z() *= -1.0;
  EXPECT_FALSE(Linearise(problem, behind));
  problem.camera_tilt->inclination.beta_rad = DegToRad(100.0);
  EXPECT_FALSE(Linearise(problem, truth.camera_from_target));
  EXPECT_TRUE(Linearise(problem, truth.camera_from_target, false));
  problem.camera_tilt.reset();
  const auto without = Linearise(problem, truth.camera_from_target);
  ASSERT_TRUE(without);
  EXPECT_EQ(without->tilt_rows, 0);
}

}  // namespace
}  // namespace tbm::test
