#include "guidance/fusion/odometer_update.h"

#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

constexpr double kLeastLikely = 1e-6;

}  // namespace

FusionVerdict UpdateByOdometer(FusionFilter& filter,
                               const OdometerMounting& mounting,
                               std::optional<double> told_m_s) {
  const FusionState& state = filter.state();
  const FusionLayout& layout = filter.layout();
  const Eigen::Vector3d turn_rad(0.0, state.odometer_turn_rad.x(), state.odometer_turn_rad.y());
  const Eigen::Matrix3d vehicle_from_imu =
      (ExpRotation(turn_rad) * mounting.vehicle_from_imu).toRotationMatrix();
  const Eigen::Matrix3d imu_from_world = state.motion.world_from_imu.conjugate().toRotationMatrix();
  const Eigen::Vector3d in_imu_m_s = imu_from_world * state.motion.velocity_world_m_s;
  const Eigen::Vector3d wheel_m_s =
      vehicle_from_imu * (in_imu_m_s + filter.rate_rad_s().cross(mounting.wheel_in_imu_m));
  FusionMatrix by_error = FusionMatrix::Zero(3, layout.size());
  by_error.block<3, 3>(0, FusionLayout::kVelocity) = vehicle_from_imu * imu_from_world;
  by_error.block<3, 3>(0, FusionLayout::kAttitude) = vehicle_from_imu * Skew(in_imu_m_s);
  by_error.block<3, 3>(0, FusionLayout::kGyroBias) =
      vehicle_from_imu * Skew(mounting.wheel_in_imu_m);
  if (layout.Has(FusionOption::kOdometerTurn)) {
    by_error.block<3, 2>(0, layout.At(FusionOption::kOdometerTurn)) =
        -Skew(wheel_m_s).rightCols<2>();
  }

  const int rows = told_m_s ? 3 : 2;
  FusionMeasurement measurement;
  measurement.h = FusionMatrix::Zero(rows, layout.size());
  measurement.residual = FusionVector::Zero(rows);
  measurement.noise = FusionMatrix::Zero(rows, rows);
  measurement.h.topRows<2>() = by_error.bottomRows<2>();
  measurement.residual.head<2>() = -wheel_m_s.tail<2>();
  const double side = mounting.sigma_side_m_s;
  measurement.noise.diagonal().head<2>().setConstant(side * side);
  if (told_m_s) {
    // true = (1 + scale) told
    const double told_by_true = 1.0 / (1.0 + state.odometer_scale);
    measurement.h.row(2) = told_by_true * by_error.row(0);
    if (layout.Has(FusionOption::kOdometerScale)) {
      measurement.h(2, layout.At(FusionOption::kOdometerScale)) =
          -wheel_m_s.x() * told_by_true * told_by_true;
    }
    measurement.residual[2] = *told_m_s - told_by_true * wheel_m_s.x();
    measurement.noise(2, 2) = mounting.sigma_m_s * mounting.sigma_m_s;
  }
  return filter.Take(measurement,
                     {.update = FusionUpdate::kOdometer, .sensed_at = filter.now(), .why_not = {}},
                     kLeastLikely);
}

}  // namespace tbm
