#pragma once

#include <string>
#include <vector>

#include "guidance/app/calibrate_command.h"
#include "pose/calibrate/error_budget.h"
#include "pose/rig/rig.h"

namespace tbm {

// A rig and what it is worth at its points, all in one placement.
struct RigResult {
  CalibrateRigRequest request;
  Rig rig;
  BudgetPlacement placement;
  bool knows_distortion = false;     // the camera's file has a covariance
  std::vector<PointBudget> budgets;  // side by side with the rig's points
};

// The rig file, with a head that says what it is made of and worth.
std::string RigFileText(const RigResult& result);
// A table for each point: one row a source, mm to the right, up and along.
std::string RigSummary(const RigResult& result);
std::string RigCsv(const RigResult& result);
std::string RigJson(const RigResult& result);

}  // namespace tbm
