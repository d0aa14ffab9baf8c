#pragma once

#include <optional>

#include "pose/solve/problem.h"

namespace tbm::test {

// A weighted least-squares pose built from OpenCV parts only (SQPNP for the start, projectPoints
// with its Jacobian, solve for the normal equations) and shares no code with pose/solve. Weights
// are diagonal: centroid noise, calibration residual and LED sigma for a centre; tilt noise and
// mounting of both inclinometers for a tilt row. Needs four LEDs or more and both tilts.
std::optional<Rigid3> OpenCvWeightedPose(const PoseProblem& problem);

// OpenCV alone, as a user of it would write it: SQPNP, then ITERATIVE from there.
std::optional<Rigid3> OpenCvPose(const PoseProblem& problem);

}  // namespace tbm::test
