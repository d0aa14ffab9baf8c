#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "guidance/axis/axis_description.h"
#include "guidance/axis/axis_remark.h"
#include "guidance/axis/plan_piece.h"

namespace tbm {

// One element of the plan, cut and put in its place.
struct PlanRun {
  PieceRun pieces;
  double start_m = 0.0;   // chainage
  double length_m = 0.0;  // in chainage; differs from the geometry by what the file is rounded to
};

struct PlanRuns {
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  // all places are relative to it
  std::vector<PlanRun> runs;
};

// From elements or a table to a curve without gaps. What is odd goes to `remarks`; nothing when any
// of it is refused.
std::optional<PlanRuns> BuildPlanRuns(const AxisDescription& description, AxisRemarks* remarks);

// The same for a table alone (plan_table.cc).
std::optional<PlanRuns> BuildTableRuns(const AxisDescription& description, AxisRemarks* remarks);

}  // namespace tbm
