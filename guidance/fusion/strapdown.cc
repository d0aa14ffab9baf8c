#include "guidance/fusion/strapdown.h"

#include "pose/geometry/rigid3.h"

namespace tbm {

Increments Strapdown::Next(const Eigen::Vector3d& gyro_rad_s,
                           const Eigen::Vector3d& accel_m_s2,
                           double interval_s) {
  const Eigen::Vector3d turn_rad = gyro_rad_s * interval_s;
  const Eigen::Vector3d velocity_m_s = accel_m_s2 * interval_s;
  Increments next;
  next.turn_rad = turn_rad + last_turn_rad_.cross(turn_rad) / 12.0;
  next.velocity_m_s =
      velocity_m_s + 0.5 * turn_rad.cross(velocity_m_s) +
      (last_turn_rad_.cross(velocity_m_s) + last_velocity_m_s_.cross(turn_rad)) / 12.0;
  last_turn_rad_ = turn_rad;
  last_velocity_m_s_ = velocity_m_s;
  return next;
}

Motion Advanced(const Motion& motion,
                const Increments& increments,
                double interval_s,
                const Eigen::Vector3d& gravity_world_m_s2) {
  Motion next;
  next.velocity_world_m_s = motion.velocity_world_m_s +
                            motion.world_from_imu * increments.velocity_m_s +
                            gravity_world_m_s2 * interval_s;
  next.position_world_m = motion.position_world_m +
                          0.5 * interval_s * (motion.velocity_world_m_s + next.velocity_world_m_s);
  next.world_from_imu = (motion.world_from_imu * ExpRotation(increments.turn_rad)).normalized();
  return next;
}

}  // namespace tbm
