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
  // Of a record of guidance only.
  std::string clock = "auto";     // auto, estimate, trust: what is done about the log's clock
  double clock_range_s = 7200.0;  // it is looked for within
  double log_sigma_mm = 0.0;      // of each coordinate of a shot
  std::string at;                 // time of shots that have none; empty: they must have one
  bool force = false;
};

// Compares poses with a total station's log, prints the figures and writes the report.
ExitCode RunCheck(const CheckRequest& request, const Console& console);

}  // namespace tbm
