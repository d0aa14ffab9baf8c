#pragma once

#include <string>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct LineRequest {
  std::string run;  // folder
  std::string out;
  std::string method = "smoothed";  // inertial, filter, smoothed
  bool force = false;
};

// `tbm line`: the line of a rail run as a table, and beside it, as .json, what it rests on.
ExitCode RunLine(const LineRequest& request, const Console& console);

}  // namespace tbm
