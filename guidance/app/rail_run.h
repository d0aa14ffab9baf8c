#pragma once

#include <optional>
#include <string>
#include <vector>

#include "devices/replay/csv.h"
#include "guidance/rail/rail_recording.h"

namespace tbm {

struct RailTruthRow {
  Timestamp at;
  Eigen::Vector3d position_world_m;
  Eigen::Quaterniond world_from_imu;
};

// A rail run's folder (FORMATS §5) as it was recorded.
struct RailRun {
  RailSetup setup;
  RailRecording recording;
  std::vector<RailTruthRow> truth;  // empty where nobody knows it
  std::vector<std::string> warnings;
};

// Every fault with file, line and column: rows out of order, stamps that stand twice, names that
// nobody knows, sensors that show one and the same number, or their largest, for longer than noise
// allows.
Result<RailRun, FileFaults> ReadRailRun(const std::string& folder);

}  // namespace tbm
