#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/fusion/displacement_update.h"
#include "guidance/fusion/fusion_smoother.h"
#include "guidance/fusion/odometer_update.h"
#include "guidance/fusion/rest_update.h"
#include "guidance/fusion/target_modes.h"
#include "guidance/fusion/target_pixels.h"
#include "guidance/fusion/tilt_update.h"
#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kGravity_m_s2 = 9.80665;

const std::vector<FusionOption> kAll = {FusionOption::kTiltOffset,
                                        FusionOption::kGravity,
                                        FusionOption::kTimeOffset,
                                        FusionOption::kCameraRotation,
                                        FusionOption::kCameraPosition,
                                        FusionOption::kOdometerScale,
                                        FusionOption::kImageScale};

FusionState SomeState(int modes) {
  FusionState state;
  state.motion.position_world_m = {1.0, 13.4, 1.2};
  state.motion.velocity_world_m_s = {0.1, -0.3, 0.05};
  state.motion.world_from_imu = ExpRotation({0.02, -0.03, -1.5});
  state.gyro_bias_rad_s = {1e-4, -2e-4, 3e-4};
  state.accel_bias_m_s2 = {0.01, -0.02, 0.005};
  state.tilt_offset_rad = {1e-4, -1e-4};
  state.gravity_turn_rad = {2e-4, -3e-4};
  state.time_offset_s = -0.004;
  Eigen::Matrix3d ahead;
  ahead << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  state.camera_from_imu = ExpRotation({0.01, 0.02, -0.01}) * Eigen::Quaterniond(ahead);
  state.camera_in_imu_m = {0.15, -0.05, 0.1};
  state.modes.setConstant(modes, 0.3);
  return state;
}

FusionFilter FilterAt(const FusionLayout& layout, const FusionState& state) {
  const FusionMatrix small = 1e-8 * FusionMatrix::Identity(layout.size(), layout.size());
  return FusionFilter(layout, state, small, {1e-5, 1e-4, 1e-7, 1e-6}, kGravity_m_s2, {0});
}

ImuSample SampleAt(std::int64_t end_ns, double interval_s = 0.005) {
  return {{end_ns}, interval_s, {0.1, -0.2, 0.3}, {0.2, -0.1, 9.7}};
}

FusionVector Unit(const FusionLayout& layout, int row, double size) {
  FusionVector e = FusionVector::Zero(layout.size());
  e[row] = size;
  return e;
}

TEST(Strapdown, AConstantRateTurnsExactly) {
  Strapdown strapdown;
  Motion motion;
  const Eigen::Vector3d rate(0.3, -0.2, 0.5);
  for (int i = 0; i < 1000; ++i) {
    motion = Advanced(motion, strapdown.Next(rate, {0, 0, 0}, 0.01), 0.01, {0, 0, 0});
  }
  const Eigen::Quaterniond truth = ExpRotation(rate * 10.0);
  EXPECT_LT(LogRotation(truth.conjugate() * motion.world_from_imu).norm(), 1e-12);
}

// Classical coning: the axis of a fast small turn goes round, and the body turns though each axis
// swings about zero. Truth by integrating the rate a thousand times finer.
TEST(Strapdown, ConingIsFollowed) {
  const double half_angle = 0.02;
  const double frequency = 2.0 * kPi * 5.0;
  const auto rate = [&](double t) {
    return Eigen::Vector3d(half_angle * frequency * std::cos(frequency * t),
                           -half_angle * frequency * std::sin(frequency * t),
                           0.0);
  };
  const double dt = 0.01;
  Strapdown strapdown;
  Eigen::Quaterniond plain = Eigen::Quaterniond::Identity();
  Eigen::Quaterniond truth = Eigen::Quaterniond::Identity();
  Motion motion;
  for (int i = 0; i < 500; ++i) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (int part = 0; part < 1000; ++part) {
      const Eigen::Vector3d now = rate((i + (part + 0.5) / 1000.0) * dt);
      truth = truth * ExpRotation(now * dt / 1000.0);
      mean += now / 1000.0;
    }
    motion = Advanced(motion, strapdown.Next(mean, {0, 0, 0}, dt), dt, {0, 0, 0});
    plain = plain * ExpRotation(mean * dt);
  }
  const double error = LogRotation(truth.conjugate() * motion.world_from_imu).norm();
  const double uncorrected = LogRotation(truth.conjugate() * plain).norm();
  EXPECT_GT(uncorrected, 3e-4) << "the motion does not cone";
  EXPECT_LT(error, 0.04 * uncorrected);
}

