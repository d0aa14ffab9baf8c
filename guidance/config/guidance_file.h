#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "guidance/axis/design_axis.h"
#include "guidance/config/machine_file.h"
#include "pose/base/result.h"
#include "pose/rig/dds_section.h"
#include "pose/rig/rig_file.h"

namespace tbm {

// guidance.yaml.
struct GuidanceConfig {
  std::string machine_file;
  DdsNetwork dds;
  std::string journal_folder;  // empty: no journal is kept
  std::chrono::minutes journal_file_length{30};
  std::int64_t journal_limit_bytes = 20'000'000'000;
};

// All faults are collected; each names file, line, key, and what would be right. `file` is for
// messages and for paths, which are relative to it.
Result<GuidanceConfig, RigFileFaults> ParseGuidanceConfig(std::string_view yaml,
                                                          const std::string& file);
Result<GuidanceConfig, RigFileFaults> LoadGuidanceConfig(const std::string& path);

// A file as it was read, for the journal.
struct ReadFile {
  std::string path;
  std::string content;
};

// Everything that a machine file names, read and checked: what guidance is made of.
struct GuidedMachine {
  Machine machine;
  Rig rig;
  DesignAxis axis;
  std::string machine_sha256;
  ReadFile machine_file;
  ReadFile rig_file;
  ReadFile axis_file;
};

// One line per fault, of all three files as far as they could be read.
using MachineFaults = std::vector<std::string>;

// `warnings` takes what looks like a slip of the pen and stops nobody.
Result<GuidedMachine, MachineFaults> LoadGuidedMachine(const std::string& machine_path,
                                                       MachineFaults* warnings);
// The same from texts that were read before.
Result<GuidedMachine, MachineFaults> ParseGuidedMachine(const ReadFile& machine_file,
                                                        const ReadFile& rig_file,
                                                        const ReadFile& axis_file,
                                                        MachineFaults* warnings);

}  // namespace tbm
