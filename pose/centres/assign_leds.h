#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "pose/base/result.h"
#include "pose/centres/centre.h"
#include "pose/solve/problem.h"

namespace tbm {

enum class AssignFailure {
  kTooFewCentres,  // fewer than two spots (fewer than three without tilts)
  kNoMatch,        // no set of spots can be the target
  kAmbiguous,      // a second assignment fits about as well
};

// What is known before looking. All of it optional except the tilts' role: with both tilts a pair
// of spots decides (NOTES §1); without, a prior pose or three spots do.
struct PosePrior {
  Rigid3 camera_from_target;
  // One sigma of where the target may be by now: the last pose's covariance grown by the motion the
  // machine can make since then.
  PoseCovariance covariance = PoseCovariance::Zero();
};

struct AssignOptions {
  double gate_sigma = 4.0;      // a spot further from an LED's image is not that LED
  double min_distance_m = 0.5;  // of any LED from the camera
  double max_distance_m = 20.0;
  double ambiguous_chi2_per_dof = 4.0;  // second best closer than this (and as many LEDs): say so
};

struct Assignment {
  LedObservations leds;                    // one spot per LED at the most, one LED per spot
  FixedVector<int, kMaxLeds> spot_of_led;  // parallel to leds: index into the centres
  Rigid3 camera_from_target;               // the start pose that the winner gives
  bool used_prior =
      false;  // the image alone was ambiguous (or had too little) and the prior decided
  bool without_tilts = false;
};

// Decides which spot is which LED. Never guesses: of two explanations that are about equally good
// it reports kAmbiguous.
Result<Assignment, AssignFailure> AssignLeds(const Rig& rig,
                                             const Centres& centres,
                                             const std::optional<TiltObservation>& target_tilt,
                                             const std::optional<TiltObservation>& camera_tilt,
                                             const std::optional<PosePrior>& prior,
                                             const AssignOptions& options = {});

// The retry for a frame whose tilts contradict the image: same spots, same tilts, but each output
// taken as uncertain by kDoubtSigmaRad, so that an inclinometer some degrees off still tells up
// from down and nothing finer. Four LEDs or more, or a prior; never clear with three alone.
//
// Call it when AssignLeds with tilts says kNoMatch or kAmbiguous: sharp tilts that are wrong leave
// the LEDs without a common pose, and the pairs of spots that remain are ambiguous. When it
// succeeds, solve without the tilts; the pose says by how much they are off. Without tilts the same
// as AssignLeds.
Result<Assignment, AssignFailure> AssignLedsDoubtingTilts(
    const Rig& rig,
    const Centres& centres,
    const std::optional<TiltObservation>& target_tilt,
    const std::optional<TiltObservation>& camera_tilt,
    const std::optional<PosePrior>& prior,
    const AssignOptions& options = {});

inline constexpr double kDoubtSigmaRad = 0.05;  // 3 degrees

}  // namespace tbm