TEST(Strapdown, FallsFreely) {
  Strapdown strapdown;
  Motion motion;
  for (int i = 0; i < 200; ++i) {
    motion = Advanced(
        motion, strapdown.Next({0, 0, 0}, {0, 0, 0}, 0.005), 0.005, {0, 0, -kGravity_m_s2});
  }
  EXPECT_NEAR(motion.position_world_m.z(), -kGravity_m_s2 / 2.0, 1e-9);
}

TEST(FusionState, ErrorsGoThereAndBack) {
  const FusionLayout layout(kAll, 5);
  const FusionState state = SomeState(5);
  FusionVector e(layout.size());
  for (int i = 0; i < layout.size(); ++i) e[i] = 1e-3 * (i % 7 - 3);
  const FusionVector back = ErrorFrom(state, MovedBy(state, layout, e), layout);
  EXPECT_LT((back - e).cwiseAbs().maxCoeff(), 1e-12);
}

// The blocks of the step against differences of the integration itself.
TEST(FusionFilter, TheStepIsTheDerivativeOfTheMotion) {
  const FusionLayout layout(kAll, 0);
  const auto run = [&](const FusionState& state) {
    FusionFilter filter = FilterAt(layout, state);
    for (int i = 1; i <= 20; ++i) filter.Feed(SampleAt(i * 5'000'000));
    filter.BringForward();
    return filter;
  };
  const FusionState state = SomeState(0);
  const FusionFilter middle = run(state);
  FusionMatrix step = FusionMatrix::Identity(layout.size(), layout.size());
  middle.last_step().Take(step);
  constexpr double kSize = 1e-6;
  for (int column = 0; column < layout.size(); ++column) {
    const FusionFilter plus = run(MovedBy(state, layout, Unit(layout, column, kSize)));
    const FusionFilter minus = run(MovedBy(state, layout, Unit(layout, column, -kSize)));
    const FusionVector slope = ErrorFrom(minus.state(), plus.state(), layout) / (2.0 * kSize);
    EXPECT_LT((slope - step.col(column)).cwiseAbs().maxCoeff(), 3e-4) << "column " << column;
  }
}

TEST(FusionFilter, AnHourOfRestKeepsTheCovariancePositive) {
  const FusionLayout layout({FusionOption::kGravity});
  FusionFilter filter = FilterAt(layout, SomeState(0));
  for (int i = 1; i <= 36'000; ++i) {
    filter.Hold({{i * 100'000'000LL}, 0.1, {1e-4, -2e-4, 3e-4}, {0.3, 0.2, 9.8}});
    filter.BringForward();
    UpdateByRest(filter, {});
  }
  const Eigen::LLT<FusionMatrix> root(filter.covariance());
  EXPECT_EQ(root.info(), Eigen::Success);
}

TEST(FusionFilter, AnUnlikelyMeasurementChangesNothing) {
  const FusionLayout layout;
  FusionFilter filter = FilterAt(layout, SomeState(0));
  const FusionState before = filter.state();
  const FusionVerdict verdict = UpdateByRest(filter, {});
  EXPECT_FALSE(verdict.accepted);
  EXPECT_EQ(verdict.why_not, "innovation_too_large");
  EXPECT_GT(verdict.nis, 100.0);
  EXPECT_EQ(filter.state().motion.velocity_world_m_s, before.motion.velocity_world_m_s);
}

CameraModel Lens() { return {2592, 1944, 5455.0, 5400.0, 1300.0, 970.0, -0.1, 0.02, 1e-4, -2e-4}; }

SurveyedTarget TargetAt(const Eigen::Vector3d& in_world_m, int modes) {
  SurveyedTarget target{.name = "T", .in_world_m = in_world_m, .sigma_m = 3e-5, .by_mode = {}};
  target.by_mode.setRandom(3, modes);
  target.by_mode *= 1e-3;
  return target;
}

