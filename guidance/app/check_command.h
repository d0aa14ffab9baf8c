#pragma once

#include <string>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct CheckRequest {
  std::string poses;
  std::string log;
  std::string point;
  std::string log_point;  // the point's name in the log; empty: the same
  bool align_rigid = false;
  double tolerance_ms = 500.0;
  std::string report;  // folder; empty: only print
  bool force = false;
};

// Compares poses with a total station's log, prints the figures and writes the report.
ExitCode RunCheck(const CheckRequest& request, const Console& console);

}  // namespace tbm
