#pragma once

#include <optional>
#include <string>

#include "guidance/app/axis_command.h"

namespace CLI {
class App;
}

namespace tbm {

// All options of `tbm axis`, filled in by the parser.
struct AxisRequests {
  AxisSource source;
  AxisCheckRequest check;
  AxisEvalRequest eval;
  AxisProjectRequest project;
  AxisPlotRequest plot;
  std::vector<double> origin_m;
  std::string check_format = "text";
};

// Adds `axis` with its commands check, eval, project and plot.
CLI::App* AddAxis(CLI::App& app, AxisRequests& requests);

// Runs the one that was parsed; `axis` is what AddAxis returned.
ExitCode RunAxis(const CLI::App& axis, AxisRequests& requests, const Console& console);

}  // namespace tbm