TEST(TargetPixels, TheDerivativeIsThatOfThePrediction) {
  const FusionLayout layout(kAll, 4);
  const FusionState state = SomeState(4);
  const SurveyedTarget target = TargetAt({1.1, 10.6, 1.6}, 4);
  const auto at = [&](const FusionState& moved) {
    FusionFilter filter = FilterAt(layout, moved);
    filter.Hold(SampleAt(5'000'000));  // a rate, and no motion
    const auto prediction = PredictPixel(filter, Lens(), target);
    EXPECT_TRUE(prediction.has_value());
    return prediction.value();
  };
  const PixelPrediction middle = at(state);
  constexpr double kSize = 1e-6;
  for (int column = 0; column < layout.size(); ++column) {
    const Eigen::Vector2d slope =
        (at(MovedBy(state, layout, Unit(layout, column, kSize))).pixel_px -
         at(MovedBy(state, layout, Unit(layout, column, -kSize))).pixel_px) /
        (2.0 * kSize);
    const Eigen::Vector2d told = middle.by_error.col(column);
    EXPECT_LT((slope - told).norm(), 1e-5 * (1.0 + told.norm()) + 0.02) << "column " << column;
  }
}

TEST(TargetPixels, AVelocityThatMayBeNoneSaysNothingOfTheClock) {
  const FusionLayout layout({FusionOption::kTimeOffset});
  FusionState state = SomeState(0);
  state.motion.velocity_world_m_s = {1e-4, -2e-4, 0.0};
  const FusionFilter filter = FilterAt(layout, state);
  const auto prediction = PredictPixel(filter, Lens(), TargetAt({1.1, 10.6, 1.6}, 0));
  ASSERT_TRUE(prediction.has_value());
  EXPECT_EQ(prediction->by_error.col(layout.At(FusionOption::kTimeOffset)).norm(), 0.0);
}

// A board in front of a camera that knows well where it stands.
struct Board {
  FusionLayout layout;
  FusionState state = SomeState(0);
  std::vector<SurveyedTarget> targets;
  std::vector<TargetPixel> pixels;

  Board() {
    const FusionFilter filter = FilterAt(layout, state);
    std::mt19937_64 engine(7);
    std::normal_distribution<double> noise(0.0, 0.1);
    for (int i = 0; i < 30; ++i) {
      targets.push_back(TargetAt({0.8 + 0.1 * (i % 6), 10.6, 1.3 + 0.1 * (i / 6)}, 0));
      const auto prediction = PredictPixel(filter, Lens(), targets.back());
      pixels.push_back({i, prediction->pixel_px + Eigen::Vector2d(noise(engine), noise(engine))});
    }
  }
  TargetsVerdict Update() {
    FusionFilter filter = FilterAt(layout, state);
    return UpdateByTargets(filter, Lens(), 0.1, targets, pixels);
  }
};

TEST(TargetPixels, GoodPointsAreAllTaken) {
  const TargetsVerdict outcome = Board().Update();
  EXPECT_TRUE(outcome.verdict.accepted);
  EXPECT_EQ(outcome.taken, 30);
  EXPECT_EQ(outcome.verdict.dof, 60);
  EXPECT_NEAR(outcome.verdict.nis / outcome.verdict.dof, 0.85, 0.35);
}

TEST(TargetPixels, AWrongMatchIsNamedAndLeftOut) {
  Board board;
  board.pixels[4].pixel_px.x() += 40.0;  // beyond what the state allows
  board.pixels[9].pixel_px.y() += 1.5;   // within it, and against all the others
  const TargetsVerdict outcome = board.Update();
  EXPECT_TRUE(outcome.verdict.accepted);
  ASSERT_EQ(outcome.rejected.size(), 2u);
  EXPECT_EQ(outcome.rejected[0].target, 4);
  EXPECT_EQ(outcome.rejected[0].why_not, "far_from_prediction");
  EXPECT_NEAR(outcome.rejected[0].off_px, 40.0, 1.0);
  EXPECT_EQ(outcome.rejected[1].target, 9);
  EXPECT_EQ(outcome.rejected[1].why_not, "does_not_fit");
}

TEST(TargetPixels, ExchangedTargetsAreLeftOut) {
  Board board;
  std::swap(board.pixels[3].target, board.pixels[20].target);
  const TargetsVerdict outcome = board.Update();
  EXPECT_TRUE(outcome.verdict.accepted);
  EXPECT_EQ(outcome.rejected.size(), 2u);
}

TEST(TargetPixels, AnImageThatMostlyDoesNotFitIsNotTaken) {
  Board board;
  for (std::size_t i = 0; i < 20; ++i)
    board.pixels[i].pixel_px.x() += 30.0 + 7.0 * static_cast<double>(i);
  const TargetsVerdict outcome = board.Update();
  EXPECT_FALSE(outcome.verdict.accepted);
  EXPECT_EQ(outcome.verdict.why_not, "most_do_not_fit");
}

