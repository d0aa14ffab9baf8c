#include "pose/solve/whitened.h"

#include <Eigen/Cholesky>

namespace tbm {

std::optional<WhitenedProblem> WhitenedProblem::From(const PoseProblem& problem,
                                                     const Rigid3& pose) {
  const auto linear = Linearise(problem, pose);
  if (!linear) return std::nullopt;
  const Eigen::LLT<LinearisedProblem::RowsCovariance> root(linear->covariance);
  if (root.info() != Eigen::Success) return std::nullopt;
  const auto lower = root.matrixL();
  WhitenedProblem whitened;
  whitened.by_pose_ = linear->by_pose;
  whitened.residual_ = linear->residual;
  whitened.inverse_root_.setIdentity(linear->residual.size(), linear->residual.size());
  lower.solveInPlace(whitened.by_pose_);
  lower.solveInPlace(whitened.residual_);
  lower.solveInPlace(whitened.inverse_root_);
  whitened.led_rows_ = linear->led_rows;
  whitened.tilt_rows_ = linear->tilt_rows;
  return whitened;
}

SubsetNormal WhitenedProblem::Without(int omitted) const {
  SubsetNormal normal;
  normal.rows = static_cast<int>(residual_.size());
  if (omitted == kNothingOmitted) {
    normal.information.noalias() = by_pose_.transpose() * by_pose_;
    normal.gradient.noalias() = by_pose_.transpose() * residual_;
    normal.residual_squared = residual_.squaredNorm();
    return normal;
  }
  LinearisedProblem::Rows first = inverse_root_.col(omitted);
  LinearisedProblem::Rows second = inverse_root_.col(omitted + 1);
  first.normalize();
  second -= first.dot(second) * first;
  second.normalize();
  LinearisedProblem::RowsByPose by_pose = by_pose_;
  LinearisedProblem::Rows residual = residual_;
  for (const auto* direction : {&first, &second}) {
    const Eigen::Matrix<double, 1, 6> along = direction->transpose() * by_pose;
    by_pose.noalias() -= *direction * along;
    residual -= direction->dot(residual) * *direction;
  }
  normal.rows -= 2;
  normal.information.noalias() = by_pose.transpose() * by_pose;
  normal.gradient.noalias() = by_pose.transpose() * residual;
  normal.residual_squared = residual.squaredNorm();
  return normal;
}

std::optional<SubsetSolution> Solve(const SubsetNormal& normal) {
  const Eigen::LLT<PoseCovariance> root(normal.information);
  if (root.info() != Eigen::Success) return std::nullopt;
  SubsetSolution solution;
  solution.e = root.solve(normal.gradient);
  solution.covariance = root.solve(PoseCovariance::Identity());
  solution.chi2 = normal.residual_squared - normal.gradient.dot(solution.e);
  return solution;
}

}  // namespace tbm
