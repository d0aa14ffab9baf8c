#pragma once

#include <string>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct GroundRequest {
  std::string run;  // folder
  std::string out;
  bool force = false;
};

// `tbm ground`: how the ground went by between the images of a camera that looks down on it, as a
// displacement.csv, and beside it, as .json, where nothing could be told and why.
ExitCode RunGround(const GroundRequest& request, const Console& console);

}  // namespace tbm