TEST(TiltUpdate, TellsTheAttitudeAtRest) {
  const FusionLayout layout;
  FusionState state = SomeState(0);
  state.gravity_turn_rad.setZero();
  state.tilt_offset_rad.setZero();
  const TiltMounting mounting{ExpRotation({0.01, -0.02, 0.03}), DegToRad(0.003)};
  FusionFilter filter = FilterAt(layout, state);
  filter.Hold(SampleAt(5'000'000));
  const Eigen::Vector3d up =
      mounting.housing_from_imu *
      ((state.motion.world_from_imu * ExpRotation({2e-4, -3e-4, 0.0})).conjugate() *
       Eigen::Vector3d::UnitZ());
  for (int i = 0; i < 50; ++i) {
    UpdateByTilt(filter, mounting, {-std::asin(up.x()), std::asin(up.y())}, true);
  }
  const Eigen::Vector3d found =
      LogRotation(state.motion.world_from_imu.conjugate() * filter.state().motion.world_from_imu);
  EXPECT_NEAR(found.x(), 2e-4, 2e-5);
  EXPECT_NEAR(found.y(), -3e-4, 2e-5);
}

TEST(TiltUpdate, InMotionItTellsTheAccelerometersAndNotTheAttitude) {
  const FusionLayout layout;
  FusionState state = SomeState(0);
  state.tilt_offset_rad.setZero();
  const TiltMounting mounting{Eigen::Quaterniond::Identity(), DegToRad(0.003)};
  FusionFilter filter = FilterAt(layout, state);
  filter.Feed(SampleAt(5'000'000));
  const Eigen::Quaterniond before = filter.state().motion.world_from_imu;
  // A push of half a metre per second squared: three degrees of lean, and no error of anything.
  const Eigen::Vector3d force = filter.force_m_s2().normalized();
  const FusionVerdict verdict =
      UpdateByTilt(filter, mounting, {-std::asin(force.x()), std::asin(force.y())}, false);
  EXPECT_TRUE(verdict.accepted);
  EXPECT_LT(verdict.nis, 1e-6);
  EXPECT_EQ(filter.state().motion.world_from_imu.coeffs(), before.coeffs());
}

// A trolley that runs along its x for a minute: speed and scale against a truth of two lines.
TEST(OdometerUpdate, FindsTheScaleOfTheWheelWhereTheSpeedIsKnown) {
  const FusionLayout layout({FusionOption::kOdometerScale});
  FusionState state;
  state.motion.velocity_world_m_s = {0.5, 0.0, 0.0};
  FusionMatrix covariance = 1e-8 * FusionMatrix::Identity(layout.size(), layout.size());
  const int scale = layout.At(FusionOption::kOdometerScale);
  covariance(scale, scale) = 1e-4;
  FusionFilter filter(layout, state, covariance, {1e-7, 1e-6, 1e-9, 1e-9}, kGravity_m_s2, {0});
  const OdometerMounting mounting{Eigen::Quaterniond::Identity(), {0.0, 0.3, -0.5}, 1e-3, 1e-3};
  for (int i = 1; i <= 600; ++i) {
    filter.Feed({{i * 100'000'000LL}, 0.1, {0, 0, 0}, {0, 0, kGravity_m_s2}});
    filter.BringForward();
    const FusionVerdict verdict = UpdateByOdometer(filter, mounting, 0.5 / 1.002);
    EXPECT_TRUE(verdict.accepted);
    EXPECT_EQ(verdict.dof, 3);
  }
  EXPECT_NEAR(filter.state().odometer_scale, 0.002, 2e-4);
}

