#include "guidance/fusion/rest_update.h"

#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

constexpr double kLeastLikely = 1e-6;

}  // namespace

FusionVerdict UpdateByRest(FusionFilter& filter, const RestNoise& noise) {
  return TryRest(filter, noise, filter.last_held());
}

FusionVerdict TryRest(FusionFilter& filter,
                      const RestNoise& noise,
                      const FusionFilter::Held& held) {
  const FusionState& state = filter.state();
  const FusionLayout& layout = filter.layout();
  const int rows = held.span_s > 0.0 ? 9 : 3;
  FusionMeasurement measurement;
  measurement.h = FusionMatrix::Zero(rows, layout.size());
  measurement.h.block<3, 3>(0, FusionLayout::kVelocity).setIdentity();
  measurement.residual = FusionVector::Zero(rows);
  measurement.residual.head<3>() = -state.motion.velocity_world_m_s;
  measurement.noise = FusionMatrix::Zero(rows, rows);
  measurement.noise.diagonal().head<3>().setConstant(noise.velocity_m_s * noise.velocity_m_s);
  if (held.span_s > 0.0) {
    // What the gyros show is their bias; what the accelerometers show is theirs and gravity.
    measurement.h.block<3, 3>(3, FusionLayout::kGyroBias).setIdentity();
    measurement.residual.segment<3>(3) = held.gyro_rad_s - state.gyro_bias_rad_s;
    const double angle = filter.noise().angle_random_walk_rad;
    measurement.noise.diagonal().segment<3>(3).setConstant(noise.rate_rad_s * noise.rate_rad_s +
                                                           angle * angle / held.span_s);
    const Eigen::Vector3d up_in_world = -GravityInWorld(state, filter.gravity_m_s2());
    const Eigen::Matrix3d imu_from_world =
        state.motion.world_from_imu.conjugate().toRotationMatrix();
    const Eigen::Vector3d force = imu_from_world * up_in_world;
    measurement.h.block<3, 3>(6, FusionLayout::kAttitude) = Skew(force);
    measurement.h.block<3, 3>(6, FusionLayout::kAccelBias).setIdentity();
    if (layout.Has(FusionOption::kGravity)) {
      measurement.h.block<3, 2>(6, layout.At(FusionOption::kGravity)) =
          (-imu_from_world * Skew(up_in_world)).leftCols<2>();
    }
    measurement.residual.segment<3>(6) = held.accel_m_s2 - state.accel_bias_m_s2 - force;
    const double velocity = filter.noise().velocity_random_walk_m_s;
    measurement.noise.diagonal().segment<3>(6).setConstant(noise.force_m_s2 * noise.force_m_s2 +
                                                           velocity * velocity / held.span_s);
  }
  return filter.Take(measurement,
                     {.update = FusionUpdate::kRest, .sensed_at = filter.now(), .why_not = {}},
                     kLeastLikely);
}

}  // namespace tbm
