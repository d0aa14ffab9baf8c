#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "guidance/rail/rail_recording.h"

namespace tbm {

// A trolley on the rail-line paper's Table 1 curve (its X, Y, Z are x, z, -y here), drawn from the
// paper and the data sheets alone: it shares no code with the fusion but the words of a recording.
// A natural cubic spline over the chord length through the eleven printed nodes, run at rest, with
// one smooth ramp up, evenly, and one smooth ramp down, at rest again.
struct RailScene {
  std::uint64_t seed = 1;
  double rest_s = 10.0;
  double speed_m_s = 0.27;
  double end_rest_s = 3.0;
  double rate_hz = 200.0;
  bool has_spread_targets = false;
  double image_late_s = 0.0;  // exposure after its stamp
  double wrong_matches = 0.0;
  double extrinsics_sigma_deg = 0.005;
  double extrinsics_sigma_m = 1e-4;
  double target_sigma_m = 3e-5;
  double turns_deg = 0.0;  // the trolley yaws, nods and rolls by so much on its way
  bool has_targets = true;
};

struct RailTruth {
  Timestamp at;
  Eigen::Vector3d position_world_m;
  Eigen::Quaterniond world_from_imu;
};

struct GeneratedRun {
  RailSetup setup;
  RailRecording recording;
  std::vector<RailTruth> truth;  // at the end of each sample
  Eigen::Vector3d gyro_bias_rad_s;
  Eigen::Vector3d accel_bias_m_s2;
  Eigen::Quaterniond camera_from_imu;  // as built; the set-up has it as calibrated
  Eigen::Vector3d camera_in_imu_m;
};

GeneratedRun GenerateRail(const RailScene& scene);

}  // namespace tbm