TEST(OdometerUpdate, TheWheelDoesNotRunAcrossTheRail) {
  const FusionLayout layout;
  FusionState state;
  state.motion.velocity_world_m_s = {0.5, 0.02, -0.01};
  FusionMatrix covariance = 1e-4 * FusionMatrix::Identity(layout.size(), layout.size());
  FusionFilter filter(layout, state, covariance, {1e-5, 1e-4, 0, 0}, kGravity_m_s2, {0});
  filter.Hold({{5'000'000}, 0.005, {0, 0, 0.1}, {0, 0, kGravity_m_s2}});
  const OdometerMounting mounting{Eigen::Quaterniond::Identity(), {0.0, 0.0, 0.0}, 1e-3, 1e-4};
  const FusionVerdict verdict = UpdateByOdometer(filter, mounting, {});
  EXPECT_TRUE(verdict.accepted);
  EXPECT_EQ(verdict.dof, 2);
  const Motion& motion = filter.state().motion;
  const Eigen::Vector3d in_vehicle = motion.world_from_imu.conjugate() * motion.velocity_world_m_s;
  EXPECT_LT(std::abs(in_vehicle.y()), 2e-4);
  EXPECT_LT(std::abs(in_vehicle.z()), 2e-4);
}

// A minute past the ground by a camera that stands higher than it is believed to, then with the
// height known.
TEST(ImageDisplacement, FindsVelocityAndHeight) {
  const FusionLayout layout({FusionOption::kImageScale});
  const int scale = layout.At(FusionOption::kImageScale);
  FusionState state;
  state.motion.world_from_imu = ExpRotation({0.0, 0.0, 0.4});
  const Eigen::Vector3d along = state.motion.world_from_imu * Eigen::Vector3d::UnitX();
  state.motion.velocity_world_m_s = 0.5 * along;
  FusionMatrix covariance = 1e-10 * FusionMatrix::Identity(layout.size(), layout.size());
  covariance(scale, scale) = 1e-4;
  FusionFilter filter(layout, state, covariance, {1e-7, 1e-6, 1e-9, 1e-9}, kGravity_m_s2, {0});
  Motion last = state.motion;
  for (int i = 1; i <= 300; ++i) {
    filter.Feed({{i * 100'000'000LL}, 0.1, {0, 0, 0}, {0, 0, kGravity_m_s2}});
    filter.BringForward();
    // Five centimetres, told by a camera that is believed to stand 1 % too low.
    const FusionVerdict verdict = UpdateByImageDisplacement(
        filter, Eigen::Quaterniond::Identity(), last, {{0.05 / 1.01, 0.0}, 0.1, 1e-5});
    EXPECT_TRUE(verdict.accepted);
    last = filter.state().motion;
  }
  EXPECT_NEAR(filter.state().image_scale, 0.01, 1e-3);

  // With the height known it is the velocity that is corrected.
  const FusionLayout plain;
  covariance = 1e-6 * FusionMatrix::Identity(plain.size(), plain.size());
  covariance.diagonal().segment<3>(FusionLayout::kAttitude).setConstant(1e-12);
  FusionFilter other(plain, state, covariance, {1e-7, 1e-6, 1e-9, 1e-9}, kGravity_m_s2, {0});
  last = state.motion;
  for (int i = 1; i <= 50; ++i) {
    other.Feed({{i * 100'000'000LL}, 0.1, {0, 0, 0}, {0, 0, kGravity_m_s2}});
    other.BringForward();
    UpdateByImageDisplacement(
        other, Eigen::Quaterniond::Identity(), last, {{0.0502, 0.0001}, 0.1, 1e-5});
    last = other.state().motion;
  }
  const Eigen::Vector3d in_vehicle =
      other.state().motion.world_from_imu.conjugate() * other.state().motion.velocity_world_m_s;
  EXPECT_NEAR(in_vehicle.x(), 0.502, 5e-4);
  EXPECT_NEAR(in_vehicle.y(), 0.001, 5e-4);
}

