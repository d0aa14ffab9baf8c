#pragma once

#include <optional>

#include <Eigen/Core>

#include "pose/base/pose_reason.h"
#include "pose/solve/problem.h"

namespace tbm {

struct IntegrityOptions {
  double gate_false_alarm = 1e-3;   // chi2 gate on the whole problem
  double bound_risk = 1e-3;         // probability that the error exceeds `bound` (FORMATS §3)
};

// What the gate and the leave-one-out made of a problem.
struct CheckedPose {
  PoseEstimate pose;
  PoseStatus status = PoseStatus::kOk;
  PoseReason reason = PoseReason::kNone;
  std::uint32_t leds_used = 0;             // bit i: rig LED i is in the solution
  std::optional<int> excluded_led;         // rig LED index whose centre was left out
  bool tilts_used = false;
};

// Sigma and protection level of one named point in `camera`.
struct PointResult {
  Eigen::Vector3d p_in_camera = Eigen::Vector3d::Zero();  // [m]
  double sigma_m = 0.0;  // sqrt of the trace of its 3x3 covariance: one sigma of the 3-D distance
  // Protection level [m]: the error is larger with a probability of at most bound_risk as long as at
  // most one LED centre or tilt reading is wrong. Empty when nothing limits it (two LEDs, no prior).
  std::optional<double> bound_m;
};

using PointResults = FixedVector<PointResult, 16>;  // in the order of Rig::points

}  // namespace tbm
