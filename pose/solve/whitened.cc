#include "pose/solve/whitened.h"

#include <cmath>
#include <utility>

#include "pose/solve/dense_cholesky.h"
#include "pose/solve/normal_equations.h"

namespace tbm {
namespace {

// Takes out of `columns` what lies along `direction`, a unit vector.
template <class Columns>
void RemoveAlong(const LinearisedProblem::Rows& direction, Columns& columns) {
  const Eigen::Index rows = direction.size();
  for (Eigen::Index column = 0; column < columns.cols(); ++column) {
    double along = 0.0;
    for (Eigen::Index i = 0; i < rows; ++i) along += direction[i] * columns(i, column);
    for (Eigen::Index i = 0; i < rows; ++i) columns(i, column) -= along * direction[i];
  }
}

double SquaredLength(const LinearisedProblem::Rows& rows) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < rows.size(); ++i) sum += rows[i] * rows[i];
  return sum;
}

}  // namespace

std::optional<WhitenedProblem> WhitenedProblem::From(const PoseProblem& problem,
                                                     const Rigid3& pose) {
  auto linear = Linearise(problem, pose);
  if (!linear || !FactoriseCholesky(linear->covariance)) return std::nullopt;
  std::optional<WhitenedProblem> whitened(std::in_place);
  whitened->by_pose_ = linear->by_pose;
  whitened->residual_ = linear->residual;
  SolveLower(linear->covariance, whitened->by_pose_);
  SolveLower(linear->covariance, whitened->residual_);
  InvertLower(linear->covariance, whitened->inverse_root_);
  whitened->led_rows_ = linear->led_rows;
  whitened->tilt_rows_ = linear->tilt_rows;
  return whitened;
}

SubsetNormal WhitenedProblem::Without(int omitted) const {
  SubsetNormal normal;
  normal.rows = static_cast<int>(residual_.size());
  if (omitted == kNothingOmitted) {
    NormalOf(by_pose_, residual_, normal.information, normal.gradient);
    normal.residual_squared = SquaredLength(residual_);
    return normal;
  }
  LinearisedProblem::Rows first = inverse_root_.col(omitted);
  LinearisedProblem::Rows second = inverse_root_.col(omitted + 1);
  first /= std::sqrt(SquaredLength(first));
  RemoveAlong(first, second);
  second /= std::sqrt(SquaredLength(second));
  LinearisedProblem::RowsByPose by_pose = by_pose_;
  LinearisedProblem::Rows residual = residual_;
  for (const auto* direction : {&first, &second}) {
    RemoveAlong(*direction, by_pose);
    RemoveAlong(*direction, residual);
  }
  normal.rows -= 2;
  NormalOf(by_pose, residual, normal.information, normal.gradient);
  normal.residual_squared = SquaredLength(residual);
  return normal;
}

std::optional<SubsetSolution> Solve(const SubsetNormal& normal) {
  Factor6 factor;
  if (!Factorise(normal.information, 0.0, factor)) return std::nullopt;
  SubsetSolution solution;
  solution.e = SolveWith(factor, normal.gradient);
  solution.covariance = InverseOf(factor);
  solution.chi2 = normal.residual_squared - normal.gradient.dot(solution.e);
  return solution;
}

}  // namespace tbm