// A filter that is linear throughout: the smoother must agree with all measurements put into one
// system of equations and solved at once.
TEST(FusionSmoother, AgreesWithTheWholeRunInOneSystem) {
  const FusionLayout layout;
  FusionState state;
  FusionMatrix covariance = FusionMatrix::Zero(15, 15);
  covariance.diagonal().segment<3>(0).setConstant(1e-4);
  covariance.diagonal().segment<3>(3).setConstant(1e-2);
  covariance.diagonal().segment<3>(6).setConstant(1e-18);  // no turning: all stays linear
  covariance.diagonal().segment<3>(9).setConstant(1e-24);
  covariance.diagonal().segment<3>(12).setConstant(1e-2);
  const ImuNoise noise{1e-12, 0.05, 1e-15, 1e-3};
  FusionFilter filter(layout, state, covariance, noise, kGravity_m_s2, {0});
  FusionSmoother smoother(layout);

  constexpr int kEpochs = 12;
  constexpr double kSpan_s = 0.1;
  std::mt19937_64 engine(11);
  std::normal_distribution<double> normal;
  // One axis (x) by itself: position, velocity, bias at each epoch.
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(3 * kEpochs, 3 * kEpochs);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(3 * kEpochs);
  information.topLeftCorner<3, 3>() = Eigen::Vector3d(1e4, 1e2, 1e2).asDiagonal();
  smoother.Before(filter);
  smoother.After(filter);
  for (int k = 1; k < kEpochs; ++k) {
    const double accel = normal(engine);
    filter.Feed({{k * 100'000'000LL}, kSpan_s, {0, 0, 0}, {accel, 0.0, kGravity_m_s2}});
    filter.BringForward();
    smoother.Before(filter);
    FusionMeasurement measurement;
    measurement.h = FusionMatrix::Zero(1, 15);
    measurement.h(0, 0) = 1.0;
    const double seen_m = 0.05 * normal(engine);
    measurement.residual =
        FusionVector::Constant(1, seen_m - filter.state().motion.position_world_m.x());
    measurement.noise = FusionMatrix::Constant(1, 1, 2.5e-3);
    filter.Take(measurement, {}, 0.0);
    smoother.After(filter);

    Eigen::Matrix3d phi = Eigen::Matrix3d::Identity();
    phi(0, 1) = kSpan_s;
    phi(0, 2) = -0.5 * kSpan_s * kSpan_s;
    phi(1, 2) = -kSpan_s;
    const double q = 0.05 * 0.05;
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    spread(0, 0) = q * kSpan_s * kSpan_s * kSpan_s / 3.0;
    spread(0, 1) = spread(1, 0) = q * kSpan_s * kSpan_s / 2.0;
    spread(1, 1) = q * kSpan_s;
    spread(2, 2) = 1e-6 * kSpan_s;
    const Eigen::Matrix3d weight = spread.inverse();
    const Eigen::Vector3d driven(0.5 * kSpan_s * kSpan_s * accel, kSpan_s * accel, 0.0);
    const int last = 3 * (k - 1);
    const int now = 3 * k;
    information.block<3, 3>(last, last) += phi.transpose() * weight * phi;
    information.block<3, 3>(last, now) -= phi.transpose() * weight;
    information.block<3, 3>(now, last) -= weight * phi;
    information.block<3, 3>(now, now) += weight;
    right.segment<3>(last) -= phi.transpose() * weight * driven;
    right.segment<3>(now) += weight * driven;
    information(now, now) += 1.0 / 2.5e-3;
    right[now] += seen_m / 2.5e-3;
  }
  const Eigen::VectorXd all = information.ldlt().solve(right);
  const Eigen::MatrixXd spread = information.inverse();
  smoother.Smooth([&](std::size_t k, const FusionEpoch& epoch) {
    const auto row = static_cast<Eigen::Index>(3 * k);
    EXPECT_NEAR(epoch.state.motion.position_world_m.x(), all[row], 1e-6) << k;
    EXPECT_NEAR(epoch.state.motion.velocity_world_m_s.x(), all[row + 1], 1e-5) << k;
    EXPECT_NEAR(epoch.state.accel_bias_m_s2.x(), all[row + 2], 1e-5) << k;
    EXPECT_NEAR(epoch.covariance(0, 0) / spread(row, row), 1.0, 1e-3) << k;
  });
}

