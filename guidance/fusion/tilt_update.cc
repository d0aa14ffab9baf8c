#include "guidance/fusion/tilt_update.h"

#include <algorithm>
#include <cmath>

#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

constexpr double kLeastLikely = 1e-6;

// (beta, gamma) of a direction in the housing, and their derivative by it.
struct Angles {
  Eigen::Vector2d angles_rad;
  Eigen::Matrix<double, 2, 3> by_direction;
};

Angles AnglesOf(const Eigen::Vector3d& up) {
  Angles angles;
  const double x = std::clamp(up.x(), -0.999999, 0.999999);
  const double y = std::clamp(up.y(), -0.999999, 0.999999);
  angles.angles_rad = {-std::asin(x), std::asin(y)};
  angles.by_direction.setZero();
  angles.by_direction(0, 0) = -1.0 / std::sqrt(1.0 - x * x);
  angles.by_direction(1, 1) = 1.0 / std::sqrt(1.0 - y * y);
  return angles;
}

}  // namespace

FusionVerdict UpdateByTilt(FusionFilter& filter,
                           const TiltMounting& mounting,
                           const TiltAngles& reading,
                           bool is_at_rest) {
  const FusionState& state = filter.state();
  const FusionLayout& layout = filter.layout();
  const Eigen::Matrix3d housing_from_imu = mounting.housing_from_imu.toRotationMatrix();
  FusionMeasurement measurement;
  measurement.h = FusionMatrix::Zero(2, layout.size());
  double variance = mounting.sigma_rad * mounting.sigma_rad;
  Angles predicted;
  if (is_at_rest) {
    const Eigen::Vector3d up_in_world =
        -GravityInWorld(state, filter.gravity_m_s2()) / filter.gravity_m_s2();
    const Eigen::Vector3d up_in_imu = state.motion.world_from_imu.conjugate() * up_in_world;
    predicted = AnglesOf(housing_from_imu * up_in_imu);
    const Eigen::Matrix<double, 2, 3> by_imu = predicted.by_direction * housing_from_imu;
    measurement.h.middleCols<3>(FusionLayout::kAttitude) = by_imu * Skew(up_in_imu);
    if (layout.Has(FusionOption::kGravity)) {
      const Eigen::Matrix3d imu_from_world =
          state.motion.world_from_imu.conjugate().toRotationMatrix();
      measurement.h.middleCols<2>(layout.At(FusionOption::kGravity)) =
          (-by_imu * imu_from_world * Skew(up_in_world)).leftCols<2>();
    }
  } else {
    const Eigen::Vector3d force = filter.force_m_s2();
    const double size = force.norm();
    const Eigen::Vector3d direction = force / size;
    predicted = AnglesOf(housing_from_imu * direction);
    const Eigen::Matrix3d by_force =
        (Eigen::Matrix3d::Identity() - direction * direction.transpose()) / size;
    measurement.h.middleCols<3>(FusionLayout::kAccelBias) =
        -predicted.by_direction * housing_from_imu * by_force;
    const double noise =
        filter.noise().velocity_random_walk_m_s / std::sqrt(filter.last_interval_s()) / size;
    variance += noise * noise;
  }
  if (layout.Has(FusionOption::kTiltOffset)) {
    measurement.h.middleCols<2>(layout.At(FusionOption::kTiltOffset)).setIdentity();
  }
  measurement.residual = Eigen::Vector2d(reading.beta_rad, reading.gamma_rad) -
                         predicted.angles_rad - state.tilt_offset_rad;
  measurement.noise = variance * FusionMatrix::Identity(2, 2);
  return filter.Take(measurement,
                     {.update = FusionUpdate::kTilt, .sensed_at = filter.now(), .why_not = {}},
                     kLeastLikely);
}

}  // namespace tbm
