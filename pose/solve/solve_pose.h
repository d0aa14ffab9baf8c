#pragma once

#include "pose/solve/problem.h"

namespace tbm {

// The default solver, `fused`: maximum likelihood over the six unknowns of camera_from_target from
// LED centres and both tilts, each weighted by its own sigma, calibration uncertainty included in
// the weights (papers/NOTES §1; derivation in pose/docs/pose_from_leds.md). Two LEDs are enough
// where the geometry allows. Without `start` the start is StartPose.
PoseResult SolveFused(const PoseProblem& problem,
                      const std::optional<Rigid3>& start = std::nullopt,
                      const SolveOptions& options = {});

// The same without the tilts: three LEDs or more; ambiguous with three unless started near.
// Without `start`: StartPose when tilts are there to start from, else the best of P3P over the
// LEDs.
PoseResult SolveVision(const PoseProblem& problem,
                       const std::optional<Rigid3>& start = std::nullopt,
                       const SolveOptions& options = {});

// Calls the one that `method` names (`published` is PenaltyPose of penalty_pose.h). Lives in the
// library tbm_pose_penalty, with Ceres; the two above need std and Eigen only.
PoseResult SolvePose(PoseMethod method,
                     const PoseProblem& problem,
                     const std::optional<Rigid3>& start = std::nullopt,
                     const SolveOptions& options = {});

}  // namespace tbm
