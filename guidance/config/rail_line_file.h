#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "devices/imu/stim_config.h"
#include "devices/inclinometer/inclinometer_config.h"
#include "pose/base/result.h"
#include "pose/base/time.h"
#include "pose/rig/dds_network.h"
#include "pose/rig/rig_file.h"

namespace tbm {

// A recorded run that is played as if its instruments were there.
struct RailReplayConfig {
  std::string run_folder;
  double speed = 1.0;        // > 0, times as fast as it was
  double image_delay_s = 0;  // from the stamp of an image until its targets are found
};

// The instruments themselves.
struct RailDevicesConfig {
  std::string setup_folder;  // rail.yaml and targets.csv
  StimConfig imu;
  std::optional<InclinometerConfig> inclinometer;
  // Image points of targets come from the topic frame_features: led_index counts the rows of
  // targets.csv from 0, up to the 32 that the topic can name.
  bool has_target_pixels = false;
};

// rail_line.yaml, in SI units. Paths are relative to the working directory.
struct RailLineConfig {
  std::string machine_id;
  // One of the two.
  std::optional<RailReplayConfig> replay;
  std::optional<RailDevicesConfig> devices;
  std::string runs_folder;   // what is measured, a folder for each run
  std::string lines_folder;  // what comes of it, a folder for each run
  double lag_s = 0.6;        // RailTrackerSettings
  double imu_silent_after_s = 0.5;
  double publish_step_m = 0.1;  // between the places of a finished line on DDS
  double hold_s = 2.0;          // how long the finished line can be had from DDS
  // The line that a finished one is compared with; empty: with none.
  std::string base_line;
  double settlement_step_m = 0.1;
  double settlement_level = 0.95;
  std::vector<double> alert_m;             // ascending
  std::optional<Timestamp> calibrated_at;  // of rail.yaml: midnight of the day
  std::optional<double> calibration_due_days;
  DdsNetwork dds;
};

// All faults are collected; each names file, line, key, and what would be right. `file` is for
// messages and for paths, which are relative to it.
Result<RailLineConfig, RigFileFaults> ParseRailLineConfig(std::string_view yaml,
                                                          const std::string& file);
Result<RailLineConfig, RigFileFaults> LoadRailLineConfig(const std::string& path);

}  // namespace tbm
