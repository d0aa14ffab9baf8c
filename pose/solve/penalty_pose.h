#pragma once

#include "pose/solve/problem.h"

namespace tbm {

struct PenaltyOptions {
  double penalty = 1e6;        // M of Eq. 18; the image coordinates are in mm, lengths in mm
  bool k8_as_printed = false;  // true drives the yaw to +-45 degrees: for the test that shows it
};

// Eq. 18 as published, twelve unknowns, with Ceres. The result is re-orthogonalised; covariance is
// that of the equality-constrained problem with the problem's sigmas; chi2 is NaN. Fewest LEDs: 3.
PoseResult PenaltyPose(const PoseProblem& problem,
                       const std::optional<Rigid3>& start = std::nullopt,
                       const SolveOptions& options = {},
                       const PenaltyOptions& penalty = {});

}  // namespace tbm
