#pragma once

#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "pose/base/fixed_vector.h"
#include "pose/base/pose_reason.h"
#include "pose/base/result.h"
#include "pose/solve/problem.h"

namespace tbm {

struct IntegrityOptions {
  double gate_false_alarm = 1e-3;  // chi2 gate on the whole problem
  double bound_risk = 1e-3;        // probability that the error exceeds `bound` (FORMATS §3)
  // Share of bound_risk: an explanation whose own residuals are rarer than this is dropped.
  double implausible_risk = 1e-4;
  // A reading is named beyond doubt only when leaving it out lowers chi2 by this much more than
  // leaving out any other: odds of 100 to 1 between two explanations with equally many unknowns.
  double isolation_chi2 = 9.2;
  // Where more than one exclusion mends a problem, there is a pose all the same (`doubtful`, its
  // bound covers all of them) as long as chi2 of the whole is not rarer than this. Beyond it the
  // solutions lie too far apart for one linearisation.
  double doubt_limit = 1e-9;
  // The tilts are part of what "everything expected" means. False for vision by choice.
  bool expect_tilts = true;
  // A subset of the readings that leaves a larger sigma than this in any direction limits nothing:
  // the prior has to. Beyond it the linearisation would not be honest either.
  double max_sigma_rotation_rad = 0.0175;
  double max_sigma_translation_m = 0.100;
};

// Where the target may be without looking at this frame: the last accepted pose, its covariance
// grown by the motion that the machine can have made since.
struct PosePriorInfo {
  Rigid3 camera_from_target;
  PoseCovariance covariance = PoseCovariance::Zero();
};

// What the gate and the leave-one-out made of a problem.
struct CheckedPose {
  PoseEstimate pose;
  PoseStatus status = PoseStatus::kOk;
  PoseReason reason = PoseReason::kNone;
  std::uint32_t leds_used = 0;      // bit i: rig LED i is in the solution
  std::optional<int> excluded_led;  // rig LED index whose centre was left out
  bool tilts_used = false;
  // The gate closed, and the reading left out is only the likeliest of several that may be wrong.
  bool doubtful = false;
};

// Sigma and protection level of one named point in `camera`.
struct PointResult {
  Eigen::Vector3d p_in_camera = Eigen::Vector3d::Zero();  // [m]
  double sigma_m = 0.0;  // sqrt of the trace of its 3x3 covariance: one sigma of the 3-D distance
  // Protection level [m]: the error is larger with a probability of at most bound_risk as long as
  // at most one LED centre or tilt reading is wrong. Empty when nothing limits it (two LEDs, no
  // prior).
  std::optional<double> bound_m;
};

using PointResults = FixedVector<PointResult, 16>;  // in the order of Rig::points

// Solves (fused with both tilts, else vision), gates chi2, and when the gate closes looks for the
// one reading that is wrong: an LED's centre or the tilts. Both inclinometers count as one reading,
// since only together they say something about the relative pose; which of the two lies is for the
// history of each to tell.
//
// Where the image cannot decide which reading it is (three LEDs and tilts have no redundancy left
// with one out) the prior does, if there is one. What remains in doubt says so.
//
// Status ok: all LEDs of the rig and the tilts used, gate passed. Degraded, the first that applies:
// kLedExcluded, kTiltDisagrees, kTwoLeds, kFewLeds, kTiltMissing (the caller knows better why a
// tilt is missing). The failure is the reason of status none: those of the solver, kInconsistent
// when no single exclusion mends it, kAmbiguous when more than one does.
Result<CheckedPose, PoseReason> CheckPose(const PoseProblem& problem,
                                          const std::optional<Rigid3>& start,
                                          const std::optional<PosePriorInfo>& prior,
                                          const IntegrityOptions& options = {},
                                          const SolveOptions& solve_options = {});

// Sigma and protection level of each point of the rig, for a pose that CheckPose made of `problem`.
// Solution separation over "nothing wrong", "this LED's centre wrong" for each LED, and "tilts
// wrong": pose/docs/integrity.md. No heap.
PointResults CheckPoints(const PoseProblem& problem,
                         const CheckedPose& checked,
                         const std::optional<PosePriorInfo>& prior,
                         const IntegrityOptions& options = {});

}  // namespace tbm
