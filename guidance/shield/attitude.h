#pragma once

#include <Eigen/Core>

#include "guidance/shield/uncertain.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

// How a shield lies in `site`, in the words of the tunnel. A shield's x axis points forward, y to
// its left, z up.
struct Attitude {
  double heading_rad = 0.0;  // of the x axis in plan, clockwise from north, in [-pi, pi)
  double pitch_rad = 0.0;    // + when the nose is higher than the tail
  double roll_rad = 0.0;     // + when the right side goes down
};

// Valid for everything that is not within a degree of vertical; a shield never is.
Attitude AttitudeOf(const Rigid3& site_from_shield);

// Covariance of (heading, pitch, roll) [rad^2].
Eigen::Matrix3d CovarianceOfAttitude(const UncertainRigid3& site_from_shield);

// How the front shield is turned against the rear one: what the articulation jacks do.
struct Articulation {
  double right_rad = 0.0;  // the front shield looks to the right of the rear one
  double up_rad = 0.0;     // it looks higher
  double roll_rad = 0.0;   // its right side is lower
};
Articulation ArticulationOf(const Rigid3& rear_shield_from_front_shield);

// Covariance of (right, up, roll) [rad^2].
Eigen::Matrix3d CovarianceOfArticulation(const UncertainRigid3& rear_shield_from_front_shield);

}  // namespace tbm
