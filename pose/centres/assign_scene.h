#pragma once

#include <optional>

#include <Eigen/Core>

#include "pose/base/fixed_vector.h"
#include "pose/centres/assign_leds.h"
#include "pose/centres/centre.h"
#include "pose/geometry/rigid3.h"
#include "pose/rig/rig.h"
#include "pose/solve/problem.h"

// Inside of AssignLeds: what the search looks at. Equations: pose/docs/which_led.md.
namespace tbm::assign {

using Information = Eigen::Matrix<double, 6, 6>;

// One candidate spot. `ray_in_camera` has z = 1.
struct Spot {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  Eigen::Vector3d ray_in_camera = Eigen::Vector3d::UnitZ();
  double own_sigma_px = 0.0;  // of this centre alone, never below kLeastSigmaPx
  double sigma_px = 0.0;      // with the calibration residual
  int index = 0;              // into the caller's centres
};
using Spots = FixedVector<Spot, kMaxCentres>;

// The two up vectors and what they are worth, each covariance in the frame of its own body.
// The principal point is part of the camera's: moved by one pixel it turns every ray by 1 / f,
// which no image tells from a turned inclinometer.
struct UpPair {
  Eigen::Vector3d up_in_camera = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d up_in_target = Eigen::Vector3d::UnitZ();
  Eigen::Matrix3d covariance_in_camera = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d covariance_in_target = Eigen::Matrix3d::Zero();
};

struct PriorPull {
  Rigid3 camera_from_target;
  Information information = Information::Zero();
};

struct Scene {
  const Rig* rig = nullptr;
  Spots spots;  // brightest first, ties by place: the caller's order does not matter
  std::optional<UpPair> ups;
  // Tilts good enough to fix the vertical of a pair of spots; worse ones only weigh in a fit.
  bool ups_are_sharp = false;
  std::optional<TiltObservation> target_tilt;  // both present exactly when `ups` is
  std::optional<TiltObservation> camera_tilt;
  std::optional<PriorPull> prior;
  AssignOptions options;
  double spot_area_px2 = 0.0;  // over which the spots are spread
};

// A centre better than this is not believed: below it lens and finder are never known.
inline constexpr double kLeastSigmaPx = 0.03;

// A spot worse than this says nothing about a pose, yet would fit beside nearly every LED: glare
// that an LED stands in, two lamps run into one.
inline constexpr double kLargestSigmaPx = 2.0;

// One sigma of the angle between the two verticals, about any one axis [rad].
double UpSigma(const UpPair& ups);

// Above this the two verticals are not sharp: a pair of spots then fixes no pose.
inline constexpr double kSharpUpSigmaRad = 0.01;

// Spots outside the lens model, with a pixel or sigma that is not finite, or with a negative sigma
// are left out, and those worse than kLargestSigmaPx. Tilts without an up vector and priors without
// an inverse count as absent.
Scene MakeScene(const Rig& rig,
                const Centres& centres,
                const std::optional<TiltObservation>& target_tilt,
                const std::optional<TiltObservation>& camera_tilt,
                const std::optional<PosePrior>& prior,
                const AssignOptions& options);

// The same scene with tilts that may be wrong by several degrees: kDoubtSigmaRad for each output.
Scene Doubting(const Scene& scene);

}  // namespace tbm::assign
