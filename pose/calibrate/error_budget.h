#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "pose/base/result.h"
#include "pose/calibrate/view_fit.h"
#include "pose/geometry/rigid3.h"
#include "pose/rig/rig.h"
#include "pose/solve/problem.h"

namespace tbm {

// What a rig's calibration, and the noise of one frame, are worth at its points: each source of
// error taken through the fused solver (derivation, and what is not in it: docs/calibration.md, 5).

enum class ErrorSource {
  kFocalLength,
  kPrincipalPoint,
  kDistortion,
  kLensResidual,    // what the lens model leaves at each LED
  kLeds,            // coordinates
  kCameraMounting,  // of the camera's inclinometer
  kTargetMounting,
  kPoint,  // the point's own coordinates
  kCentres,
  kTilts,  // noise of both inclinometers
};
inline constexpr std::size_t kErrorSources = 10;

// Covariances [m2] along right, up, along: up is against gravity, along the horizontal part of the
// camera's line of sight. The error is that of the point's place in `camera`.
struct PointBudget {
  std::array<Eigen::Matrix3d, kErrorSources> of;
  // Focal length, principal point and distortion together: they are correlated.
  Eigen::Matrix3d camera = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d calibration = Eigen::Matrix3d::Zero();  // does not average out
  Eigen::Matrix3d noise = Eigen::Matrix3d::Zero();        // of one frame
  double distance_m = 0.0;                                // from the camera

  Eigen::Matrix3d total() const { return calibration + noise; }
  const Eigen::Matrix3d& From(ErrorSource source) const {
    return of[static_cast<std::size_t>(source)];
  }
};

// How the machine stands while the budget is taken.
struct BudgetPlacement {
  Rigid3 camera_from_target;
  Eigen::Vector3d up_in_camera = -Eigen::Vector3d::UnitY();
};

struct BudgetOptions {
  double centre_sigma_px = 0.05;
  // Of fx fy cx cy k1 k2 p1 p2 k3. Empty: the rig's four sigmas, and nothing is known of the
  // distortion.
  std::optional<IntrinsicMatrix> intrinsics;
};

enum class BudgetFault {
  kNoFacing,   // which side of the board looks at the camera is not clear
  kLooksUp,    // the camera looks more up or down than ahead
  kLedUnseen,  // an LED lies outside the image
  kNoPose,     // the solver finds none
};
struct BudgetFailure {
  BudgetFault fault = BudgetFault::kNoPose;
  std::size_t led = 0;                                    // kLedUnseen
  PoseFailure pose_failure = PoseFailure::kNotConverged;  // kNoPose
};

// The middle of the LEDs on the camera's axis, so far away, both inclinometers level, the board
// facing the camera: with the direction `facing_in_target`, or with the axis of its frame that is
// next to the normal of its LEDs, on the side away from the rig's points.
Result<BudgetPlacement, BudgetFailure> StraightAhead(
    const Rig& rig, double distance_m, const std::optional<Eigen::Vector3d>& facing_in_target);

// One budget for each of the rig's points. Each parameter is moved by its sigma either way, the
// sensors see the world so made, and the solver is asked with the rig as it stands.
Result<std::vector<PointBudget>, BudgetFailure> BudgetOf(const Rig& rig,
                                                         const BudgetPlacement& placement,
                                                         const BudgetOptions& options);

}  // namespace tbm
