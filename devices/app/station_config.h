#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "devices/total_station/total_station_config.h"
#include "guidance/core/machine.h"
#include "guidance/station/station_keeper.h"
#include "pose/base/result.h"
#include "pose/rig/dds_section.h"
#include "pose/rig/rig_file.h"

namespace tbm {

// What a distance needs beside the reading.
struct DistanceConfig {
  Air air;
  DistanceMeter meter;
  // Of a model that does not tell what it has applied itself; empty: such a distance is not used.
  std::optional<double> assumed_prism_constant_m;
  std::optional<double> assumed_ppm;
};

// total_station.yaml, in SI units. Paths are already relative to the working directory. What the
// machine file says (prisms) is not in `keeper` yet: KeeperOptionsOf.
struct StationConfig {
  std::string machine_file;
  std::string station = "TS-1";  // the instrument's name on DDS
  TotalStationConfig instrument;
  DistanceConfig distance;
  KeeperOptions keeper;
  std::vector<double> reference_constants_m;  // prism constant of each reference
  double prism_constant_m = 0.0;              // of the shield's prisms
  double low_power_percent = 15.0;
  Duration silent_after = std::chrono::seconds(10);
  int missed_rounds = 3;  // in a row, before a prism is alarmed as not found
  std::string state_file;
  DdsNetwork dds;
};

// The YAML text of a config. All faults are collected; each names file, line, key, and what would
// be right. `file` is for messages and for paths, which are relative to it. A CSV with references
// is read from its file.
Result<StationConfig, RigFileFaults> ParseStationConfig(std::string_view yaml,
                                                        const std::string& file);

// The same from a file of at most 1 MB.
Result<StationConfig, RigFileFaults> LoadStationConfig(const std::string& path);

// What the keeper needs of both files.
KeeperOptions KeeperOptionsOf(const StationConfig& config, const Machine& machine);

}  // namespace tbm
