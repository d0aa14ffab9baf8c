#pragma once

#include <cstdint>
#include <optional>
#include <variant>

#include <Eigen/Core>

#include "guidance/core/alarm_command.h"
#include "guidance/shield/uncertain.h"
#include "guidance/station/polar.h"
#include "pose/base/pose_reason.h"
#include "pose/base/time.h"
#include "pose/geometry/tilt.h"

namespace tbm {

// What guidance is told, one thing at a time, in the order in which it came.

// Where the total station saw a prism of the rear shield.
struct PrismSeen {
  std::uint64_t set_up_number = 0;
  std::size_t prism = 0;  // into Machine::prisms
  Timestamp sensed_at;
  Eigen::Vector3d p_in_site = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // [m^2] of this reading alone
  Eigen::Matrix<double, 3, 4> by_station = Eigen::Matrix<double, 3, 4>::Zero();
};

// How the station's set-up stands.
struct SetUpKnown {
  std::uint64_t number = 0;  // 0: there is none
  // Readings after this moment are not to be used; empty: all may be.
  std::optional<Timestamp> trusted_until;
  StationCovariance covariance = StationCovariance::Zero();
};

// What the camera box made of one exposure.
struct RelativeSeen {
  Timestamp sensed_at;
  PoseStatus status = PoseStatus::kNone;
  PoseReason reason = PoseReason::kNone;
  UncertainRigid3 camera_from_target;  // of no meaning with kNone
  bool tilts_used = false;
};

enum class TiltPlace { kTarget, kCamera };

// One reading of an inclinometer, in the pose paper's convention; without a value it failed.
struct TiltSeen {
  TiltPlace place = TiltPlace::kTarget;
  Timestamp sensed_at;
  std::optional<Inclination> inclination;
};

// AlarmOrder: what somebody asked of an alarm.
using GuidanceInput = std::variant<PrismSeen, SetUpKnown, RelativeSeen, TiltSeen, AlarmOrder>;

}  // namespace tbm
