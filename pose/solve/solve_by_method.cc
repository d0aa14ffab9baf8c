#include "pose/solve/penalty_pose.h"
#include "pose/solve/solve_pose.h"

namespace tbm {

PoseResult SolvePose(PoseMethod method,
                     const PoseProblem& problem,
                     const std::optional<Rigid3>& start,
                     const SolveOptions& options) {
  switch (method) {
    case PoseMethod::kFused:
      return SolveFused(problem, start, options);
    case PoseMethod::kPublished:
      return PenaltyPose(problem, start, options);
    case PoseMethod::kVision:
      return SolveVision(problem, start, options);
  }
  return Failure{PoseFailure::kNotConverged};
}

}  // namespace tbm
