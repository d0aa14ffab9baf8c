#pragma once

#include <string>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct TargetsRequest {
  std::string run;  // folder
  std::string out;
  bool force = false;
};

// `tbm targets`: the image points of surveyed targets in a rail run's images, as a centres.csv, and
// beside it, as .json, what was not found and why.
ExitCode RunTargets(const TargetsRequest& request, const Console& console);

}  // namespace tbm
