#pragma once

#include <Eigen/Core>

#include "pose/base/result.h"

namespace tbm {

// What a two-axis inclinometer says, after its own sign convention is taken out (rig key `sign`).
// Each angle is between one axis of the housing and the horizontal plane, measured independently:
// beta is positive when x points down, gamma is positive when y points up (pose paper, Eqs. 9, 10
// and 13). They are not a pitch followed by a roll.
struct Inclination {
  double beta_rad = 0.0;
  double gamma_rad = 0.0;
};

enum class TiltFailure {
  kNotFinite,   // NaN or infinite: a dead channel
  kOutOfRange,  // beyond +-90 degrees, or no unit vector has both elevations: wiring or scaling
};

// The direction against gravity in the housing's own frame, as a unit vector:
//   up = (-sin beta, sin gamma, sqrt(1 - sin^2 beta - sin^2 gamma)),  up.z > 0.
// This is the third row of R^b of the paper and needs neither its arcsin nor its arctan, which
// flips by 180 degrees for a camera that looks along the tunnel (papers' Eq. 12). Meant for plates
// less than 90 degrees off level, which holds for all that is bolted to a shield.
Result<Eigen::Vector3d, TiltFailure> UpInTilt(const Inclination& reading);

// Derivative of UpInTilt by (beta, gamma). `reading` must have an up vector.
Eigen::Matrix<double, 3, 2> UpByInclination(const Inclination& reading);

// Inverse of UpInTilt for a unit vector with z > 0: what an ideal inclinometer would read.
Inclination InclinationFromUp(const Eigen::Vector3d& up_in_tilt);

}  // namespace tbm
