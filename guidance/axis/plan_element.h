#pragma once

#include <optional>

#include <Eigen/Core>

#include "guidance/axis/axis_description.h"
#include "guidance/axis/axis_remark.h"
#include "guidance/axis/plan_piece.h"

namespace tbm {

// An element as computed from its geometry alone, between its own start and end.
struct SolvedElement {
  PieceRun run;
  Eigen::Vector2d start;
  Eigen::Vector2d end;
  Eigen::Vector2d direction_start;  // unit length
  Eigen::Vector2d direction_end;
  double length_m = 0.0;  // along the curve
  bool is_length_along_tangent = false;
};

Eigen::Vector2d StartOf(const PlanElement& element);
Eigen::Vector2d EndOf(const PlanElement& element);
PlanElement Moved(PlanElement element, const Eigen::Vector2d& by);  // with all its points
PlanElement WithEnd(PlanElement element, const Eigen::Vector2d& end);

// The ways in which files are wrong.
PlanElement EndsSwapped(PlanElement element);
PlanElement TurnedToTheOtherSide(PlanElement element);  // the centre stays
PlanElement MirroredOnItsChord(PlanElement element);    // the centre too
PlanElement RadiiSwapped(PlanElement element);

// `at` is where the element begins; it and the line go into the remarks. Nothing when the element
// makes no curve.
std::optional<SolvedElement> SolveElement(const PlanElement& element,
                                          InternalChainage at,
                                          AxisRemarks* remarks);

// Compares what is stated beside the geometry with it.
void CompareStated(const PlanElement& element,
                   const SolvedElement& solved,
                   InternalChainage at,
                   AxisRemarks* remarks);

}  // namespace tbm
