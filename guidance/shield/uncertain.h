#pragma once

#include <Eigen/Core>

#include "pose/geometry/rigid3.h"

namespace tbm {

// A transform with what is not known of it. Order and perturbation of the covariance: rigid3.h.
struct UncertainRigid3 {
  Rigid3 b_from_a;
  PoseCovariance covariance = PoseCovariance::Zero();
};

// Chain of two transforms whose errors are independent of each other.
//
//   R = R_cb R_ba:                turn_c  = turn_cb + R_cb turn_ba
//   t = R_cb t_ba + t_cb:         shift_c = shift_cb + turn_cb x R_cb t_ba + R_cb shift_ba
UncertainRigid3 operator*(const UncertainRigid3& c_from_b, const UncertainRigid3& b_from_a);

// The error of the inverse is that of the transform, seen from a.
UncertainRigid3 Inverse(const UncertainRigid3& b_from_a);

// A point that is itself known to `cov_p_in_a` [m^2].
struct UncertainPoint {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};
UncertainPoint operator*(const UncertainRigid3& b_from_a, const UncertainPoint& in_a);

}  // namespace tbm
