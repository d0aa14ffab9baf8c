#pragma once

#include "pose/solve/problem.h"

namespace tbm {

struct StartPoses {
  // The best first. Two when both roots of a two-LED problem have positive depths, or when the
  // second minimum of more LEDs (of three, hardly ever of more) fits almost as well as the first.
  FixedVector<Rigid3, 2> camera_from_target;
};

// Linear start from LEDs and both tilts (pose paper, Eq. 14 with e9 read as c9), with
// alpha^2 + beta^2 = 1 imposed: t eliminated, the 2x2 form minimised on the circle, roots with an
// LED behind the camera dropped. Fewest LEDs: 2. Needs both tilts: kNotObservable without, and
// where two LEDs say nothing about yaw (one above the other, or both at camera height).
Result<StartPoses, PoseFailure> StartPose(const PoseProblem& problem);

// Eq. 14 as printed (plus e9 = c9): five linear unknowns, alpha and beta free, scaled to the circle
// afterwards. For comparison only: collapses when all LEDs stand at one height. Fewest LEDs: 3.
Result<Rigid3, PoseFailure> StartPoseLinear(const PoseProblem& problem);

}  // namespace tbm
