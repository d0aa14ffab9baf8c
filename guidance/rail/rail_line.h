#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "guidance/rail/rail_filter.h"
#include "guidance/rail/rail_recording.h"
#include "guidance/rail/rail_start.h"
#include "pose/base/result.h"

namespace tbm {

enum class RailMethod { kFilter, kSmoothed };

// How well a point of the line is held.
enum class RailStatus {
  kFixed,    // targets, or rest, within a second before and after
  kBridged,  // between two of them, by the unit alone
  kOpen,     // nothing on one side: sigma grows without end
  kGap,      // samples of the unit are missing here
};
std::string_view Word(RailStatus status);  // "fixed", "bridged", "open", "gap"

// Where the unit was at the end of a sample.
struct RailPoint {
  Timestamp at;
  double distance_m = 0.0;  // run since the start, along the line
  Eigen::Vector3d position_world_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond world_from_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d sigma_world_m = Eigen::Vector3d::Zero();
  RailStatus status = RailStatus::kFixed;
};

// A constant of the trolley that was estimated on the way, and how much the run told of it.
struct RailEstimate {
  std::string what;  // "camera_time_offset_s", "gyro_bias_x_rad_s", ..
  double value = 0.0;
  double sigma = 0.0;
  double sigma_before = 0.0;
  // The run has told nothing of it; what motion would. Empty when it has.
  std::string missing_motion;
};

struct RailLine {
  std::vector<RailPoint> points;  // one for each sample
  std::vector<RailEstimate> estimates;
  std::array<RailConsistency, kFusionUpdates> consistency;
  std::vector<RailRejection> rejections;
  std::size_t target_modes = 0;
  double target_modes_left_out_m = 0.0;  // of the coordinate that it moves most
  std::vector<std::string> remarks;
};

// The line of a recorded run: start, filter, twice where the survey of the targets has to be taken
// into the state, and smoother (docs/filter.md). Pure: the same recording gives the same bits.
Result<RailLine, RailStartFailure> SolveRailLine(const RailSetup& setup,
                                                 const RailRecording& recording,
                                                 RailMethod method);

}  // namespace tbm
