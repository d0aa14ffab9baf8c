// Every column of every update against differences of what the measurement is, written down here a
// second time and plainly. The update tells nothing of its derivative; it is read off what it does:
// with a covariance c I that is small beside the noise r of row k, one step d of the reading moves
// the state by c d / r times that row.
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "guidance/fusion/displacement_update.h"
#include "guidance/fusion/odometer_update.h"
#include "guidance/fusion/rest_update.h"
#include "guidance/fusion/target_pixels.h"
#include "guidance/fusion/tilt_update.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

constexpr double kGravity_m_s2 = 9.80665;
constexpr double kSigma = 1e-3;  // of every row of every measurement
constexpr double kCovariance = 1e-7 * kSigma * kSigma;
const ImuNoise kNoise{1e-9, 1e-9, 1e-12, 1e-12};
const ImuSample kSample{{5'000'000}, 0.005, {0.1, -0.2, 0.3}, {0.6, -0.4, 9.7}};

const FusionLayout kLayout({FusionOption::kTiltOffset,
                            FusionOption::kGravity,
                            FusionOption::kTimeOffset,
                            FusionOption::kCameraRotation,
                            FusionOption::kCameraPosition,
                            FusionOption::kOdometerScale,
                            FusionOption::kOdometerTurn,
                            FusionOption::kImageScale,
                            FusionOption::kImageTurn},
                           3);

FusionState SomeState() {
  FusionState state;
  state.motion.position_world_m = {0.3, -0.2, 0.1};
  state.motion.velocity_world_m_s = {0.7, -0.5, 0.3};
  state.motion.world_from_imu = ExpRotation({0.1, -0.2, 0.8});
  state.gyro_bias_rad_s = {1e-2, -2e-2, 3e-2};
  state.accel_bias_m_s2 = {0.1, -0.2, 0.05};
  state.tilt_offset_rad = {1e-2, -2e-2};
  state.gravity_turn_rad = {2e-2, -3e-2};
  state.time_offset_s = -0.02;
  Eigen::Matrix3d ahead;
  ahead << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  state.camera_from_imu = ExpRotation({0.1, 0.2, -0.1}) * Eigen::Quaterniond(ahead);
  state.camera_in_imu_m = {0.15, -0.05, 0.1};
  state.odometer_scale = 0.03;
  state.odometer_turn_rad = {1e-3, -2e-3};
  state.image_scale = -0.04;
  state.image_turn_rad = 0.3;
  state.modes.setConstant(3, 0.3);
  return state;
}

// Stands in `state` with the last sample as it came.
FusionFilter FilterIn(const FusionState& state) {
  const FusionMatrix covariance =
      kCovariance * FusionMatrix::Identity(kLayout.size(), kLayout.size());
  FusionFilter filter(kLayout, state, covariance, kNoise, kGravity_m_s2, {0});
  filter.Hold(kSample);
  filter.BringForward();
  return filter;
}

using Reading = Eigen::VectorXd;

struct Case {
  FusionState state = SomeState();
  // What the measurement is in a state. Its first rows are none in `state` and no reading of any
  // instrument: that something does not move.
  std::function<Reading(const FusionState&)> model;
  // Velocities in the world that bring such a row from 0 to 1.
  std::vector<Eigen::Vector3d> zeros;
  std::function<FusionVerdict(FusionFilter&, const Reading&)> update;
};

// How the state is moved where row `row` is `step` larger than the state says.
FusionVector Told(const Case& one, int row, double step) {
  FusionState state = one.state;
  Reading reading = one.model(state);
  if (row < static_cast<int>(one.zeros.size())) {
    state.motion.velocity_world_m_s -= step * one.zeros[static_cast<std::size_t>(row)];
  } else {
    reading[row] += step;
  }
  FusionFilter filter = FilterIn(state);
  const FusionVerdict verdict = one.update(filter, reading);
  EXPECT_TRUE(verdict.accepted) << verdict.why_not;
  return ErrorFrom(state, filter.state(), kLayout);
}

