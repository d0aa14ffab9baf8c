#pragma once

#include <optional>
#include <string>
#include <vector>

#include "guidance/app/rail_words.h"
#include "guidance/app/run_folders.h"
#include "guidance/config/rail_line_file.h"

namespace tbm {

// A finished line against `settlement.base`.
struct LineComparison {
  std::vector<dds::SettlementPiece> pieces;
  std::size_t alert = 0;        // highest size of settlement.alert_mm that a place reached; 0: none
  std::size_t datum_alert = 0;  // that the shift of the whole line reached
  std::string told;             // in a sentence
};

// What became of a run: a line, or why there is none; and what it was compared with.
struct RailOutcome {
  std::optional<FinishedLine> line;
  std::vector<std::string> troubles;  // why there is no line, the first first; paths in the run
  std::vector<std::string> warnings;  // what is odd about the run, with or without a line
  std::optional<LineComparison> comparison;
  std::string no_comparison;  // why there is none, where a base is given
};

// Makes both files of the run `name` at once, by the way of `tbm line`: in `lines`, whole or not at
// all.
RailOutcome MakeOutcome(const RailLineConfig& config,
                        const RunFolders& folders,
                        const std::string& name);

// Why no line can be compared with `settlement.base`; empty where one can, or where none is given.
std::optional<std::string> BaseFault(const RailLineConfig& config);

}  // namespace tbm
