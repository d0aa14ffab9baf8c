#pragma once

#include <cmath>
#include <numbers>
#include <optional>

#include "pose/solve/integrity.h"
#include "tests/pose/solve/as_built.h"

namespace tbm::test {

// What every test of the checks looks at: field rig, 0.1 px centres, 0.005 degree tilts.
inline constexpr double kCentreSigmaPx = 0.1;
inline const double kTiltSigmaRad = DegToRad(0.005);

struct Drawn {
  AsBuilt built;
  Truth truth;
  PoseProblem problem;

  Eigen::Vector3d true_point() const {
    return truth.camera_from_target * built.rig.points[0].p_point_in_target;
  }
};

inline Drawn Draw(const Rig& nominal, double nearest_m, double furthest_m, Random& random) {
  Drawn drawn;
  drawn.built = DrawAsBuilt(nominal, random);
  TruthRange range;
  range.distance_min_m = nearest_m;
  range.distance_max_m = furthest_m;
  drawn.truth = DrawTruth(random, range);
  drawn.problem = Observe(drawn.built, nominal, drawn.truth, kCentreSigmaPx, kTiltSigmaRad, random);
  return drawn;
}

inline void KeepLeds(PoseProblem& problem, std::size_t count, Random& random) {
  while (problem.leds.size() > count) {
    problem.leds.erase(
        static_cast<std::size_t>(random.Index(static_cast<int>(problem.leds.size()))));
  }
}

// Moves one LED's centre in a random direction; gives the rig's index of that LED.
inline int DisplaceOneLed(PoseProblem& problem, double distance_px, Random& random) {
  LedObservation& led =
      problem.leds[static_cast<std::size_t>(random.Index(static_cast<int>(problem.leds.size())))];
  const double direction = random.Uniform(0.0, 2.0 * std::numbers::pi);
  led.pixel_px += distance_px * Eigen::Vector2d(std::cos(direction), std::sin(direction));
  return led.led_index;
}

// One output of one inclinometer, either way.
inline void DisplaceOneTilt(PoseProblem& problem, double angle_rad, Random& random) {
  auto& tilt = random.Unit() < 0.5 ? problem.target_tilt : problem.camera_tilt;
  auto& output = random.Unit() < 0.5 ? tilt->inclination.beta_rad : tilt->inclination.gamma_rad;
  output += random.Unit() < 0.5 ? -angle_rad : angle_rad;
}

// The last pose grown by what a machine can move between two frames, and off by as much.
inline PosePriorInfo DrawPrior(const Truth& truth, Random& random) {
  constexpr double kTurnRad = 1e-3;
  constexpr double kShiftM = 2e-3;
  PoseError off;
  off << random.Normal3(kTurnRad), random.Normal3(kShiftM);
  PosePriorInfo prior;
  prior.camera_from_target = Moved(truth.camera_from_target, off);
  prior.covariance.diagonal() << Eigen::Vector3d::Constant(kTurnRad * kTurnRad),
      Eigen::Vector3d::Constant(kShiftM * kShiftM);
  return prior;
}

}  // namespace tbm::test
