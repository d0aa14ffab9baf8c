#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "guidance/core/machine.h"
#include "guidance/core/reason.h"
#include "guidance/shield/attitude.h"
#include "guidance/shield/coast.h"
#include "guidance/shield/deviation.h"
#include "guidance/shield/rear_shield.h"
#include "guidance/shield/trend.h"
#include "guidance/shield/uncertain.h"
#include "pose/base/fixed_vector.h"
#include "pose/base/time.h"

namespace tbm {

inline constexpr int kPredictions = 20;  // 1 .. 20 m ahead

// What a number is worth.
enum class Worth {
  kInvalid,   // there is none
  kDegraded,  // usable with its sigma; see the reason
  kValid,
};

struct ShieldState {
  Worth worth = Worth::kInvalid;
  GuidanceReason reason = GuidanceReason::kNone;
  double age_s = 0.0;  // of the oldest measurement it rests on
  UncertainRigid3 site_from_shield;
  Attitude attitude;
  Eigen::Matrix3d attitude_covariance = Eigen::Matrix3d::Zero();  // heading, pitch, roll [rad^2]
  double speed_m_per_s = 0.0;
  double speed_sigma_m_per_s = 0.0;
};

struct PointState {
  Worth worth = Worth::kInvalid;
  GuidanceReason reason = GuidanceReason::kNone;
  UncertainPoint p_in_site;
  Deviation deviation;
  std::optional<Slope> trend_right;
  std::optional<Slope> trend_up;
};

struct AheadState {
  double ahead_m = 0.0;
  Prediction right;
  std::optional<Prediction> up;
};

struct JointState {
  Articulation articulation;
  Eigen::Matrix3d articulation_covariance = Eigen::Matrix3d::Zero();  // right, up, roll [rad^2]
  std::optional<double> stroke_m;
  double stroke_sigma_m = 0.0;
};

// How one source of the numbers stands.
struct SourceState {
  Freshness freshness = Freshness::kMissing;
  std::optional<double> age_s;  // of its last usable measurement
};

// All that was concluded at one step. What is absent is not known.
struct Snapshot {
  Timestamp at;        // `now` of the step
  Timestamp valid_at;  // the moment that the poses are of: the exposure's, or `at`
  std::uint64_t set_up_number = 0;
  ShieldState rear;
  ShieldState front;
  std::optional<Lead> lead;         // of the front shield
  std::optional<JointState> joint;  // front against rear, while there is a relative pose
  std::optional<std::int64_t> ring_number;
  FixedVector<PointState, kMaxGuidedPoints> points;    // in the order of Machine::points
  FixedVector<AheadState, kPredictions> ahead;         // of Machine::steer_by
  std::optional<RearShieldFix> fix;                    // the last usable one of the rear shield
  GuidanceReason fix_trouble = GuidanceReason::kNone;  // why the last attempt gave none
  PoseReason camera_trouble = PoseReason::kNone;       // of the last relative pose
  SourceState station;
  SourceState camera;
  SourceState target_tilt;
  SourceState camera_tilt;
};

}  // namespace tbm
