#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "pose/base/fixed_vector.h"
#include "pose/base/pose_reason.h"
#include "pose/base/result.h"
#include "pose/geometry/rigid3.h"
#include "pose/geometry/tilt.h"
#include "pose/rig/rig.h"

namespace tbm {

// One LED seen in the image and known by name.
struct LedObservation {
  int led_index = 0;                                   // into Rig::leds
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();  // its centre
  double sigma_px = 0.0;  // of this centre alone; the rig's residual and LED sigma are added inside
};
using LedObservations = FixedVector<LedObservation, kMaxLeds>;

// One inclinometer's reading at the middle of the exposure, in the paper's convention.
struct TiltObservation {
  Inclination inclination;
  double sigma_rad = 0.0;  // of this sample, per output; the rig's mounting sigma is added inside
};

// Everything one pose is made of. The rig outlives the problem.
struct PoseProblem {
  const Rig* rig = nullptr;
  LedObservations leds;
  std::optional<TiltObservation> target_tilt;  // both or the tilts cannot be used: one inclinometer
  std::optional<TiltObservation> camera_tilt;  // alone says nothing about the relative pose
};

enum class PoseMethod { kFused, kPublished, kVision };

// Why a solver gave no pose. Each maps to one PoseReason.
enum class PoseFailure {
  kTooFewLeds,     // fewer than the method needs
  kNotObservable,  // predicted covariance beyond the limits of SolveOptions
  kBehindCamera,
  kNotConverged,
  kAmbiguous,  // several poses explain the sightings equally well and no start decides
};
PoseReason ReasonOf(PoseFailure failure);

struct SolveOptions {
  int max_iterations = 20;
  // A pose whose one-sigma exceeds these in any direction is refused as not observable.
  double max_sigma_rotation_rad = 0.0175;  // 1 degree
  double max_sigma_translation_m = 0.100;
};

// A pose and what it is worth.
//
// `covariance` holds everything the rig declares: centroid noise, calibration residual, LED
// coordinates, intrinsics, tilt noise and mounting. Order and perturbation: rigid3.h.
struct PoseEstimate {
  Rigid3 camera_from_target;
  PoseCovariance covariance = PoseCovariance::Zero();
  double chi2 = 0.0;    // of whitened residuals; NaN for methods without a noise model
  int dof = 0;          // 2 LEDs + 2 tilts - 6; 0 when nothing is left over to check
  double rms_px = 0.0;  // of LED residuals, per axis, unweighted
  int iterations = 0;
};

using PoseResult = Result<PoseEstimate, PoseFailure>;

}  // namespace tbm
