#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "pose/base/time.h"

namespace tbm {

// One sample of an inertial measurement unit: mean rate and mean specific force over the interval
// that ends at `ends_at`, in the axes of the unit (frame `imu`, right-handed).
struct ImuSample {
  Timestamp ends_at;
  double interval_s = 0.0;  // > 0
  Eigen::Vector3d gyro_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_m_s2 = Eigen::Vector3d::Zero();
};

// Where a unit is and how it moves. World: z up, fixed to the tunnel; the turning of the Earth is
// part of the gyro bias (15 deg/h at most, and constant as long as the heading is).
struct Motion {
  Eigen::Vector3d position_world_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_world_m_s = Eigen::Vector3d::Zero();
  Eigen::Quaterniond world_from_imu = Eigen::Quaterniond::Identity();
};

// The turn and the change of velocity of one interval, in the axes at its beginning, with what the
// turning of the axes during the interval adds: coning and sculling from this sample and the one
// before (both as increments; Savage 1998, two-sample form: 1/12 of the crossed increments).
struct Increments {
  Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
};

// Strapdown integration: increments out of rates, motion out of increments.
class Strapdown {
 public:
  // `gyro`, `accel`: of this sample with the biases taken off. A part of an interval is a sample of
  // its own.
  Increments Next(const Eigen::Vector3d& gyro_rad_s,
                  const Eigen::Vector3d& accel_m_s2,
                  double interval_s);

 private:
  Eigen::Vector3d last_turn_rad_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d last_velocity_m_s_ = Eigen::Vector3d::Zero();
};

// The motion after the interval; `gravity_world_m_s2` points down: (0, 0, -9.8).
Motion Advanced(const Motion& motion,
                const Increments& increments,
                double interval_s,
                const Eigen::Vector3d& gravity_world_m_s2);

}  // namespace tbm
