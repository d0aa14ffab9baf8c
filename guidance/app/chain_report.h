#pragma once

#include <optional>
#include <string>

#include "guidance/app/chain_check.h"
#include "guidance/app/check_command.h"
#include "guidance/app/check_report.h"

namespace tbm {

// What `tbm check` found out about a log's clock.
struct ClockFinding {
  std::optional<ClockEstimate> estimate;
  std::string why_not;  // a sentence, where there is none
  bool is_applied = false;
};

struct ChainFigures {
  ChainPairs pairs;
  ClockFinding clock;
  std::size_t other_points = 0;  // shots at points that guidance does not know
  std::size_t inside_95 = 0;
  double mean_standardised_2 = 0.0;  // 3 when the sigmas are what the errors are

  Spreads spreads() const;
};

ChainFigures FiguresOf(ChainPairs pairs);

// One sentence: how far off the clock is and what was done about it.
std::string ClockText(const ClockFinding& clock);

std::string ChainText(const ChainFigures& figures, const CheckRequest& request);
std::string ChainCsv(const ChainFigures& figures);
std::string ChainJson(const ChainFigures& figures, const CheckRequest& request);
// For gnuplot: the four quantities and the distance over its sigma, observation by observation.
std::string ChainPlot(const ChainFigures& figures);

}  // namespace tbm
