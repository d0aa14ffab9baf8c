#pragma once

#include <optional>

#include "tests/support/scene.h"

namespace tbm::test {

// The Cramer-Rao bound of camera_from_target at a true situation, in the order of rigid3.h.
//
// Shares nothing with pose/solve: sensors are the exact ones of scene.h, every derivative is a
// central difference, and what the rig declares uncertain (intrinsics, LED coordinates, mountings)
// and the two absolute tilts of the camera are further unknowns beside the pose, those of the rig
// with their sigma as prior. Empty when the information matrix is singular.
std::optional<PoseCovariance> IndependentBound(const Rig& rig,
                                               const Truth& truth,
                                               double centre_sigma_px,
                                               double tilt_sigma_rad,
                                               bool with_tilts = true);

// `pose` turned by R_true = Exp(turn) R, t_true = t + shift, with Eigen's angle and axis.
Rigid3 Displaced(const Rigid3& pose, const PoseError& error);

}  // namespace tbm::test
