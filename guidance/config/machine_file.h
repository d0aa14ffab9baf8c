#pragma once

#include <string>
#include <string_view>

#include "guidance/config/axis_file.h"
#include "guidance/core/machine.h"
#include "pose/base/result.h"
#include "pose/rig/rig_file.h"

namespace tbm {

// machine.yaml: geometry, prisms, points, limits; and where rig and design axis are to be found.
struct MachineFile {
  Machine machine;
  std::string sha256;    // of the bytes, what `sha256sum` prints
  std::string rig_file;  // relative to the working directory
  std::string axis_file;
  AxisFileOptions axis_options;
};

// The YAML text of a machine. All faults are collected; each names file, line, key, and what would
// be right. `file` is for messages and for paths, which are relative to it. Every key and its
// meaning: guidance/app/example/machine.yaml.
Result<MachineFile, RigFileFaults> ParseMachineFile(std::string_view yaml, const std::string& file);

// The same from a file of at most 1 MB.
Result<MachineFile, RigFileFaults> LoadMachineFile(const std::string& path);

}  // namespace tbm
