#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pose/base/result.h"
#include "pose/rig/rig.h"

namespace tbm {

// One thing that is wrong in a rig file, or that looks like a slip of the pen.
struct RigFileFault {
  std::string file;
  int line = 0;      // 1 is the first; 0 when the file as a whole is meant
  std::string key;   // "camera.camera_matrix.data[4]"; empty when no key is meant
  std::string what;  // what is wrong, and what would be right

  // "rig.yaml:7: camera.residual_px: -1 is below 0; allowed is 0 .. 100 px"
  std::string Text() const;
};
using RigFileFaults = std::vector<RigFileFault>;

struct LoadedRig {
  Rig rig;
  RigFileFaults warnings;  // keys that nobody reads; a mistyped optional key would be lost silently
};

// The YAML of FORMATS §1 into SI units. All faults are collected, never only the first. The keys
// under `camera` may be pasted from a ROS camera_info or an OpenCV calibration file; keys of those
// that mean nothing here (projection_matrix, ..) are passed over.
Result<LoadedRig, RigFileFaults> ParseRig(std::string_view yaml, const std::string& file);

// The same from a file of at most 1 MB.
Result<LoadedRig, RigFileFaults> LoadRigFile(const std::string& path);

}  // namespace tbm
