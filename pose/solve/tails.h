#pragma once

#include <Eigen/Core>

namespace tbm {

// P(X > chi2) for X chi-squared with `dof` >= 1 degrees of freedom. Closed form, exact to rounding
// for every dof a pose problem can have; 1 for chi2 <= 0, 0 for NaN (a residual that is no number
// fits nothing).
double ChiSquaredTail(double chi2, int dof);

// Radius [m] of a ball that an error e ~ N(0, covariance) leaves with a probability of at most
// `risk`. Exact where the two smaller eigenvalues are equal or vanish, never too small elsewhere:
// the smallest is raised to the middle one, which leaves a one-dimensional integral
// (pose/docs/integrity.md, section 4). Between 3.32 (one direction dominates) and 4.06 (all alike)
// sigma for a risk of 9e-4.
double ErrorRadius(const Eigen::Matrix3d& covariance, double risk);

}  // namespace tbm
