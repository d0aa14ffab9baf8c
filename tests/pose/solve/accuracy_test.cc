#include <cmath>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "pose/solve/solve_pose.h"
#include "tests/pose/solve/as_built.h"
#include "tests/pose/solve/independent_bound.h"

namespace tbm::test {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

struct Tally {
  Vector6 squared = Vector6::Zero();  // of errors, turn then shift
  double head_squared = 0.0;          // 3-D distance of the shield's head
  double nees = 0.0;
  double chi2 = 0.0;
  int solved = 0;
  int dof = 0;

  void Add(const PoseResult& result, const Rig& rig, const Truth& truth) {
    if (!result) return;
    ++solved;
    const PoseError e = ErrorBetween(result->camera_from_target, truth.camera_from_target);
    squared += e.cwiseAbs2();
    nees += e.dot(result->covariance.ldlt().solve(e));
    chi2 += result->chi2;
    dof = result->dof;
    const Eigen::Vector3d head = rig.points[0].p_point_in_target;
    head_squared +=
        (result->camera_from_target * head - truth.camera_from_target * head).squaredNorm();
  }
  Vector6 Rmse() const { return (squared / solved).cwiseSqrt(); }
  double Nees() const { return nees / solved; }
};

// 20 000 draws a case (200 situations of 100): one RMSE has a sigma of 0.5 %, one mean NEES of
// 0.025.
constexpr int kSituations = 200;
constexpr int kDrawsEach = 100;

class AgainstTheBound : public testing::TestWithParam<std::tuple<double, double>> {};

TEST_P(AgainstTheBound, RmseIsWithinFivePercentAndNeesIsConsistent) {
  const auto [distance_m, centre_sigma_px] = GetParam();
  const double tilt_sigma_rad = DegToRad(0.005);
  const Rig rig = FieldRig();
  Random random("accuracy bound",
                static_cast<std::uint64_t>(1000.0 * distance_m + 100.0 * centre_sigma_px));
  for (const bool with_tilts : {true, false}) {
    Tally tally;
    Vector6 bound_variance = Vector6::Zero();
    for (int situation = 0; situation < kSituations; ++situation) {
      const Truth truth = DrawTruth(random, {distance_m, distance_m});
      const auto bound = IndependentBound(rig, truth, centre_sigma_px, tilt_sigma_rad, with_tilts);
      ASSERT_TRUE(bound);
      bound_variance += bound->diagonal() / kSituations;
      for (int draw = 0; draw < kDrawsEach; ++draw) {
        const PoseProblem problem =
            NoisyProblem(rig, truth, centre_sigma_px, tilt_sigma_rad, random);
        tally.Add(with_tilts ? SolveFused(problem) : SolveVision(problem), rig, truth);
      }
    }
    ASSERT_EQ(tally.solved, kSituations * kDrawsEach);
    const Vector6 ratio = tally.Rmse().cwiseQuotient(bound_variance.cwiseSqrt());
    EXPECT_LE(ratio.maxCoeff(), 1.05) << ratio.transpose();
    EXPECT_GE(ratio.minCoeff(), 0.97) << "no unbiased estimator is better: " << ratio.transpose();
    EXPECT_GE(tally.Nees(), 5.8);
    EXPECT_LE(tally.Nees(), 6.2);
    EXPECT_NEAR(tally.chi2 / tally.solved, tally.dof, 0.15);
    RecordProperty(with_tilts ? "fused_nees" : "vision_nees", std::to_string(tally.Nees()));
    RecordProperty(with_tilts ? "fused_worst" : "vision_worst", std::to_string(ratio.maxCoeff()));
  }
}

INSTANTIATE_TEST_SUITE_P(DistancesAndNoises,
                         AgainstTheBound,
                         testing::Combine(testing::Values(2.5, 4.0, 6.0),
                                          testing::Values(0.05, 0.1, 0.3, 1.0)));

// Drilling: 0.05 degree declared and true. The hard constraint of the paper is worse than vision
// alone here; the weighted one never is. The draws are the same for both, so their ratio has a
// sigma far below the 1 % allowed.
TEST(Accuracy, NoisyTiltsThatAreDeclaredNeverMakeItWorseThanVision) {
  const double tilt_sigma_rad = DegToRad(0.05);
  const Rig rig = FieldRig();
  for (const double distance_m : {2.5, 4.0, 8.0}) {
    for (const double centre_sigma_px : {0.05, 0.2}) {
      Random random("accuracy noisy tilts",
                    static_cast<std::uint64_t>(1000.0 * distance_m + 100.0 * centre_sigma_px));
      Tally fused;
      Tally vision;
      for (int draw = 0; draw < 20000; ++draw) {
        const Truth truth = DrawTruth(random, {distance_m, distance_m});
        const PoseProblem problem =
            NoisyProblem(rig, truth, centre_sigma_px, tilt_sigma_rad, random);
        fused.Add(SolveFused(problem), rig, truth);
        vision.Add(SolveVision(problem), rig, truth);
      }
      ASSERT_EQ(fused.solved, 20000);
      ASSERT_EQ(vision.solved, 20000);
      const Vector6 ratio = fused.Rmse().cwiseQuotient(vision.Rmse());
      EXPECT_LE(ratio.maxCoeff(), 1.01) << distance_m << " " << ratio.transpose();
      EXPECT_LE(fused.head_squared, 1.01 * vision.head_squared) << distance_m;
      EXPECT_NEAR(fused.Nees(), 6.0, 0.2) << distance_m;
    }
  }
}

// Rigs whose errors are drawn from what the rig file declares, a new one every draw: what the
// estimate says of itself holds for errors that no averaging removes.
TEST(Accuracy, CovarianceHoldsForCalibrationErrorsOfTheDeclaredSize) {
  Rig rig = FieldRig();
  DeclareFieldSigmas(rig);
  for (const double distance_m : {2.5, 4.0, 6.0}) {
    Random random("accuracy calibration", static_cast<std::uint64_t>(1000.0 * distance_m));
    Tally fused;
    Tally vision;
    for (int draw = 0; draw < 20000; ++draw) {
      const Truth truth = DrawTruth(random, {distance_m, distance_m});
      const AsBuilt built = DrawAsBuilt(rig, random);
      const PoseProblem problem = Observe(built, rig, truth, 0.05, DegToRad(0.005), random);
      fused.Add(SolveFused(problem), rig, truth);
      vision.Add(SolveVision(problem), rig, truth);
    }
    ASSERT_EQ(fused.solved, 20000);
    EXPECT_NEAR(fused.Nees(), 6.0, 0.2) << distance_m;
    EXPECT_NEAR(vision.Nees(), 6.0, 0.2) << distance_m;
    EXPECT_NEAR(fused.chi2 / fused.solved, fused.dof, 0.15) << distance_m;
  }
}

// Each kind of calibration error alone and large, so that none hides behind another.
TEST(Accuracy, CovarianceHoldsForEachKindOfCalibrationErrorAlone) {
  for (int kind = 0; kind < 4; ++kind) {
    Rig rig = FieldRig();
    if (kind == 0) rig.intrinsics_sigma_px << 6.0, 6.0, 4.0, 4.0;
    if (kind == 1) {
      for (Led& led : rig.leds) led.sigma_m = 0.3e-3;
    }
    if (kind == 2) {
      rig.target_tilt.mounting_sigma_rad = rig.camera_tilt.mounting_sigma_rad = DegToRad(0.05);
    }
    if (kind == 3) rig.calibration_residual_px = 0.3;
    Random random("accuracy one kind", static_cast<std::uint64_t>(kind));
    Tally fused;
    for (int draw = 0; draw < 20000; ++draw) {
      const Truth truth = DrawTruth(random, {4.0, 4.0});
      const AsBuilt built = DrawAsBuilt(rig, random);
      fused.Add(SolveFused(Observe(built, rig, truth, 0.05, DegToRad(0.005), random)), rig, truth);
    }
    ASSERT_EQ(fused.solved, 20000);
    EXPECT_NEAR(fused.Nees(), 6.0, 0.2) << "kind " << kind;
  }
}

}  // namespace
}  // namespace tbm::test