// Planted errors of the survey move a camera that solves for its pose; with the modes taken out of
// the coordinates what is left moves it by no more than is told.
TEST(TargetModes, HoldWhatMovesTheCamera) {
  std::vector<SurveyedTarget> targets;
  for (int i = 0; i < 40; ++i) {
    targets.push_back(TargetAt({0.06 * (i % 8), 0.06 * (i / 8), 0.0}, 0));
  }
  std::vector<TargetView> views;
  for (int k = 0; k < 6; ++k) {
    TargetView view;
    view.camera_from_world.rotation = ExpRotation({kPi + 0.02 * k, 0.01 * k, 0.0});
    view.camera_from_world.translation = {-0.2, 0.1, 2.5 - 0.1 * k};
    for (int i = 0; i < 40; ++i) view.targets.push_back(i);
    views.push_back(view);
  }
  const TargetModes modes = FindTargetModes(views, Lens(), 0.1, FusionLayout::kMostModes, &targets);
  EXPECT_GE(modes.count, 6);
  EXPECT_LE(modes.count, FusionLayout::kMostModes);
  EXPECT_LT(modes.left_out_m.maxCoeff(), 2e-5);
  std::vector<SurveyedTarget> few = targets;
  const TargetModes three = FindTargetModes(views, Lens(), 0.1, 3, &few);
  EXPECT_EQ(three.count, 3);
  EXPECT_GT(three.left_out_m.norm(), modes.left_out_m.norm());
  // In units of their sigma the columns are orthonormal: three numbers of sigma 1 stay that.
  Eigen::Matrix3d gram = Eigen::Matrix3d::Zero();
  for (const SurveyedTarget& target : few) {
    gram += target.by_mode.transpose() * target.by_mode / (target.sigma_m * target.sigma_m);
  }
  EXPECT_LT((gram - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(TargetModes, WithoutAViewThereAreNone) {
  std::vector<SurveyedTarget> targets{TargetAt({0, 0, 0}, 3)};
  const TargetModes modes = FindTargetModes({}, Lens(), 0.1, 5, &targets);
  EXPECT_EQ(modes.count, 0);
  EXPECT_EQ(targets[0].by_mode.cols(), 0);
  EXPECT_EQ(modes.left_out_m, Eigen::Vector3d::Zero());
}

// Two targets at a time along a wall, looked at across it.
struct Wall {
  std::vector<SurveyedTarget> targets;
  std::vector<TargetView> views;

  explicit Wall(int count) {
    for (int i = 0; i < count; ++i) {
      targets.push_back(TargetAt({0.5 * i, 0.0, 0.3 * (i % 2)}, 0));
      targets.back().sigma_m = 5e-4;
    }
    for (int k = 0; k < 20 * (count - 1); ++k) {
      TargetView view;
      view.camera_from_world.rotation = ExpRotation({kPi / 2.0, 0.0, 0.0});
      const Eigen::Vector3d camera_in_world_m(0.025 * k, -2.5, 0.1);
      view.camera_from_world.translation = -(view.camera_from_world.rotation * camera_in_world_m);
      view.targets = {k / 20, k / 20 + 1};
      views.push_back(view);
    }
  }
};

TEST(TargetModes, CountAlsoWhereOnlyTwoTargetsAreSeen) {
  Wall wall(4);
  const TargetModes modes =
      FindTargetModes(wall.views, Lens(), 0.1, FusionLayout::kMostModes, &wall.targets);
  EXPECT_GT(modes.count, 5);
  EXPECT_LT(modes.left_out_m.maxCoeff(), 1e-5);
  for (const SurveyedTarget& target : wall.targets) EXPECT_GT(target.by_mode.norm(), 1e-4);
  // Half of one target's error, across the view; more along it.
  const Eigen::Vector3d sigma_m = SurveySigma(wall.views.front(), Lens(), 0.1, 1e-4, wall.targets);
  EXPECT_GT(sigma_m.minCoeff(), 2e-4);
}

// What no mode is left for is told: a long wall, of which each target moves the camera on its own.
TEST(TargetModes, TellWhatALongWallLeavesOut) {
  Wall wall(60);
  const TargetModes none = FindTargetModes(wall.views, Lens(), 0.1, 0, &wall.targets);
  EXPECT_EQ(none.count, 0);
  const TargetModes modes =
      FindTargetModes(wall.views, Lens(), 0.1, FusionLayout::kMostModes, &wall.targets);
  EXPECT_EQ(modes.count, FusionLayout::kMostModes);
  for (int i = 0; i < 3; ++i) {
    EXPECT_GT(none.left_out_m[i], 2e-4) << i;
    EXPECT_GT(modes.left_out_m[i], 0.3 * none.left_out_m[i]) << i;
    EXPECT_LT(modes.left_out_m[i], none.left_out_m[i]) << i;
  }
  // Two that are seen in one view among thousands count as well.
  Wall rare(60);
  rare.views.resize(20);
  TargetView once = wall.views[1000];
  rare.views.insert(rare.views.begin() + 10, once);
  for (int i = 0; i < 2000; ++i) rare.views.push_back(rare.views[19]);
  FindTargetModes(rare.views, Lens(), 0.1, FusionLayout::kMostModes, &rare.targets);
  EXPECT_GT(rare.targets[50].by_mode.norm(), 1e-4);
}

}  // namespace
}  // namespace tbm
