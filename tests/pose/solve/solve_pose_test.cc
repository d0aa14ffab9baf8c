#include "pose/solve/solve_pose.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "pose/solve/linearised.h"
#include "tests/pose/solve/as_built.h"
#include "tests/pose/solve/independent_bound.h"
#include "tests/pose/solve/placements.h"

namespace tbm::test {
namespace {

constexpr TruthRange kWide{2.5, 6.0, 0.3, 0.2, 0.3};

void ExpectExact(const PoseResult& result, const Placement& at) {
  ASSERT_TRUE(result) << at.name << ": failure " << static_cast<int>(result.error());
  EXPECT_LT(TurnErrorDeg(result->camera_from_target, at.truth), 1e-6) << at.name;
  EXPECT_LT(ShiftErrorMm(result->camera_from_target, at.truth), 1e-4) << at.name;
  EXPECT_LT(result->rms_px, 1e-6) << at.name;
}

TEST(SolveFused, IsExactForEverySignOfEveryTilt) {
  for (const Placement& at : EverySign())
    ExpectExact(SolveFused(ExactProblem(at.rig, at.truth)), at);
}

TEST(SolveVision, IsExactForEverySignWithTiltsToStartFromAndWithout) {
  for (const Placement& at : EverySign()) {
    PoseProblem problem = ExactProblem(at.rig, at.truth);
    ExpectExact(SolveVision(problem), at);
    problem.target_tilt.reset();
    ExpectExact(SolveVision(problem), at);
  }
}

TEST(SolveFused, WithoutBothTiltsIsVision) {
  Random random("fused without tilts");
  const Rig rig = FieldRig();
  const Truth truth = DrawTruth(random, kWide);
  const PoseProblem both = NoisyProblem(rig, truth, 0.1, DegToRad(0.005), random);
  PoseProblem one = both;
  one.target_tilt.reset();
  PoseProblem broken = both;
  broken.camera_tilt->inclination.beta_rad = std::nan("");
  const PoseResult vision = SolveVision(one);
  ASSERT_TRUE(vision);
  EXPECT_EQ(vision->dof, 4);
  for (const PoseProblem& problem : {one, broken}) {
    const PoseResult fused = SolveFused(problem);
    ASSERT_TRUE(fused);
    EXPECT_EQ(fused->dof, 4);
    EXPECT_LT(ErrorBetween(fused->camera_from_target, vision->camera_from_target).norm(), 1e-12);
  }
  const PoseResult fused = SolveFused(both);
  ASSERT_TRUE(fused);
  EXPECT_EQ(fused->dof, 6);
}

// The start must not show in the answer: none, the truth, and one 12 degrees and a third of the
// distance away give the same minimum.
TEST(SolveFused, EndsAtTheSameMinimumFromEveryStart) {
  Random random("fused starts");
  const Rig rig = FieldRig();
  for (int i = 0; i < 300; ++i) {
    const Truth truth = DrawTruth(random, kWide);
    const PoseProblem problem = NoisyProblem(rig, truth, 0.3, DegToRad(0.01), random);
    const PoseResult cold = SolveFused(problem);
    ASSERT_TRUE(cold);
    PoseError off;
    off << 0.2 * random.Normal3().normalized(), 0.0, 0.0,
        0.3 * truth.camera_from_target.translation.z();
    for (const Rigid3& start :
         {truth.camera_from_target, Displaced(truth.camera_from_target, off)}) {
      const PoseResult warm = SolveFused(problem, start);
      ASSERT_TRUE(warm) << static_cast<int>(warm.error());
      const PoseError apart = ErrorBetween(cold->camera_from_target, warm->camera_from_target);
      EXPECT_LT(apart.dot(cold->covariance.ldlt().solve(apart)), 1e-5);
      EXPECT_NEAR(warm->chi2, cold->chi2, 1e-3);
    }
  }
}

// The whole dense covariance of linearised.h against the solver's own arithmetic, which eliminates
// the intrinsics instead: the gradient J^T S^-1 r vanishes, chi2 and covariance are the same.
TEST(SolveFused, MinimisesTheDenseProblem) {
  Random random("fused dense");
  Rig rig = FieldRig();
  DeclareFieldSigmas(rig);
  for (int i = 0; i < 100; ++i) {
    const Truth truth = DrawTruth(random, kWide);
    const AsBuilt built = DrawAsBuilt(rig, random);
    PoseProblem problem = Observe(built, rig, truth, 0.1, DegToRad(0.005), random);
    problem.leds[1].sigma_px = 0.3;
    problem.target_tilt->sigma_rad = DegToRad(0.02);
    const PoseResult result = SolveFused(problem);
    ASSERT_TRUE(result);
    const auto linear = Linearise(problem, result->camera_from_target);
    ASSERT_TRUE(linear);
    const Eigen::MatrixXd weight = Eigen::MatrixXd(linear->covariance).inverse();
    const Eigen::MatrixXd j = linear->by_pose;
    const Eigen::VectorXd r = linear->residual;
    const Eigen::MatrixXd covariance = (j.transpose() * weight * j).inverse();
    const Eigen::VectorXd gradient = j.transpose() * weight * r;
    EXPECT_LT(std::sqrt(gradient.dot(covariance * gradient)), 5e-3);  // in sigmas
    EXPECT_NEAR(result->chi2, r.dot(weight * r), 2e-2 + 5e-3 * result->chi2);
    EXPECT_LT((result->covariance - covariance).norm(), 5e-3 * covariance.norm());
  }
}

TEST(SolveFused, CovarianceIsTheIndependentBound) {
  Random random("fused bound");
  for (int i = 0; i < 20; ++i) {
    Rig rig = FieldRig();
    if (i % 2 == 0) DeclareFieldSigmas(rig);
    const Truth truth = DrawTruth(random, kWide);
    PoseProblem problem = ExactProblem(rig, truth);
    for (LedObservation& led : problem.leds) led.sigma_px = 0.1;
    problem.target_tilt->sigma_rad = problem.camera_tilt->sigma_rad = DegToRad(0.005);
    for (const bool with_tilts : {true, false}) {
      const PoseResult result = with_tilts ? SolveFused(problem) : SolveVision(problem);
      const auto bound = IndependentBound(rig, truth, 0.1, DegToRad(0.005), with_tilts);
      ASSERT_TRUE(result && bound);
      EXPECT_LT((result->covariance - *bound).norm(), 1e-3 * bound->norm());
      for (int axis = 0; axis < 6; ++axis) {
        EXPECT_NEAR(result->covariance(axis, axis) / (*bound)(axis, axis), 1.0, 1e-3);
      }
    }
  }
}

// Target straight ahead at 4 m, 0.1 px, 0.005 degree: worked out once from the independent bound.
// The tilts buy a factor of five in pitch and more than two in roll; yaw they cannot help.
TEST(SolveFused, PredictsWhatTheGeometryAllows) {
  const Rig rig = PublishedRig();
  Truth truth;
  truth.camera_from_target.rotation = Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);
  truth.camera_from_target.translation = {0.0, 0.0, 4.0};
  PoseProblem problem = ExactProblem(rig, truth);
  for (LedObservation& led : problem.leds) led.sigma_px = 0.1;
  problem.target_tilt->sigma_rad = problem.camera_tilt->sigma_rad = DegToRad(0.005);
  const auto sigma_deg = [](const PoseResult& result, int axis) {
    return RadToDeg(std::sqrt(result->covariance(axis, axis)));
  };
  const PoseResult fused = SolveFused(problem);
  const PoseResult vision = SolveVision(problem);
  ASSERT_TRUE(fused && vision);
  EXPECT_NEAR(sigma_deg(vision, 0), 0.0342, 0.0005);  // pitch
  EXPECT_NEAR(sigma_deg(fused, 0), 0.0069, 0.0002);
  EXPECT_NEAR(sigma_deg(vision, 2), 0.0149, 0.0003);  // roll
  EXPECT_NEAR(sigma_deg(fused, 2), 0.0064, 0.0002);
  EXPECT_NEAR(sigma_deg(vision, 1), 0.037, 0.002);  // yaw
  EXPECT_NEAR(sigma_deg(fused, 1), 0.037, 0.002);
}

Rig Permuted(const Rig& rig) {
  Rig permuted = rig;
  std::reverse(permuted.leds.begin(), permuted.leds.end());
  return permuted;
}

TEST(SolveFused, DoesNotDependOnTheOrderOfLeds) {
  Random random("fused order");
  Rig rig = FieldRig();
  DeclareFieldSigmas(rig);
  const Rig permuted = Permuted(rig);
  for (int i = 0; i < 100; ++i) {
    const Truth truth = DrawTruth(random, kWide);
    const PoseProblem problem = NoisyProblem(rig, truth, 0.3, DegToRad(0.01), random);
    PoseProblem shuffled = problem;
    shuffled.rig = &permuted;
    for (std::size_t k = 0; k < 5; ++k) {
      shuffled.leds[k].led_index = static_cast<int>(4 - k);
      shuffled.leds[k].pixel_px = problem.leds[k].pixel_px;
    }
    std::swap(shuffled.leds[0], shuffled.leds[3]);
    const PoseResult a = SolveFused(problem);
    const PoseResult b = SolveFused(shuffled);
    ASSERT_TRUE(a && b);
    EXPECT_LT(ErrorBetween(a->camera_from_target, b->camera_from_target).norm(), 1e-10);
    EXPECT_NEAR(a->chi2, b->chi2, 1e-8);
  }
}

// A new datum on the board: the LEDs stay where they are, only the frame `target` moves.
TEST(SolveFused, FollowsTheTargetFrame) {
  Random random("fused datum");
  const Rig rig = FieldRig();
  for (int i = 0; i < 100; ++i) {
    const Truth truth = DrawTruth(random, kWide);
    const PoseProblem problem = NoisyProblem(rig, truth, 0.3, DegToRad(0.01), random);
    const Rigid3 datum_from_target{random.Rotation(), random.Normal3(0.2)};
    Rig moved = rig;
    for (Led& led : moved.leds) led.p_led_in_target = datum_from_target * led.p_led_in_target;
    moved.target_tilt.tilt_from_body *= datum_from_target.rotation.conjugate().toRotationMatrix();
    PoseProblem there = problem;
    there.rig = &moved;
    const PoseResult a = SolveFused(problem);
    const PoseResult b = SolveFused(there);
    ASSERT_TRUE(a && b);
    const PoseError apart =
        ErrorBetween(a->camera_from_target, b->camera_from_target * datum_from_target);
    EXPECT_LT(apart.norm(), 1e-6);
    EXPECT_NEAR(a->chi2, b->chi2, 1e-4);
  }
}

TEST(SolveFused, ScalesWithLengthAndWithSigma) {
  Random random("fused scale");
  const Rig rig = FieldRig();
  Rig tripled = rig;
  for (Led& led : tripled.leds) led.p_led_in_target *= 3.0;
  for (int i = 0; i < 100; ++i) {
    const Truth truth = DrawTruth(random, kWide);
    const PoseProblem problem = NoisyProblem(rig, truth, 0.1, DegToRad(0.005), random);
    const PoseResult base = SolveFused(problem);
    ASSERT_TRUE(base);

    PoseProblem large = problem;
    large.rig = &tripled;
    const PoseResult three_times = SolveFused(large);
    ASSERT_TRUE(three_times);
    Rigid3 expected = base->camera_from_target;
    expected.translation *= 3.0;
    EXPECT_LT(ErrorBetween(three_times->camera_from_target, expected).norm(), 1e-6);

    PoseProblem doubtful = problem;
    for (LedObservation& led : doubtful.leds) led.sigma_px *= 2.0;
    doubtful.target_tilt->sigma_rad *= 2.0;
    doubtful.camera_tilt->sigma_rad *= 2.0;
    const PoseResult doubted = SolveFused(doubtful);
    ASSERT_TRUE(doubted);
    EXPECT_LT(ErrorBetween(doubted->camera_from_target, base->camera_from_target).norm(), 1e-6);
    EXPECT_NEAR(4.0 * doubted->chi2, base->chi2, 1e-3 * (1.0 + base->chi2));
    EXPECT_LT((doubted->covariance - 4.0 * base->covariance).norm(),
              1e-3 * base->covariance.norm());
  }
}

TEST(SolveFused, TakesAnyNumberOfLeds) {
  for (const int count : {3, 5, 12, 32}) {
    const Rig rig = RigWithLeds(count, "any number of leds");
    Random random("any number draws", static_cast<std::uint64_t>(count));
    double nees = 0.0;
    double chi2 = 0.0;
    int solved = 0;
    const int draws = 3000;
    for (int i = 0; i < draws; ++i) {
      const Truth truth = DrawTruth(random, {2.5, 6.0, 0.2, 0.1, 0.1});
      if (i < 20) {
        const PoseResult exact = SolveFused(ExactProblem(rig, truth), truth.camera_from_target);
        ASSERT_TRUE(exact) << count;
        EXPECT_LT(TurnErrorDeg(exact->camera_from_target, truth), 1e-6) << count;
        EXPECT_LT(ShiftErrorMm(exact->camera_from_target, truth), 1e-4) << count;
        EXPECT_EQ(exact->dof, 2 * count - 4);
      }
      const PoseProblem problem = NoisyProblem(rig, truth, 0.1, DegToRad(0.005), random);
      const PoseResult result = SolveFused(problem);
      if (!result && count == 3) continue;  // a second pose may fit as well: see few_leds_test
      ASSERT_TRUE(result) << count;
      ++solved;
      const PoseError e = ErrorBetween(result->camera_from_target, truth.camera_from_target);
      nees += e.dot(result->covariance.ldlt().solve(e));
      chi2 += result->chi2;
    }
    EXPECT_GE(solved, draws * 3 / 4) << count;
    nees /= solved;
    chi2 /= solved;
    // Sigma of the mean of a chi2: sqrt(2 dof / draws).
    EXPECT_NEAR(nees, 6.0, 4.0 * std::sqrt(12.0 / draws)) << count;
    EXPECT_NEAR(chi2, 2 * count - 4, 4.0 * std::sqrt(2.0 * (2 * count - 4) / draws)) << count;
  }
}

TEST(SolveFused, RefusesByPredictedCovariance) {
  Random random("fused limits");
  const Rig rig = FieldRig();
  const Truth truth = DrawTruth(random, {4.0, 4.0});
  PoseProblem problem = NoisyProblem(rig, truth, 0.1, DegToRad(0.005), random);
  SolveOptions options;
  options.max_sigma_rotation_rad = DegToRad(0.02);  // yaw is worth 0.037
  EXPECT_EQ(SolveFused(problem, {}, options).error(), PoseFailure::kNotObservable);
  options = SolveOptions{};
  options.max_sigma_translation_m = 1e-5;
  EXPECT_EQ(SolveFused(problem, {}, options).error(), PoseFailure::kNotObservable);
  for (LedObservation& led : problem.leds) led.sigma_px = 10.0;  // yaw 3.7 degrees
  EXPECT_EQ(SolveFused(problem).error(), PoseFailure::kNotObservable);
}

TEST(SolveFused, RefusesAStartBehindTheCamera) {
  Random random("fused behind");
  const Rig rig = FieldRig();
  const Truth truth = DrawTruth(random, {4.0, 4.0});
  Rigid3 behind = truth.camera_from_target;
  behind.translation.z() *= -1.0;
  const PoseProblem problem = ExactProblem(rig, truth);
  EXPECT_EQ(SolveFused(problem, behind).error(), PoseFailure::kBehindCamera);
  EXPECT_EQ(SolveVision(problem, behind).error(), PoseFailure::kBehindCamera);
}

// Vanishing tangent residuals must not make an upside-down start a solution.
TEST(SolveFused, NeverEndsUpsideDown) {
  Random random("fused upside down");
  const Rig rig = FieldRig();
  for (int i = 0; i < 200; ++i) {
    const Truth truth = DrawTruth(random, {4.0, 4.0});
    const PoseProblem problem = NoisyProblem(rig, truth, 0.1, DegToRad(0.005), random);
    Rigid3 start = truth.camera_from_target;
    start.rotation =
        Eigen::AngleAxisd(random.Uniform(2.8, 3.5), Eigen::Vector3d::UnitZ()) * start.rotation;
    const PoseResult result = SolveFused(problem, start);
    if (result) {
      EXPECT_LT(TurnErrorDeg(result->camera_from_target, truth), 1.0);
    }
  }
}

// Turned by half a turn about the line through two LEDs of one height, a target shows the same
// pixels and the same tangents of the tilts.
TEST(SolveFused, NeverEndsUpsideDownWithTwoLedsEither) {
  Random random("solve pose upside down two");
  const Rig rig = FieldRig();
  int upright = 0;
  for (int i = 0; i < 300; ++i) {
    const Truth truth = DrawTruth(random, {2.5, 4.0, 0.6, 0.02, 0.02});
    PoseProblem problem = NoisyProblem(rig, truth, 0.1, DegToRad(0.005), random);
    problem.leds.resize(2);
    const Eigen::Vector3d& first = rig.leds[0].p_led_in_target;
    const Eigen::Vector3d line = (rig.leds[1].p_led_in_target - first).normalized();
    Rigid3 start = truth.camera_from_target;
    start.rotation = start.rotation * Eigen::AngleAxisd(std::numbers::pi, line);
    start.translation += truth.camera_from_target.rotation * first - start.rotation * first;
    SolveOptions options;
    options.max_sigma_rotation_rad = 0.1;
    EXPECT_FALSE(SolveFused(problem, start, options));
    upright += SolveFused(problem, truth.camera_from_target, options).has_value();
  }
  EXPECT_GT(upright, 100);
}

TEST(SolveVision, RefusesLedsOnOneLine) {
  Random random("leds on one line");
  Rig rig = FieldRig();
  for (int i = 0; i < 5; ++i) {
    rig.leds[static_cast<std::size_t>(i)].p_led_in_target = {0.1 * i - 0.2, 0.05 * i, 0.03 * i};
  }
  int solved = 0;
  for (int i = 0; i < 200; ++i) {
    const Truth truth = DrawTruth(random, kWide);
    PoseProblem problem = NoisyProblem(rig, truth, 0.1, DegToRad(0.005), random);
    const PoseResult from_tilts = SolveVision(problem);
    const PoseResult from_truth = SolveVision(problem, truth.camera_from_target);
    EXPECT_EQ(from_tilts.error(), PoseFailure::kNotObservable);
    EXPECT_EQ(from_truth.error(), PoseFailure::kNotObservable);
    // Tilts hold the roll about the line, as long as the line does not stand upright.
    const PoseResult fused = SolveFused(problem, truth.camera_from_target);
    if (fused) {
      ++solved;
      const PoseError e = ErrorBetween(fused->camera_from_target, truth.camera_from_target);
      EXPECT_LT(e.dot(fused->covariance.ldlt().solve(e)), 40.0);
    } else {
      EXPECT_EQ(fused.error(), PoseFailure::kNotObservable);
    }
    problem.target_tilt.reset();
    EXPECT_EQ(SolveVision(problem).error(), PoseFailure::kNotObservable);
  }
  EXPECT_GT(solved, 50);
}

TEST(SolveFused, RefusesLedsOnOnePlumbLine) {
  Random random("plumb line");
  Rig rig = PublishedRig();
  for (int i = 0; i < 5; ++i) {
    rig.leds[static_cast<std::size_t>(i)].p_led_in_target = {0.0, 0.1 * i - 0.2, 0.0};
  }
  for (int i = 0; i < 200; ++i) {
    Truth truth;
    truth.camera_from_target.rotation = Eigen::Quaterniond(TurnDeg(0, random.Uniform(-20, 20), 0)) *
                                        Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);
    truth.camera_from_target.translation = {random.Uniform(-0.3, 0.3), 0.1, 4.0};
    const PoseProblem problem = NoisyProblem(rig, truth, 0.1, DegToRad(0.005), random);
    const PoseResult cold = SolveFused(problem);
    const PoseResult warm = SolveFused(problem, truth.camera_from_target);
    EXPECT_EQ(cold.error(), PoseFailure::kNotObservable);
    EXPECT_EQ(warm.error(), PoseFailure::kNotObservable);
  }
}

TEST(SolveFused, ReportsRmsInPixelsPerAxis) {
  Random random("fused rms");
  const Rig rig = RigWithLeds(32, "rms leds");
  double sum = 0.0;
  const int draws = 300;
  for (int i = 0; i < draws; ++i) {
    const Truth truth = DrawTruth(random, {4.0, 4.0});
    const PoseResult result = SolveFused(NoisyProblem(rig, truth, 0.2, DegToRad(0.005), random));
    ASSERT_TRUE(result);
    sum += result->rms_px * result->rms_px / draws;
  }
  EXPECT_NEAR(std::sqrt(sum), 0.2 * std::sqrt(60.0 / 64.0), 0.005);
}

}  // namespace
}  // namespace tbm::test
