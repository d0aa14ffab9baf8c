#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "pose/base/result.h"
#include "pose/centres/centre.h"
#include "pose/solve/problem.h"

namespace tbm {

enum class AssignFailure {
  kTooFewCentres,  // fewer than two spots (fewer than three without sharp tilts)
  kNoMatch,        // no set of spots can be the target
  kAmbiguous,      // a second assignment fits about as well, or false spots might well fit as well
};

// Where the target may be before looking, for instance from the last frame.
struct PosePrior {
  Rigid3 camera_from_target;
  // One sigma of where the target may be by now: the last pose's covariance grown by the motion the
  // machine can make since then.
  PoseCovariance covariance = PoseCovariance::Zero();
};

struct AssignOptions {
  double gate_sigma = 4.0;      // a spot further from an LED's image is not that LED
  double min_distance_m = 0.5;  // depth of any LED in front of the camera
  double max_distance_m = 20.0;
  // Another assignment of as many LEDs whose chi2 is larger by less than this, per degree of
  // freedom of the better one, makes both ambiguous.
  double ambiguous_chi2_per_dof = 4.0;
};

struct Assignment {
  LedObservations leds;  // by rising LED index; one spot per LED, one LED per spot
  FixedVector<int, kMaxLeds> spot_of_led;  // parallel to leds: index into the centres
  Rigid3 camera_from_target;               // a start pose from all of them
  bool used_prior =
      false;  // the image alone was ambiguous, or had no sharp tilts, and the prior decided
  bool without_tilts = false;  // a tilt was missing or without an up vector, or both were doubted
};

// Decides which spot is which LED. Never guesses: of two explanations that are about equally good,
// or of one that false spots could offer as well, it reports kAmbiguous.
//
// Needs: with both tilts, three LEDs when little else shines, four among 20 false spots; with a
// prior, two. Two LEDs without a prior are always kAmbiguous (or kNoMatch): nothing checks them.
// Without tilts, three LEDs with a prior, four or five without. Brightness, spread and elongation
// of the spots are not used, except that the brightest spots are tried first.
//
// Work is bounded: pairs of LEDs are looked for among the 32 brightest spots, triples (without
// tilts) among the 12 brightest; the rest may only join. No heap; 90 kB of stack at the most. The
// order of the centres does not matter. Method, bounds and measured rates: pose/docs/which_led.md.
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