void ExpectColumns(const Case& one) {
  const int rows = static_cast<int>(one.model(one.state).size());
  ASSERT_LT(one.model(one.state).head(static_cast<Eigen::Index>(one.zeros.size())).norm(), 1e-12);
  Eigen::MatrixXd used(rows, kLayout.size());
  for (int row = 0; row < rows; ++row) {
    const FusionVector moved = Told(one, row, kSigma) - Told(one, row, -kSigma);
    used.row(row) = moved.transpose() * (kSigma / (2.0 * kCovariance));
  }
  constexpr double kStep = 1e-6;
  for (int column = 0; column < kLayout.size(); ++column) {
    const FusionVector plus = FusionVector::Unit(kLayout.size(), column) * kStep;
    const FusionVector minus = -plus;
    const Eigen::VectorXd slope = (one.model(MovedBy(one.state, kLayout, plus)) -
                                   one.model(MovedBy(one.state, kLayout, minus))) /
                                  (2.0 * kStep);
    // c h h beside r, and the digits of the state.
    EXPECT_LT((used.col(column) - slope).norm(), 1e-3 + 3e-3 * slope.norm())
        << "column " << column << ": used " << used.col(column).transpose() << ", is "
        << slope.transpose();
  }
}

Eigen::Quaterniond OdometerTurn(const FusionState& state) {
  return ExpRotation({0.0, state.odometer_turn_rad.x(), state.odometer_turn_rad.y()});
}

TEST(UpdateColumns, OfTheOdometer) {
  const OdometerMounting mounting{ExpRotation({0.1, -0.1, 0.3}), {0.4, -0.3, -0.5}, kSigma, kSigma};
  Case one;
  // Runs along the rail and turns.
  const Eigen::Vector3d lever_m_s =
      (kSample.gyro_rad_s - one.state.gyro_bias_rad_s).cross(mounting.wheel_in_imu_m);
  const Eigen::Matrix3d world_from_vehicle =
      (one.state.motion.world_from_imu *
       (OdometerTurn(one.state) * mounting.vehicle_from_imu).conjugate())
          .toRotationMatrix();
  one.state.motion.velocity_world_m_s = world_from_vehicle * Eigen::Vector3d(0.8, 0.0, 0.0) -
                                        one.state.motion.world_from_imu * lever_m_s;
  one.zeros = {world_from_vehicle.col(1), world_from_vehicle.col(2)};
  one.model = [&](const FusionState& state) {
    const Eigen::Vector3d rate = kSample.gyro_rad_s - state.gyro_bias_rad_s;
    const Eigen::Vector3d unit_m_s =
        state.motion.world_from_imu.conjugate() * state.motion.velocity_world_m_s;
    const Eigen::Vector3d wheel_m_s = OdometerTurn(state) * mounting.vehicle_from_imu *
                                      (unit_m_s + rate.cross(mounting.wheel_in_imu_m));
    return Reading(Eigen::Vector3d(
        wheel_m_s.y(), wheel_m_s.z(), wheel_m_s.x() / (1.0 + state.odometer_scale)));
  };
  one.update = [&](FusionFilter& filter, const Reading& reading) {
    return UpdateByOdometer(filter, mounting, reading[2]);
  };
  ExpectColumns(one);
}

TEST(UpdateColumns, OfTheImageDisplacement) {
  const Eigen::Quaterniond vehicle_from_imu = ExpRotation({0.1, -0.1, 0.3});
  constexpr double kSpan_s = 0.4;
  Case one;
  Motion first = one.state.motion;
  first.position_world_m -= kSpan_s * Eigen::Vector3d(0.9, -0.4, 0.2);
  first.world_from_imu = first.world_from_imu * ExpRotation({0.02, 0.01, -0.05});
  // The first place is wrong by what the second is, less what the velocity's error makes of the
  // span; the first attitude is wrong by what the second is.
  one.model = [&](const FusionState& state) {
    const FusionVector e = ErrorFrom(one.state, state, kLayout);
    const Eigen::Vector3d way_m = one.state.motion.position_world_m - first.position_world_m +
                                  kSpan_s * e.segment<3>(FusionLayout::kVelocity);
    const Eigen::Quaterniond world_from_imu =
        first.world_from_imu * ExpRotation(e.segment<3>(FusionLayout::kAttitude));
    const Eigen::Vector3d in_vehicle_m = ExpRotation({0.0, 0.0, state.image_turn_rad}) *
                                         vehicle_from_imu * (world_from_imu.conjugate() * way_m);
    return Reading(in_vehicle_m.head<2>() / (1.0 + state.image_scale));
  };
  one.update = [&](FusionFilter& filter, const Reading& reading) {
    return UpdateByImageDisplacement(
        filter, vehicle_from_imu, first, {reading.head<2>(), kSpan_s, kSigma});
  };
  ExpectColumns(one);
}

// Where the specific force of the housing points, as the two angles.
Reading AnglesOf(const Eigen::Vector3d& force, const FusionState& state) {
  const Eigen::Vector3d up = force.normalized();
  return Reading(Eigen::Vector2d(-std::asin(up.x()), std::asin(up.y())) + state.tilt_offset_rad);
}

