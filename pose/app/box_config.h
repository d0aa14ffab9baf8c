#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "devices/camera/camera.h"
#include "devices/inclinometer/inclinometer_config.h"
#include "pose/base/result.h"
#include "pose/frame/frame_solver.h"
#include "pose/rig/dds_section.h"
#include "pose/rig/rig_file.h"

namespace tbm {

struct BoxRecordingConfig {
  std::string folder;  // empty: no recording
  std::chrono::minutes run_length{10};
  std::int64_t limit_bytes = 2'000'000'000;  // the oldest runs are deleted beyond it
};

// camera_box.yaml, in SI units. Paths are already relative to the working directory.
struct BoxConfig {
  std::string machine_id;
  std::string rig_file;
  CameraConfig camera;
  InclinometerConfig target_inclinometer;
  InclinometerConfig camera_inclinometer;
  FrameSolverOptions solver;
  // How long a frame waits for inclinometer readings that are younger than its exposure.
  std::chrono::milliseconds tilt_wait{60};
  bool exposure_control = true;
  DdsNetwork dds;
  BoxRecordingConfig recording;
};

// The YAML text of a config. All faults are collected; each names file, line, key, and what would
// be right. `file` is for messages and for paths, which are relative to it.
Result<BoxConfig, RigFileFaults> ParseBoxConfig(std::string_view yaml, const std::string& file);

// The same from a file of at most 1 MB.
Result<BoxConfig, RigFileFaults> LoadBoxConfig(const std::string& path);

}  // namespace tbm
