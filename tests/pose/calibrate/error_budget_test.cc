#include "pose/calibrate/error_budget.h"

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "pose/solve/solve_pose.h"
#include "tests/pose/solve/as_built.h"
#include "tests/support/random.h"
#include "tests/support/scene.h"

namespace tbm {
namespace {

using test::AsBuilt;
using test::FieldRig;
using test::Random;
using test::Truth;

constexpr double kCentreSigma_px = 0.05;

Rig DeclaredRig() {
  Rig rig = FieldRig();
  test::DeclareFieldSigmas(rig);
  rig.calibration_residual_px = 0.03;
  rig.leds[2].sigma_m = 0.12e-3;
  rig.target_tilt.mounting_sigma_rad = DegToRad(0.012);
  rig.points.push_back({"cutter_face", {0.4, 0.3, -5.0}, 0.5e-3});
  return rig;
}

// Camera level and turned a little, target not quite straight.
Truth Placement() {
  Random random("budget placement");
  return test::DrawTruth(random, {5.0, 5.0, 0.2, 0.03, 0.05});
}

BudgetPlacement PlacementOf(const Truth& truth) {
  return {truth.camera_from_target, truth.up_in_camera};
}

// Written out a second time: the errors are to be read by a person who stands behind the camera.
Eigen::Vector3d RightUpAlong(const Truth& truth, const Eigen::Vector3d& in_camera) {
  const Eigen::Vector3d up = truth.up_in_camera;
  const Eigen::Vector3d right = Eigen::Vector3d::UnitZ().cross(up).normalized();
  return {right.dot(in_camera), up.dot(in_camera), up.cross(right).dot(in_camera)};
}

// Correlated as a poor calibration leaves them: focal lengths together and with the principal
// point, k1 against k2, the principal point with the tangential distortion.
IntrinsicMatrix CorrelatedIntrinsics(const Rig& rig) {
  IntrinsicMatrix correlation = IntrinsicMatrix::Identity();
  const auto tie = [&](int i, int j, double c) { correlation(i, j) = correlation(j, i) = c; };
  tie(0, 1, 0.9);
  tie(4, 5, -0.85);
  tie(2, 6 + 1, -0.7);  // cx, p2
  tie(3, 6, -0.3);      // cy, p1
  tie(0, 3, 0.6);
  tie(1, 3, 0.6);
  tie(0, 4, 0.3);
  IntrinsicVector sigma;
  sigma << rig.intrinsics_sigma_px, 2e-3, 2e-2, 5e-5, 6e-5, 0.0;
  return sigma.asDiagonal() * correlation * sigma.asDiagonal();
}

struct Errors {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  int solved = 0;
};

// Draws worlds with `disturb`, sees them with sensors of their own, and asks the solver.
std::vector<Errors> MonteCarlo(const Rig& rig,
                               const Truth& truth,
                               const std::string& stream,
                               int draws,
                               double centre_sigma_px,
                               double tilt_sigma_rad,
                               const std::function<void(AsBuilt&, Random&)>& disturb) {
  std::vector<Errors> errors(rig.points.size());
  for (int k = 0; k < draws; ++k) {
    Random random(stream, static_cast<std::uint64_t>(k));
    AsBuilt built;
    built.rig = rig;
    for (auto& residual : built.residual_px) residual.setZero();
    disturb(built, random);
    PoseProblem problem = test::Observe(built, rig, truth, centre_sigma_px, tilt_sigma_rad, random);
    // What was added is one matter, what the solver is told of it another.
    for (LedObservation& led : problem.leds) led.sigma_px = kCentreSigma_px;
    problem.target_tilt->sigma_rad = rig.target_tilt.sigma_rad;
    problem.camera_tilt->sigma_rad = rig.camera_tilt.sigma_rad;
    const auto pose = SolveFused(problem);
    if (!pose) continue;
    for (std::size_t i = 0; i < errors.size(); ++i) {
      const Eigen::Vector3d off =
          RightUpAlong(truth,
                       pose->camera_from_target * rig.points[i].p_point_in_target -
                           truth.camera_from_target * built.rig.points[i].p_point_in_target);
      errors[i].covariance += off * off.transpose();
      ++errors[i].solved;
    }
  }
  for (Errors& error : errors) error.covariance /= error.solved;
  return errors;
}

void ExpectSame(const Eigen::Matrix3d& budget, const Eigen::Matrix3d& drawn, double tolerance) {
  const double size = std::sqrt(drawn.trace());
  for (int axis = 0; axis < 3; ++axis) {
    const double expected = std::sqrt(drawn(axis, axis));
    EXPECT_NEAR(std::sqrt(budget(axis, axis)), expected, tolerance * expected + 0.002 * size)
        << axis;
  }
  EXPECT_LT((budget - drawn).norm(), 3.0 * tolerance * drawn.norm());
}

TEST(ErrorBudget, EachSourceAndTheirSumAreWhatDrawingThemShows) {
  const Rig rig = DeclaredRig();
  const Truth truth = Placement();
  BudgetOptions options;
  options.centre_sigma_px = kCentreSigma_px;
  options.intrinsics = CorrelatedIntrinsics(rig);
  const auto budgets = BudgetOf(rig, PlacementOf(truth), options);
  ASSERT_TRUE(budgets);
  ASSERT_EQ(budgets->size(), 2u);
  // One block of the intrinsics alone, or all.
  const auto intrinsics = [&](int first, int count) {
    const Eigen::MatrixXd block = options.intrinsics->block(first, first, count, count) +
                                  1e-24 * Eigen::MatrixXd::Identity(count, count);
    const Eigen::MatrixXd block_root = Eigen::LLT<Eigen::MatrixXd>(block).matrixL();
    return [=](AsBuilt& built, Random& random) {
      Eigen::VectorXd unit(count);
      for (int i = 0; i < count; ++i) unit[i] = random.Normal();
      IntrinsicVector step = IntrinsicVector::Zero();
      step.segment(first, count) = block_root * unit;
      built.rig.camera = MovedCamera(built.rig.camera, step);
    };
  };
  const auto all = [&](AsBuilt& built, Random& random) {
    built = test::DrawAsBuilt(rig, random);
    built.rig.camera = rig.camera;
    intrinsics(0, 9)(built, random);
  };
  const auto only = [&](const std::function<void(Rig&)>& keep) {
    Rig declared = rig;
    declared.calibration_residual_px = 0.0;
    declared.intrinsics_sigma_px.setZero();
    for (Led& led : declared.leds) led.sigma_m = 0.0;
    declared.target_tilt.mounting_sigma_rad = declared.camera_tilt.mounting_sigma_rad = 0.0;
    for (NamedPoint& point : declared.points) point.sigma_m = 0.0;
    keep(declared);
    return
        [declared](AsBuilt& built, Random& random) { built = test::DrawAsBuilt(declared, random); };
  };
  const auto nothing = [](AsBuilt&, Random&) {};
  const double tilt_sigma_rad = rig.target_tilt.sigma_rad;
  struct Case {
    const char* name;
    std::function<Eigen::Matrix3d(const PointBudget&)> budget;
    std::function<void(AsBuilt&, Random&)> disturb;
    double centre_sigma_px = 0.0;
    double tilt_sigma_rad = 0.0;
  };
  const auto from = [](ErrorSource source) {
    return [source](const PointBudget& budget) { return budget.From(source); };
  };
  const std::vector<Case> cases = {
      {"focal length", from(ErrorSource::kFocalLength), intrinsics(0, 2)},
      {"principal point", from(ErrorSource::kPrincipalPoint), intrinsics(2, 2)},
      {"distortion", from(ErrorSource::kDistortion), intrinsics(4, 5)},
      {"camera", [](const PointBudget& budget) { return budget.camera; }, intrinsics(0, 9)},
      {"residual", from(ErrorSource::kLensResidual), only([&](Rig& r) {
         r.calibration_residual_px = rig.calibration_residual_px;
       })},
      {"LEDs", from(ErrorSource::kLeds), only([&](Rig& r) { r.leds = rig.leds; })},
      {"camera mounting", from(ErrorSource::kCameraMounting), only([&](Rig& r) {
         r.camera_tilt = rig.camera_tilt;
       })},
      {"target mounting", from(ErrorSource::kTargetMounting), only([&](Rig& r) {
         r.target_tilt = rig.target_tilt;
       })},
      {"point", from(ErrorSource::kPoint), only([&](Rig& r) { r.points = rig.points; })},
      {"centres", from(ErrorSource::kCentres), nothing, kCentreSigma_px, 0.0},
      {"tilts", from(ErrorSource::kTilts), nothing, 0.0, tilt_sigma_rad},
      {"calibration", [](const PointBudget& budget) { return budget.calibration; }, all},
      {"total",
       [](const PointBudget& budget) { return budget.total(); },
       all,
       kCentreSigma_px,
       tilt_sigma_rad}};
  constexpr int kDraws = 4000;  // an RMS to 1.1 %
  for (const Case& one : cases) {
    SCOPED_TRACE(one.name);
    const auto drawn = MonteCarlo(
        rig, truth, one.name, kDraws, one.centre_sigma_px, one.tilt_sigma_rad, one.disturb);
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      SCOPED_TRACE(rig.points[i].name);
      EXPECT_EQ(drawn[i].solved, kDraws);
      ExpectSame(one.budget((*budgets)[i]), drawn[i].covariance, 0.045);
    }
  }
}

// With nothing but what the rig file can declare, the sum is the solver's own covariance.
TEST(ErrorBudget, ItsSumIsTheCovarianceThatTheSolverPublishes) {
  const Rig rig = DeclaredRig();
  const Truth truth = Placement();
  BudgetOptions options;
  options.centre_sigma_px = kCentreSigma_px;
  const auto budgets = BudgetOf(rig, PlacementOf(truth), options);
  ASSERT_TRUE(budgets);
  PoseProblem problem = test::ExactProblem(rig, truth);
  for (LedObservation& led : problem.leds) led.sigma_px = kCentreSigma_px;
  problem.target_tilt->sigma_rad = rig.target_tilt.sigma_rad;
  problem.camera_tilt->sigma_rad = rig.camera_tilt.sigma_rad;
  const auto pose = SolveFused(problem);
  ASSERT_TRUE(pose);
  for (std::size_t i = 0; i < rig.points.size(); ++i) {
    const PointBudget& budget = (*budgets)[i];
    EXPECT_EQ(budget.From(ErrorSource::kDistortion), Eigen::Matrix3d::Zero());
    const Eigen::Matrix<double, 3, 6> by =
        PointByError(pose->camera_from_target, rig.points[i].p_point_in_target);
    const Eigen::Matrix3d in_camera = by * pose->covariance * by.transpose();
    Eigen::Matrix3d published;
    for (int axis = 0; axis < 3; ++axis) {
      published.col(axis) = RightUpAlong(truth, in_camera.col(axis));
    }
    for (int row = 0; row < 3; ++row) {
      published.row(row) = RightUpAlong(truth, published.row(row).transpose()).transpose();
    }
    const Eigen::Matrix3d sum = budget.total() - budget.From(ErrorSource::kPoint);
    EXPECT_LT((sum - published).norm(), 0.01 * published.norm());
    EXPECT_NEAR(budget.distance_m,
                (truth.camera_from_target * rig.points[i].p_point_in_target).norm(),
                1e-12);
  }
}

TEST(ErrorBudget, StraightAheadIsLevelAndFacing) {
  const Rig rig = DeclaredRig();
  const auto placement = StraightAhead(rig, 6.0, {});
  ASSERT_TRUE(placement);
  const Rigid3& pose = placement->camera_from_target;
  for (const auto& [mount, up] :
       {std::pair{&rig.camera_tilt, placement->up_in_camera},
        std::pair{&rig.target_tilt,
                  Eigen::Vector3d(pose.rotation.conjugate() * placement->up_in_camera)}}) {
    const Inclination read = test::ExactInclination(*mount, up);
    EXPECT_NEAR(read.beta_rad, 0.0, 1e-12);
    EXPECT_NEAR(read.gamma_rad, 0.0, 1e-12);
  }
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Led& led : rig.leds) middle += pose * led.p_led_in_target / 5.0;
  EXPECT_LT((middle - Eigen::Vector3d(0.0, 0.0, 6.0)).norm(), 1e-12);
  // The published board's z axis looks back at the camera, and the shield's head is beyond it.
  EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitZ()).z(), -0.98);
  EXPECT_GT((pose * rig.points[0].p_point_in_target).z(), 7.0);
  // Told which side faces the camera, it is that one.
  const auto turned = StraightAhead(rig, 6.0, Eigen::Vector3d(1.0, 0.0, 0.0));
  ASSERT_TRUE(turned);
  EXPECT_LT((turned->camera_from_target.rotation * Eigen::Vector3d::UnitX()).z(), -0.95);
}

TEST(ErrorBudget, SaysWhyThereIsNone) {
  Rig rig = DeclaredRig();
  const auto fault_at = [&](double distance_m) {
    const auto placement = StraightAhead(rig, distance_m, {});
    return placement ? BudgetOf(rig, *placement, {}).error().fault : placement.error().fault;
  };
  EXPECT_EQ(fault_at(0.8), BudgetFault::kLedUnseen) << "larger than the image";
  EXPECT_EQ(fault_at(2000.0), BudgetFault::kNoPose) << "five LEDs in a quarter of a pixel";
  const std::vector<NamedPoint> points = rig.points;
  rig.points.clear();
  EXPECT_EQ(fault_at(5.0), BudgetFault::kNoFacing) << "nothing tells front from back";
  rig.points = points;
  rig.camera_tilt.tilt_from_body.setIdentity();
  EXPECT_EQ(fault_at(5.0), BudgetFault::kLooksUp);
}

}  // namespace
}  // namespace tbm