TEST(UpdateColumns, OfTheTiltAtRest) {
  const TiltMounting mounting{ExpRotation({0.1, -0.2, 0.3}), kSigma};
  Case one;
  one.model = [&](const FusionState& state) {
    return AnglesOf(mounting.housing_from_imu * (state.motion.world_from_imu.conjugate() *
                                                 -GravityInWorld(state, kGravity_m_s2)),
                    state);
  };
  one.update = [&](FusionFilter& filter, const Reading& reading) {
    return UpdateByTilt(filter, mounting, {reading[0], reading[1]}, true);
  };
  ExpectColumns(one);
}

TEST(UpdateColumns, OfTheTiltInMotion) {
  const TiltMounting mounting{ExpRotation({0.1, -0.2, 0.3}), kSigma};
  Case one;
  one.model = [&](const FusionState& state) {
    return AnglesOf(mounting.housing_from_imu * (kSample.accel_m_s2 - state.accel_bias_m_s2),
                    state);
  };
  one.update = [&](FusionFilter& filter, const Reading& reading) {
    return UpdateByTilt(filter, mounting, {reading[0], reading[1]}, false);
  };
  ExpectColumns(one);
}

TEST(UpdateColumns, OfTheRest) {
  Case one;
  one.state.motion.velocity_world_m_s.setZero();
  one.zeros = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ()};
  one.model = [&](const FusionState& state) {
    Reading reading(9);
    reading << state.motion.velocity_world_m_s, state.gyro_bias_rad_s,
        state.accel_bias_m_s2 -
            state.motion.world_from_imu.conjugate() * GravityInWorld(state, kGravity_m_s2);
    return reading;
  };
  one.update = [&](FusionFilter& filter, const Reading& reading) {
    ImuSample sample = kSample;
    sample.ends_at = {2 * kSample.ends_at.ns};
    sample.gyro_rad_s = reading.segment<3>(3);
    sample.accel_m_s2 = reading.segment<3>(6);
    filter.Hold(sample);
    filter.BringForward();
    return UpdateByRest(filter, {kSigma, kSigma, kSigma});
  };
  ExpectColumns(one);
}

// The points of an image tell their derivative themselves.
TEST(UpdateColumns, OfTheTargetPixels) {
  const CameraModel lens{2592, 1944, 5455.0, 5400.0, 1300.0, 970.0, -0.1, 0.02, 1e-4, -2e-4};
  const FusionState state = SomeState();
  SurveyedTarget target{.name = "T", .in_world_m = {}, .sigma_m = 0.0, .by_mode = {}};
  target.in_world_m =
      state.motion.position_world_m + state.motion.world_from_imu * Eigen::Vector3d(2.5, -0.3, 0.2);
  target.by_mode.resize(3, 3);
  target.by_mode << 1.0, 0.2, -0.3, 0.4, -2.0, 0.1, 0.3, 0.5, 1.5;
  target.by_mode *= 1e-2;
  const auto model = [&](const FusionState& at) {
    const Eigen::Vector3d rate = kSample.gyro_rad_s - at.gyro_bias_rad_s;
    const Eigen::Quaterniond world_from_imu =
        at.motion.world_from_imu * ExpRotation(-at.time_offset_s * rate);
    const Eigen::Vector3d unit_m =
        at.motion.position_world_m - at.time_offset_s * at.motion.velocity_world_m_s;
    const Eigen::Vector3d point_m = target.in_world_m + target.by_mode * at.modes;
    const Eigen::Vector3d in_camera_m =
        at.camera_from_imu * (world_from_imu.conjugate() * (point_m - unit_m) - at.camera_in_imu_m);
    return Project(lens, in_camera_m)->pixel_px;
  };
  const auto told = PredictPixel(FilterIn(state), lens, target);
  ASSERT_TRUE(told.has_value());
  EXPECT_LT((told->pixel_px - model(state)).norm(), 1e-9);
  constexpr double kStep = 1e-6;
  for (int column = 0; column < kLayout.size(); ++column) {
    const FusionVector plus = FusionVector::Unit(kLayout.size(), column) * kStep;
    const FusionVector minus = -plus;
    const Eigen::Vector2d slope =
        (model(MovedBy(state, kLayout, plus)) - model(MovedBy(state, kLayout, minus))) /
        (2.0 * kStep);
    EXPECT_LT((told->by_error.col(column) - slope).norm(), 1e-3 + 5e-3 * slope.norm())
        << "column " << column << ": told " << told->by_error.col(column).transpose() << ", is "
        << slope.transpose();
  }
}

}  // namespace
}  // namespace tbm
