#pragma once

#include <functional>
#include <string>
#include <vector>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"
#include "pose/base/result.h"

namespace tbm {

struct LineRequest {
  std::string run;  // folder
  std::string out;
  std::string method = "smoothed";  // inertial, filter, smoothed
  bool force = false;
};

// Writes the line and what it rests on, and returns a summary; or every reason why there is no
// line. What is odd about the run and does not stop it goes to `warn`.
Result<std::string, std::vector<std::string>> WriteLine(
    const LineRequest& request, const std::function<void(const std::string&)>& warn);

// `tbm line`: the line of a rail run as a table, and beside it, as .json, what it rests on.
ExitCode RunLine(const LineRequest& request, const Console& console);

}  // namespace tbm
