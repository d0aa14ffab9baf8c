#pragma once

#include <string>
#include <vector>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct GeometryRequest {
  std::string line;  // line.csv
  std::string out;   // - is the standard output
  double step_m = 0.25;
  std::vector<double> bases_m = {3.0, 6.0};  // of the twist
  double gauge_mm = 1435.0;
  bool force = false;
};

// `tbm geometry`: longitudinal level, alignment, cross level and twist of a line, after EN 13848-1.
ExitCode RunGeometry(const GeometryRequest& request, const Console& console);

}  // namespace tbm
