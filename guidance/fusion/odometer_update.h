#pragma once

#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "guidance/fusion/fusion_filter.h"

namespace tbm {

// A wheel on the rail. Frame `vehicle`: x along the rail, y left, z up.
struct OdometerMounting {
  Eigen::Quaterniond vehicle_from_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d wheel_in_imu_m = Eigen::Vector3d::Zero();
  double sigma_m_s = 0.0;       // of the speed that is told, > 0
  double sigma_side_m_s = 0.0;  // how far the wheel leaves the rail sideways and upwards, > 0
};

// The wheel runs along the rail and not across it (docs/filter.md, "Odometer"). `told_m_s`: its
// speed by the odometer; without it only that it does not run across.
FusionVerdict UpdateByOdometer(FusionFilter& filter,
                               const OdometerMounting& mounting,
                               std::optional<double> told_m_s);

}  // namespace tbm
