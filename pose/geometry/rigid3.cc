#include "pose/geometry/rigid3.h"

#include <cmath>

namespace tbm {

Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& turn_rad) {
  const double angle_squared = turn_rad.squaredNorm();
  // Below 1e-3 rad the series is exact to rounding (next term 1e-15) and has no 0 / 0.
  if (angle_squared < 1e-6) {
    const double half_sinc = 0.5 - angle_squared / 48.0;
    const Eigen::Vector3d axis_part = half_sinc * turn_rad;
    return Eigen::Quaterniond(
               1.0 - angle_squared / 8.0, axis_part.x(), axis_part.y(), axis_part.z())
        .normalized();
  }
  const double angle = std::sqrt(angle_squared);
  const Eigen::Vector3d axis_part = (std::sin(0.5 * angle) / angle) * turn_rad;
  return {std::cos(0.5 * angle), axis_part.x(), axis_part.y(), axis_part.z()};
}

Eigen::Vector3d LogRotation(const Eigen::Quaterniond& rotation) {
  // q and -q are the same rotation; the one with w >= 0 has the angle within pi.
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d axis_part = sign * rotation.vec();
  const double sin_half = axis_part.norm();
  const double cos_half = sign * rotation.w();
  if (sin_half < 1e-7) return (2.0 / cos_half) * axis_part;
  return (2.0 * std::atan2(sin_half, cos_half) / sin_half) * axis_part;
}

Eigen::Quaterniond TurnBetween(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  // Nearer to opposite than this, a microradian, rounding says where the axis is.
  constexpr double kOpposite = -1.0 + 1e-12;
  const Eigen::Vector3d a = from.normalized();
  const Eigen::Vector3d b = to.normalized();
  const double cos_turn = b.dot(a);
  Eigen::Quaterniond turn;
  if (cos_turn < kOpposite) {
    turn.w() = 0.0;
    turn.vec() = (a - b).unitOrthogonal();
    return turn;
  }
  const Eigen::Vector3d axis = a.cross(b);
  const double twice_cos_half = std::sqrt((1.0 + cos_turn) * 2.0);
  const double scale = 1.0 / twice_cos_half;
  turn.vec() = axis * scale;
  turn.w() = twice_cos_half * 0.5;
  return turn;
}

PoseError ErrorBetween(const Rigid3& estimate, const Rigid3& truth) {
  PoseError e;
  e.head<3>() = LogRotation(truth.rotation * estimate.rotation.conjugate());
  e.tail<3>() = truth.translation - estimate.translation;
  return e;
}

Rigid3 Moved(const Rigid3& estimate, const PoseError& e) {
  return {(ExpRotation(e.head<3>()) * estimate.rotation).normalized(),
          estimate.translation + e.tail<3>()};
}

Eigen::Matrix<double, 3, 6> PointByError(const Rigid3& b_from_a, const Eigen::Vector3d& p_in_a) {
  Eigen::Matrix<double, 3, 6> derivative;
  derivative.leftCols<3>() = -Skew(b_from_a.rotation * p_in_a);
  derivative.rightCols<3>().setIdentity();
  return derivative;
}

}  // namespace tbm
