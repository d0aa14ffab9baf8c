#pragma once

#include <Eigen/Core>

#include "guidance/fusion/fusion_filter.h"

namespace tbm {

// An inclinometer that is fixed to the unit.
struct TiltMounting {
  Eigen::Quaterniond housing_from_imu = Eigen::Quaterniond::Identity();
  double sigma_rad = 0.0;           // of one angle of one reading, > 0
  double sigma_rotation_rad = 0.0;  // of housing_from_imu about each axis that tilts; 0: exact
};

struct TiltAngles {
  double beta_rad = 0.0;   // u_x = -sin(beta)
  double gamma_rad = 0.0;  // u_y = +sin(gamma)
};

// What the inclinometer would read (docs/filter.md, "Tilt"): the direction of the specific force in
// its housing. That is up when the unit rests, and leans by a / g when it is driven: half a metre
// per second squared reads as three degrees. So it is compared with what the accelerometers feel at
// the same moment, which says nothing of the attitude and much of their biases, and when the unit
// rests with the attitude as well, which then knows the direction without their noise.
// `is_at_rest`: the unit stands still.
FusionVerdict UpdateByTilt(FusionFilter& filter,
                           const TiltMounting& mounting,
                           const TiltAngles& reading,
                           bool is_at_rest);

}  // namespace tbm
