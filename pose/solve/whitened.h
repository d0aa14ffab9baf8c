#pragma once

#include <optional>

#include <Eigen/Core>

#include "pose/solve/linearised.h"

namespace tbm {

inline constexpr int kNothingOmitted = -1;

// Normal equations of a pose problem of which two rows may have been left out, with everything
// those rows could say removed: information * e = gradient has the pose error e that leads from the
// linearisation pose to the least-squares solution of the rows that are left.
struct SubsetNormal {
  PoseCovariance information = PoseCovariance::Zero();
  PoseError gradient = PoseError::Zero();
  double residual_squared = 0.0;  // of the whitened rows at the linearisation pose
  int rows = 0;                   // that are left
};

struct SubsetSolution {
  PoseError e = PoseError::Zero();
  PoseCovariance covariance = PoseCovariance::Zero();
  double chi2 = 0.0;
};

// A linearised problem with independent rows of unit variance.
class WhitenedProblem {
 public:
  WhitenedProblem() {
  }  // nothing in it; not defaulted, which would fill the room for 66 rows with zeros

  // Empty when Linearise has nothing to say or the covariance is not positive definite.
  static std::optional<WhitenedProblem> From(const PoseProblem& problem, const Rigid3& pose);

  // Leaves out rows `omitted` and `omitted` + 1, an LED's or the tilts'. The rows that stay keep
  // their own covariance: leaving rows out is the same as giving each of them a free unknown of its
  // own, and in whitened form that is a projection (pose/docs/integrity.md, section 2).
  SubsetNormal Without(int omitted) const;

  int led_rows() const { return led_rows_; }
  int tilt_rows() const { return tilt_rows_; }

 private:
  LinearisedProblem::RowsByPose by_pose_;
  LinearisedProblem::Rows residual_;
  LinearisedProblem::RowsCovariance inverse_root_;  // L^-1 of covariance = L L^T
  SubsetNormal all_;                                // nothing left out
  int led_rows_ = 0;
  int tilt_rows_ = 0;
};

// Empty when the information is singular.
std::optional<SubsetSolution> Solve(const SubsetNormal& normal);

}  // namespace tbm
