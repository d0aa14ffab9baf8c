#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "devices/replay/csv.h"
#include "guidance/rail/rail_recording.h"
#include "guidance/rail_vision/target_mark.h"

namespace tbm {

struct RailTruthRow {
  Timestamp at;
  Eigen::Vector3d position_world_m;
  Eigen::Quaterniond world_from_imu;
};

// An image of a run; whether it can be read is found out when it is.
struct RailFrameFile {
  Timestamp stamped_at;  // by the camera's clock
  std::string path;
};

// A rail run's folder (FORMATS §5) as it was recorded.
struct RailRun {
  RailSetup setup;
  RailRecording recording;
  std::vector<RailTruthRow> truth;  // empty where nobody knows it
  // How each target looks, none where targets.csv does not say; of all or of no target.
  std::vector<std::optional<TargetMark>> marks;
  std::vector<RailFrameFile> frames;         // of the camera that sees targets
  std::vector<RailFrameFile> ground_frames;  // of the one that looks at the ground
  std::vector<std::string> warnings;
  std::vector<std::string> advice;  // what could be made of the folder before its line is
};

// Every fault with file, line and column: rows out of order, stamps that stand twice, names that
// nobody knows, sensors that show one and the same number, or their largest, for longer than noise
// allows.
Result<RailRun, FileFaults> ReadRailRun(const std::string& folder);

// The same of the texts of its files, by their names. What is not among them is not there.
using RailRunTexts = std::map<std::string, std::string, std::less<>>;
Result<RailRun, FileFaults> ParseRailRun(const std::string& folder, RailRunTexts texts);

// What a run has before it begins: rail.yaml and targets.csv.
Result<RailRun, FileFaults> ReadRailSetup(const std::string& folder);

}  // namespace tbm
