#include "pose/solve/whitened.h"

#include <cmath>
#include <utility>

#include "pose/solve/dense_cholesky.h"
#include "pose/solve/normal_equations.h"

namespace tbm {
namespace {

double Dot(const LinearisedProblem::Rows& a, const LinearisedProblem::Rows& b) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// Takes out of the normal equations what lies along `direction`, a unit vector, in the rows.
void TakeOut(const LinearisedProblem::Rows& direction,
             const LinearisedProblem::RowsByPose& by_pose,
             const LinearisedProblem::Rows& residual,
             SubsetNormal& normal) {
  double along[6];
  for (int a = 0; a < 6; ++a) {
    along[a] = 0.0;
    for (Eigen::Index i = 0; i < direction.size(); ++i) along[a] += direction[i] * by_pose(i, a);
  }
  const double of_residual = Dot(direction, residual);
  for (int a = 0; a < 6; ++a) {
    for (int b = 0; b < 6; ++b) normal.information(a, b) -= along[a] * along[b];
    normal.gradient[a] -= along[a] * of_residual;
  }
  normal.residual_squared -= of_residual * of_residual;
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
  SubsetNormal& all = whitened->all_;
  all.rows = static_cast<int>(whitened->residual_.size());
  NormalOf(whitened->by_pose_, whitened->residual_, all.information, all.gradient);
  all.residual_squared = Dot(whitened->residual_, whitened->residual_);
  return whitened;
}

SubsetNormal WhitenedProblem::Without(int omitted) const {
  if (omitted == kNothingOmitted) return all_;
  LinearisedProblem::Rows first = inverse_root_.col(omitted);
  LinearisedProblem::Rows second = inverse_root_.col(omitted + 1);
  first /= std::sqrt(Dot(first, first));
  second -= Dot(first, second) * first;
  second /= std::sqrt(Dot(second, second));
  SubsetNormal normal = all_;
  normal.rows -= 2;
  TakeOut(first, by_pose_, residual_, normal);
  TakeOut(second, by_pose_, residual_, normal);
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
