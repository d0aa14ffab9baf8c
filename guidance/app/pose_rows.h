#pragma once

#include <string>
#include <vector>

#include "pose/frame/frame_solver.h"
#include "pose/rig/rig.h"

namespace tbm {

// The columns of `tbm solve` (FORMATS §3): fixed ones, then five for each point of the rig.
std::vector<std::string> PoseColumns(const Rig& rig);

// One frame's values, parallel to PoseColumns: empty where there is nothing to say, never zero for
// it.
std::vector<std::string> PoseValues(const Rig& rig, const FrameResult& result);

// The columns of `tbm centres`, and the rows of one frame, each ending with a line feed.
std::string CentreHeader();
std::string CentreRows(const Rig& rig, const FrameResult& result);

// A table as CSV text, or as a JSON list of objects: numbers as they stand, empty as null, the
// words of `status` and `reason` in quotes.
std::string TableAsCsv(const std::vector<std::string>& columns,
                       const std::vector<std::vector<std::string>>& rows);
std::string TableAsJson(const std::vector<std::string>& columns,
                        const std::vector<std::vector<std::string>>& rows);

}  // namespace tbm
