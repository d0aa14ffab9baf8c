#pragma once

#include <string>
#include <vector>

#include "devices/replay/csv.h"
#include "guidance/rail/rail_line.h"

namespace tbm {

// What `tbm line` wrote (FORMATS §5), or another program in its columns.
struct LineFile {
  std::string file;
  std::vector<RailPoint> points;  // two or more; stamps increase, distance does not decrease
  std::vector<int> line_of_point;
  std::vector<std::string> warnings;
};

// Errors: every fault found, up to twenty, with file, line and column.
Result<LineFile, FileFaults> ReadLineFile(const std::string& path);
Result<LineFile, FileFaults> ParseLineFile(std::string text, const std::string& path);

}  // namespace tbm
