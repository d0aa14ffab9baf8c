#include "guidance/fusion/displacement_update.h"

#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

constexpr double kLeastLikely = 1e-6;

}  // namespace

FusionVerdict UpdateByImageDisplacement(FusionFilter& filter,
                                        const Eigen::Quaterniond& vehicle_from_imu,
                                        const Motion& at_first,
                                        const ImageDisplacement& displacement) {
  const FusionState& state = filter.state();
  const FusionLayout& layout = filter.layout();
  const Eigen::Matrix3d vehicle =
      (ExpRotation({0.0, 0.0, state.image_turn_rad}) * vehicle_from_imu).toRotationMatrix();
  const Eigen::Matrix3d imu_from_world = at_first.world_from_imu.conjugate().toRotationMatrix();
  const Eigen::Vector3d in_imu_m =
      imu_from_world * (state.motion.position_world_m - at_first.position_world_m);
  const Eigen::Vector3d in_vehicle_m = vehicle * in_imu_m;
  const double told_by_true = 1.0 / (1.0 + state.image_scale);

  FusionMeasurement measurement;
  measurement.h = FusionMatrix::Zero(2, layout.size());
  // Both ends carry the same error of position; what differs is that of the velocity in between.
  measurement.h.block<2, 3>(0, FusionLayout::kVelocity) =
      told_by_true * displacement.span_s * (vehicle * imu_from_world).topRows<2>();
  measurement.h.block<2, 3>(0, FusionLayout::kAttitude) =
      told_by_true * (vehicle * Skew(in_imu_m)).topRows<2>();
  if (layout.Has(FusionOption::kImageScale)) {
    measurement.h.block<2, 1>(0, layout.At(FusionOption::kImageScale)) =
        -told_by_true * told_by_true * in_vehicle_m.head<2>();
  }
  if (layout.Has(FusionOption::kImageTurn)) {
    measurement.h.block<2, 1>(0, layout.At(FusionOption::kImageTurn)) =
        told_by_true * Eigen::Vector2d(-in_vehicle_m.y(), in_vehicle_m.x());
  }
  measurement.residual = displacement.told_m - told_by_true * in_vehicle_m.head<2>();
  measurement.noise = displacement.sigma_m * displacement.sigma_m * FusionMatrix::Identity(2, 2);
  return filter.Take(
      measurement,
      {.update = FusionUpdate::kImageDisplacement, .sensed_at = filter.now(), .why_not = {}},
      kLeastLikely);
}

}  // namespace tbm
