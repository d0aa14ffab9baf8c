#pragma once

#include <string>
#include <vector>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"
#include "guidance/rail/settlement.h"

namespace tbm {

struct SettleRequest {
  std::string base;                // line.csv of the first run
  std::vector<std::string> later;  // of one or more runs after it, in any order
  std::string out;                 // - is the standard output
  double step_m = 0.1;
  double level = 0.95;
  std::vector<double> alert_mm;  // up to three, ascending: watch, alert, alarm
  std::string plot;              // PNG; empty: none
  bool force = false;
};

// `tbm settle`: how much the rail went down from run to run, as a table, a picture and a summary.
ExitCode RunSettle(const SettleRequest& request, const Console& console);

// The picture of it, as a script for gnuplot: heights with their bounds, significant places, the
// trough that fits.
std::string SettlePlotScript(const Settlement& settlement,
                             const std::vector<std::string>& names,
                             const SettlementOptions& options);

}  // namespace tbm
