#include "guidance/shield/attitude.h"

#include <cmath>

namespace tbm {
namespace {

// Both kinds of angles come from the same three: with the columns x, y of the rotation,
//   turn left = atan2(x.y, x.x)   up = asin(x.z)   right side down: the horizontal through the
// shield's axis is n = (x.y, -x.x, 0) / |..| (to the right); roll = angle from n to -y about x.
struct Angles {
  double left_rad, up_rad, roll_rad;
};

Angles AnglesOf(const Eigen::Matrix3d& turned) {
  const Eigen::Vector3d x = turned.col(0);
  const Eigen::Vector3d right = -turned.col(1);
  const double plan = std::hypot(x.x(), x.y());
  return {std::atan2(x.y(), x.x()), std::atan2(x.z(), plan), std::atan2(-right.z(), turned(2, 2))};
}

// Derivative of (left, up, roll) by a small turn about the outer frame's axes. With
// d x = turn cross x:
//   left: (-x.y, x.x, 0) / plan^2 . dx       up: dx.z / plan
//   roll = atan2(y.z, z.z): (z.z dy.z - y.z dz.z) / (y.z^2 + z.z^2)
Eigen::Matrix3d AnglesByTurn(const Eigen::Matrix3d& turned) {
  const Eigen::Vector3d x = turned.col(0);
  const double plan2 = x.head<2>().squaredNorm();
  const Eigen::Matrix3d x_by = -Skew(x);
  const Eigen::Matrix3d y_by = -Skew(turned.col(1));
  const Eigen::Matrix3d z_by = -Skew(turned.col(2));
  Eigen::Matrix3d by;
  by.row(0) = (x.x() * x_by.row(1) - x.y() * x_by.row(0)) / plan2;
  by.row(1) = x_by.row(2) / std::sqrt(plan2);
  by.row(2) = (turned(2, 2) * y_by.row(2) - turned(2, 1) * z_by.row(2)) / plan2;
  return by;
}

Eigen::Matrix3d CovarianceOfAngles(const UncertainRigid3& outer_from_shield) {
  const Eigen::Matrix3d by = AnglesByTurn(outer_from_shield.b_from_a.rotation.toRotationMatrix());
  return by * outer_from_shield.covariance.topLeftCorner<3, 3>() * by.transpose();
}

}  // namespace

Attitude AttitudeOf(const Rigid3& site_from_shield) {
  const Angles angles = AnglesOf(site_from_shield.rotation.toRotationMatrix());
  const Eigen::Vector3d x = site_from_shield.rotation * Eigen::Vector3d::UnitX();
  return {std::atan2(x.x(), x.y()), angles.up_rad, angles.roll_rad};
}

Eigen::Matrix3d CovarianceOfAttitude(const UncertainRigid3& site_from_shield) {
  // The heading grows when the shield turns to the right.
  Eigen::Matrix3d covariance = CovarianceOfAngles(site_from_shield);
  covariance.row(0) = -covariance.row(0);
  covariance.col(0) = -covariance.col(0);
  return covariance;
}

Articulation ArticulationOf(const Rigid3& rear_shield_from_front_shield) {
  const Angles angles = AnglesOf(rear_shield_from_front_shield.rotation.toRotationMatrix());
  return {-angles.left_rad, angles.up_rad, angles.roll_rad};
}

Eigen::Matrix3d CovarianceOfArticulation(const UncertainRigid3& rear_shield_from_front_shield) {
  return CovarianceOfAttitude(rear_shield_from_front_shield);
}

}  // namespace tbm
