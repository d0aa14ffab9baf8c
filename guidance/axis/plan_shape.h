#pragma once

#include <functional>
#include <vector>

#include "guidance/axis/axis_description.h"
#include "pose/base/result.h"

namespace tbm {

// A plane curve by its natural equation: which way it heads after s metres, and how sharply it
// turns there. Counter-clockwise (to the left) is positive. Place and first direction are added
// elsewhere. Used while an axis is built, never afterwards.
struct PlanShape {
  double length_m = 0.0;
  std::function<double(double s_m)> turn_rad;              // since the start
  std::function<double(double s_m)> curvature_left_per_m;  // derivative of turn_rad
  std::vector<double> breaks_m;                            // where the formula changes
};

PlanShape LineShape(double length_m);
PlanShape ArcShape(double length_m, double curvature_left_per_m);

// How the stated length of a spiral that is a height over its tangent is to be read. The schema
// says along the curve; some writers state the extent along the tangent. The stated end decides.
enum class LengthMeaning { kAlongCurve, kAlongTangent };

enum class SpiralFailure {
  kTurnsTooFar,    // the formula no longer describes a transition
  kBetweenCurves,  // the law is defined only with one infinite radius
};

// True for laws that are a height over the tangent, for which LengthMeaning makes a difference.
bool IsHeightOverTangent(SpiralLaw law);

// Formulas, sources and conventions: docs/axis.md, section 3. With kAlongTangent length_m of the
// shape is longer than that of the element.
Result<PlanShape, SpiralFailure> SpiralShape(const SpiralElement& element, LengthMeaning meaning);

// The part of the change of curvature that is reached after the part u = 0 .. 1 of the length, for
// laws of curvature over length, and its integral from 0 to u. Exposed for tests.
double CurvatureShare(SpiralLaw law, double u);
double TurnShare(SpiralLaw law, double u);

}  // namespace tbm
