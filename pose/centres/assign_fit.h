#pragma once

#include <cstdint>
#include <span>

#include "pose/centres/assign_scene.h"
#include "pose/solve/normal_equations.h"

namespace tbm::assign {

// LED `led` of the rig is taken to be spot `spot` of the scene.
struct Match {
  int led = 0;
  int spot = 0;
  bool operator==(const Match&) const = default;
};
using Matches = FixedVector<Match, kMaxLeds>;  // by rising LED, each LED and each spot once

bool SameMatches(const Matches& a, const Matches& b);
bool Contains(const Matches& larger, std::span<const Match> smaller);
void Insert(Matches& matches, const Match& match);

enum class UsePrior { kNo, kYes };

// A pose for given matches: least squares over LED residuals, the tilts when the scene has them,
// and the prior when asked. Correlations between LEDs (intrinsics) are left to Judge.
struct Fit {
  Rigid3 camera_from_target;
  Factor6 factor;  // of its information, once Refine has been there
  double chi2 = 0.0;
};

// Gauss-Newton from `fit.camera_from_target`. False when an LED gets behind the camera or beyond
// the distances of the options, or the steps do not die away.
bool Refine(const Scene& scene, const Matches& matches, UsePrior use_prior, Fit& fit);

// Where an LED should be seen, and how surely.
struct Expected {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  // of the pose and the LED, not of a spot
};
bool Expect(const Scene& scene,
            int led,
            const Rigid3& camera_from_target,
            const PoseCovariance& covariance,
            Expected& expected);

// One by one takes the nearest spot of any LED still without one while it lies inside the gate, and
// fits again. Leaves `fit` at the pose of all matches; false when the fit breaks down on the way.
bool Extend(const Scene& scene, UsePrior use_prior, Matches& matches, Fit& fit);

// Largest chi2 that `dof` honest residuals reach, but for gate_sigma sigmas (Wilson-Hilferty).
double Chi2Gate(double dof, double gate_sigma);

}  // namespace tbm::assign
