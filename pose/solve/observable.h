#pragma once

#include "pose/solve/problem.h"

namespace tbm {

// Whether the one-sigma of every direction is finite and within the limits of `options`.
bool IsObservable(const PoseCovariance& covariance, const SolveOptions& options);

}  // namespace tbm
