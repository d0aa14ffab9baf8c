#pragma once

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "devices/replay/run_reader.h"
#include "pose/frame/frame_solver.h"

namespace tbm::test {

// What a recorded run really was, one row per frame. Read here with a few lines of its own: truth
// has nothing to do with the product's readers.
struct TruthRow {
  std::int64_t stamp_ns = 0;
  Rigid3 camera_from_target;
  Eigen::Vector3d head_in_camera_m = Eigen::Vector3d::Zero();
  int leds_visible = 0;
  std::string note;
};

inline std::vector<TruthRow> ReadTruth(const std::string& folder) {
  std::ifstream file(folder + "/truth.csv");
  std::string line;
  std::getline(file, line);
  std::vector<TruthRow> rows;
  while (std::getline(file, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    TruthRow row;
    double q[4];
    Eigen::Vector3d t_mm;
    Eigen::Vector3d head_mm;
    fields >> row.stamp_ns >> q[0] >> q[1] >> q[2] >> q[3] >> t_mm.x() >> t_mm.y() >> t_mm.z() >>
        head_mm.x() >> head_mm.y() >> head_mm.z() >> row.leds_visible >> row.note;
    row.camera_from_target.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
    row.camera_from_target.translation = 1e-3 * t_mm;
    row.head_in_camera_m = 1e-3 * head_mm;
    rows.push_back(row);
  }
  return rows;
}

// Folder of a recorded run that comes with the project's specification; empty when it is not there.
inline std::string SharedRun(const std::string& name) {
  const char* given = std::getenv("TBM_SHARED");
  const std::string shared = given != nullptr ? given : std::string(TBM_SOURCE_DIR) + "/../shared";
  const std::string folder = shared + "/data/" + name;
  return std::ifstream(folder + "/frames.csv").good() ? folder : std::string();
}

// One recorded run through the frame solver, as `tbm solve` does it.
inline std::vector<FrameResult> SolveRun(const RecordedRun& run,
                                         const FrameSolverOptions& options = {}) {
  FrameSolver solver(run.rig, options);
  TiltFeed tilts(run);
  std::vector<FrameResult> results;
  for (std::size_t i = 0; i < run.frames.size(); ++i) {
    for (const TiltReading& reading : tilts.Before(i)) solver.AddTilt(reading);
    const ImageResult image = ReadFrame(run, i);
    FrameInput input;
    input.sensed_at = run.frames[i].sensed_at;
    if (image) {
      input.image = image->View();
    } else {
      input.image_fault = ReasonOf(image.error().failure);
    }
    results.push_back(solver.Solve(input));
  }
  return results;
}

#define TBM_SKIP_WITHOUT(folder)                                                               \
  if ((folder).empty()) {                                                                      \
    GTEST_SKIP() << "the recorded runs are not here; set TBM_SHARED to the folder that holds " \
                    "data/";                                                                   \
  }

}  // namespace tbm::test
