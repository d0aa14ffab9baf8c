#include "guidance/shield/uncertain.h"

namespace tbm {

UncertainRigid3 operator*(const UncertainRigid3& c_from_b, const UncertainRigid3& b_from_a) {
  const Eigen::Matrix3d turned = c_from_b.b_from_a.rotation.toRotationMatrix();
  PoseCovariance by_outer = PoseCovariance::Identity();
  by_outer.block<3, 3>(3, 0) = -Skew(turned * b_from_a.b_from_a.translation);
  PoseCovariance by_inner = PoseCovariance::Zero();
  by_inner.block<3, 3>(0, 0) = by_inner.block<3, 3>(3, 3) = turned;
  return {c_from_b.b_from_a * b_from_a.b_from_a,
          by_outer * c_from_b.covariance * by_outer.transpose() +
              by_inner * b_from_a.covariance * by_inner.transpose()};
}

// a_from_b: R' = R^T, t' = -R^T t. With R_true = Exp(turn) R follows R'_true = R^T Exp(-turn) =
// Exp(-R^T turn) R^T, and t'_true = -R^T Exp(-turn) (t + shift), to first order
// t' - R^T shift - R^T (t x turn).
UncertainRigid3 Inverse(const UncertainRigid3& b_from_a) {
  const Eigen::Matrix3d back = b_from_a.b_from_a.rotation.conjugate().toRotationMatrix();
  PoseCovariance by = PoseCovariance::Zero();
  by.block<3, 3>(0, 0) = by.block<3, 3>(3, 3) = -back;
  by.block<3, 3>(3, 0) = -back * Skew(b_from_a.b_from_a.translation);
  return {Inverse(b_from_a.b_from_a), by * b_from_a.covariance * by.transpose()};
}

UncertainPoint operator*(const UncertainRigid3& b_from_a, const UncertainPoint& in_a) {
  const Eigen::Matrix<double, 3, 6> by = PointByError(b_from_a.b_from_a, in_a.p);
  const Eigen::Matrix3d turned = b_from_a.b_from_a.rotation.toRotationMatrix();
  return {
      b_from_a.b_from_a * in_a.p,
      by * b_from_a.covariance * by.transpose() + turned * in_a.covariance * turned.transpose()};
}

}  // namespace tbm
