#pragma once

#include <algorithm>
#include <vector>

#include "guidance/axis/axis_description.h"
#include "tests/guidance/axis/truth.h"

namespace tbm::test {

// An axis put together from lines, arcs, clothoids and Bloss spirals by the integration of truth.h:
// a description as a file would give it, and the truth it was made from.
struct Part {
  enum Kind { kLine, kArc, kClothoid, kBloss } kind;
  double length_m;
  double first_per_m;  // curvature to the left
  double last_per_m;
};

struct MadeAxis {
  AxisDescription description;
  Placement placement;
  std::vector<Part> parts;

  Real Curvature(Real s) const {
    Real first = 0;
    for (const Part& part : parts) {
      if (s < first + part.length_m || &part == &parts.back()) {
        const Real u = std::clamp((s - first) / part.length_m, Real(0), Real(1));
        const Real share = part.kind == Part::kBloss ? BlossCourse(u) : u;
        return part.first_per_m + (part.last_per_m - part.first_per_m) * share;
      }
      first += part.length_m;
    }
    return 0;
  }
  double length_m() const {
    double sum_m = 0.0;
    for (const Part& part : parts) sum_m += part.length_m;
    return sum_m;
  }
  // States at the given lengths, which must increase.
  std::vector<TruthState> States(const std::vector<double>& lengths_m) const {
    std::vector<TruthState> states;
    TruthState state;
    Real at = 0;
    for (const double length_m : lengths_m) {
      // Joints between parts are steps of their own: a jump of the curvature spoils the order.
      Real joint = 0;
      for (const Part& part : parts) {
        joint += part.length_m;
        if (joint <= at || joint >= length_m) continue;
        state = Integrate([this](Real s) { return Curvature(s); }, state, at, joint);
        at = joint;
      }
      state = Integrate([this](Real s) { return Curvature(s); }, state, at, length_m);
      at = length_m;
      states.push_back(state);
    }
    return states;
  }
  Eigen::Vector2d Place(const TruthState& state) const { return placement(state.x, state.y); }
  double Heading(const TruthState& state) const {
    return placement.heading_rad + static_cast<double>(state.heading);
  }
  // To the right of the axis.
  Eigen::Vector2d Beside(const TruthState& state, double right_m) const {
    const double heading = Heading(state);
    return Place(state) + right_m * Eigen::Vector2d(std::sin(heading), -std::cos(heading));
  }
};

inline PlanElement ElementOf(const Part& part,
                             const Eigen::Vector2d& start,
                             const Eigen::Vector2d& end,
                             double heading_rad) {
  PlanElement element;
  element.stated.length_m = part.length_m;
  const double bend = part.first_per_m + part.last_per_m;
  const Turning turning = bend > 0.0 ? Turning::kLeft : Turning::kRight;
  if (part.kind == Part::kLine) {
    element.shape = LineElement{start, end};
  } else if (part.kind == Part::kArc) {
    CurveElement curve;
    curve.start = start;
    curve.end = end;
    curve.centre =
        start + Eigen::Vector2d(-std::sin(heading_rad), std::cos(heading_rad)) / part.first_per_m;
    curve.radius_m = 1.0 / std::abs(part.first_per_m);
    curve.turning = turning;
    element.shape = curve;
  } else {
    SpiralElement spiral;
    spiral.start = start;
    spiral.end = end;
    spiral.law = part.kind == Part::kBloss ? SpiralLaw::kBloss : SpiralLaw::kClothoid;
    spiral.length_m = part.length_m;
    spiral.curvature_start_per_m = std::abs(part.first_per_m);
    spiral.curvature_end_per_m = std::abs(part.last_per_m);
    spiral.turning = turning;
    element.shape = spiral;
  }
  return element;
}

inline MadeAxis Make(const std::vector<Part>& parts,
                     const Placement& placement,
                     double start_chainage_m) {
  MadeAxis made;
  made.parts = parts;
  made.placement = placement;
  made.description.name = "made";
  made.description.start = {start_chainage_m};
  std::vector<double> ends_m = {0.0};
  for (const Part& part : parts) ends_m.push_back(ends_m.back() + part.length_m);
  const auto states = made.States(ends_m);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    PlanElement element = ElementOf(
        parts[i], made.Place(states[i]), made.Place(states[i + 1]), made.Heading(states[i]));
    element.stated.start_chainage_m = start_chainage_m + ends_m[i];
    element.line = 10 + static_cast<int>(i);
    made.description.plan.push_back(element);
  }
  return made;
}

// Line, clothoid, curve to the right, clothoid, line, Bloss spiral, curve to the left, line.
inline MadeAxis MakeDrive(const Placement& placement, double start_chainage_m = 0.0) {
  const double right = -1.0 / 300.0;
  const double left = 1.0 / 450.0;
  return Make({{Part::kLine, 80.0, 0.0, 0.0},
               {Part::kClothoid, 60.0, 0.0, right},
               {Part::kArc, 140.0, right, right},
               {Part::kClothoid, 60.0, right, 0.0},
               {Part::kLine, 50.0, 0.0, 0.0},
               {Part::kBloss, 70.0, 0.0, left},
               {Part::kArc, 120.0, left, left},
               {Part::kBloss, 70.0, left, 0.0},
               {Part::kLine, 50.0, 0.0, 0.0}},
              placement,
              start_chainage_m);
}

}  // namespace tbm::test
