#pragma once

#include <string>
#include <string_view>

#include "guidance/rail/rail_recording.h"
#include "pose/rig/rig_file.h"

namespace tbm {

// What a bias wanders by within its instability takes about this long.
inline constexpr double kBiasTime_s = 100.0;

// rail.yaml (FORMATS §5) in SI units. All faults are collected, never only the first.
Result<RailSetup, RigFileFaults> ParseRailSetup(std::string_view yaml, const std::string& file);

}  // namespace tbm
