#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace tbm {

// A rigid transform named b_from_a: it takes the coordinates of a point in frame a to frame b.
// Products are right when the inner words touch: c_from_a = c_from_b * b_from_a.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  // [m] origin of a, in b

  bool operator==(const Rigid3&) const = default;  // of the numbers: -q is another q
};

inline Eigen::Vector3d operator*(const Rigid3& b_from_a, const Eigen::Vector3d& p_in_a) {
  return b_from_a.rotation * p_in_a + b_from_a.translation;
}
inline Rigid3 operator*(const Rigid3& c_from_b, const Rigid3& b_from_a) {
  return {(c_from_b.rotation * b_from_a.rotation).normalized(), c_from_b * b_from_a.translation};
}
inline Rigid3 Inverse(const Rigid3& b_from_a) {
  const Eigen::Quaterniond a_from_b = b_from_a.rotation.conjugate();
  return {a_from_b, a_from_b * -b_from_a.translation};
}

inline Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d skew;
  skew << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return skew;
}

// Rotation by the angle |turn_rad| about turn_rad. Exact to rounding at every angle, zero included.
Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& turn_rad);

// Inverse of ExpRotation, in (-pi, pi].
Eigen::Vector3d LogRotation(const Eigen::Quaterniond& rotation);

// The shortest rotation that brings the direction of `from` to that of `to`; where they are
// opposite, one of the half turns that do. Eigen's FromTwoVectors bit for bit except for opposite
// directions, for which that one brings a whole singular value decomposition to the compiler.
Eigen::Quaterniond TurnBetween(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

// Covariance of a transform b_from_a. Rows and columns: rotation [rad] first, then translation [m],
// each about / along the axes of b. The error vector e = (turn, shift) is defined by
//   R_true = Exp(turn) R,   t_true = t + shift
// so that turn and shift stand for themselves and sigma_t is the sigma of the printed t.
using PoseCovariance = Eigen::Matrix<double, 6, 6>;
using PoseError = Eigen::Matrix<double, 6, 1>;

// The error e that takes `estimate` to `truth`, as defined above.
PoseError ErrorBetween(const Rigid3& estimate, const Rigid3& truth);

// `estimate` moved by e.
Rigid3 Moved(const Rigid3& estimate, const PoseError& e);

// Derivative of b_from_a * p_in_a by e: [ -Skew(R p) | I ].
Eigen::Matrix<double, 3, 6> PointByError(const Rigid3& b_from_a, const Eigen::Vector3d& p_in_a);

}  // namespace tbm
