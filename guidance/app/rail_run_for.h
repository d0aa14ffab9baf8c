#pragma once

#include <optional>
#include <string>

#include "guidance/app/console.h"
#include "guidance/app/rail_run.h"
#include "guidance/app/table_and_report.h"

namespace tbm {

// The run that a command reads, once it is sure that its files can be written. Warnings are told.
// Empty when something stands in the way, which is told as well.
inline std::optional<RailRun> RailRunFor(const std::string& folder,
                                         const TableAndReport& files,
                                         const Console& console) {
  if (const auto obstacle = files.Obstacle()) {
    Complain(console, *obstacle);
    return std::nullopt;
  }
  auto run = ReadRailRun(folder);
  if (!run) {
    Complain(console, run.error());
    return std::nullopt;
  }
  for (const std::string& warning : run->warnings) Complain(console, "warning: " + warning);
  return std::move(run).value();
}

}  // namespace tbm
