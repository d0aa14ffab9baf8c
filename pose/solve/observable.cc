#include "pose/solve/observable.h"

#include <Eigen/Eigenvalues>

namespace tbm {
namespace {

bool ExceedsSigma(const Eigen::Matrix3d& covariance, double max_sigma) {
  const double limit = max_sigma * max_sigma;
  if (covariance.trace() <= limit) return false;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance, Eigen::EigenvaluesOnly);
  return !(axes.eigenvalues().maxCoeff() <= limit);
}

}  // namespace

bool IsObservable(const PoseCovariance& covariance, const SolveOptions& options) {
  return covariance.allFinite() &&
         !ExceedsSigma(covariance.topLeftCorner<3, 3>(), options.max_sigma_rotation_rad) &&
         !ExceedsSigma(covariance.bottomRightCorner<3, 3>(), options.max_sigma_translation_m);
}

}  // namespace tbm
