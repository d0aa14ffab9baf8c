#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "pose/base/result.h"

namespace tbm {

// One placement of a rig that carries a camera and an inclinometer (or a resting accelerometer)
// before a board that does not move.
struct TiltPlacement {
  Eigen::Matrix3d camera_from_board = Eigen::Matrix3d::Identity();
  Eigen::Vector3d up_in_housing = Eigen::Vector3d::UnitZ();  // unit vector, from the two angles
  double camera_sigma_rad = 0.0;                             // of camera_from_board, each axis, > 0
  double tilt_sigma_rad = 0.0;                               // of each of the two angles, > 0
};

// The reading of one placement against what all placements together say of it.
struct TiltReading {
  double off_rad = 0.0;    // between the up that was felt and the up that the board shows
  double sigma_rad = 0.0;  // what is expected of that, each way
  // By how much chi2 would fall without it, in how many directions others control it (0 .. 2), and
  // how far it is, in those, from where all others put it.
  double misfit = 0.0;
  int controlled = 0;
  double from_others_rad = 0.0;
};

// How the housing is built to the camera.
struct TiltRotation {
  Eigen::Matrix3d camera_from_housing = Eigen::Matrix3d::Identity();
  // Of the turn e, about the camera's axes [rad2]: R_true = Exp(e) R.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Eigen::Vector3d up_in_board = Eigen::Vector3d::UnitZ();
  double up_sigma_rad = 0.0;  // along its worse direction; 0 where it was given
  double chi2 = 0.0;          // of 2 n residuals, and of the up that was given
  int dof = 0;
  // By this, at most three, readings and boards differ more than was declared; covariance and
  // up_sigma_rad have it.
  double sigma_factor = 1.0;
  std::vector<TiltReading> readings;  // side by side with the placements
  int steps = 0;                      // of the augmented Lagrangian; 0 where there was none
};

enum class TiltRotationFault {
  kTooFew,      // under four placements, or under two where up is given
  kNoTilt,      // the housing stood the same way in all of them: only turned about the plumb line
  kOneAxis,     // it was tilted about one axis only
  kNoYaw,       // it was hardly turned about the plumb line
  kTooWeak,     // sigma would be above what was allowed, and none of the above is the reason
  kNoRotation,  // no rotation fits: placements exchanged, or the board moved
  kDoesNotFit   // some placements contradict all others: a reading mistyped, or of another one
};
// What is missing, for the person at the rig: "tilt it about the other axis as well".
const char* MissingMotion(TiltRotationFault fault);

// A placement whose reading measuring does not explain.
struct WrongTilt {
  std::size_t placement = 0;
  double off_rad = 0.0;    // from where all others put it, the other wrong ones left out
  double sigma_rad = 0.0;  // what measuring explains, each way
  std::vector<std::size_t> or_rather;  // contradict it as badly: one of them may be wrong instead
};

struct TiltRotationFailure {
  TiltRotationFault fault = TiltRotationFault::kTooFew;
  double sigma_rad = 0.0;        // what it would have been; NaN where that is not known
  std::vector<WrongTilt> wrong;  // kDoesNotFit: one or more. kNoRotation: the worst
  double sigma_factor = 1.0;     // kNoRotation: by this, more than three
};

struct TiltRotationOptions {
  // Up in the board's frame where it is known: the board was plumbed, or an inclinometer stood on
  // it. Unit vector; with its sigma.
  std::optional<Eigen::Vector3d> up_in_board;
  double up_sigma_rad = 0.0;
  double most_sigma_rad = 0.0035;  // 0.2 degree
  // For a first idea from rough sigmas: placements that do not fit are taken, and scale nothing.
  bool takes_misfits = false;
};

// Rotation between inclinometer and camera (rail-line paper, Eqs. 4 to 15: camera_j = C_ij taken to
// camera_i, all pairs): smallest singular vector as the start, augmented Lagrangian with closed
// steps, then Gauss-Newton on rotation and up together, which has the covariance. With up given the
// start is one singular value decomposition. Placements that do not fit the others are refused by
// number; where all fit worse than was declared, the covariance is scaled.
Result<TiltRotation, TiltRotationFailure> FindTiltRotation(
    std::span<const TiltPlacement> placements, const TiltRotationOptions& options);

// What a rig file calls the sigma of a mounting: of up in the body, along its worse direction,
// while the housing leans by `lean_rad` at the most. A turn of the housing about its own z axis,
// which tilts find worst, moves up only as far as it leans. `covariance` is about the body's axes.
double MountingSigma_rad(const Eigen::Matrix3d& covariance,
                         const Eigen::Matrix3d& housing_from_body,
                         double lean_rad = 0.1745);  // 10 degrees

// The parts, for tests and comparison. `Start...`: the rotation next to the null vector of the
// paper's A. `AugmentedLagrangian`: from any start; `steps` counts.
Eigen::Matrix3d StartTiltRotation(std::span<const TiltPlacement> placements);
Eigen::Matrix3d AugmentedLagrangianTiltRotation(std::span<const TiltPlacement> placements,
                                                const Eigen::Matrix3d& start,
                                                int* steps);
Eigen::Matrix3d KnownUpTiltRotation(std::span<const TiltPlacement> placements,
                                    const Eigen::Vector3d& up_in_board);

}  // namespace tbm
