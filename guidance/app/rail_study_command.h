#pragma once

#include <cstdint>
#include <string>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct RailStudyRequest {
  std::string out = "rail_study";  // folder
  int draws = 10;                  // runs of each kind
  std::uint64_t seed = 1;          // of the first run
  bool force = false;
};

// Runs a simulated trolley along the curve of the rail-line paper's Table 1, with a board of
// targets and with targets spread in depth as well, and writes what each way to a line makes of it,
// beside what the paper's Table 2 prints: rail_study.csv, rail_study.txt.
ExitCode RunRailStudy(const RailStudyRequest& request, const Console& console);

}  // namespace tbm
