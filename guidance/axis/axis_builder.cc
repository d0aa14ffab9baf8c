#include "guidance/axis/axis_builder.h"

#include <algorithm>
#include <cmath>

namespace tbm {
namespace {

constexpr double kLargest_m = 1e8;
// Beyond this no passenger stays on his seat.
constexpr double kLargestCantShare = 1.0 / 3.0;
// Steepest twist; railways stop at 1 in 400.
constexpr double kSteepestTwist = 1.0 / 50.0;

// A table's heights belong to its points, whose chainages the plan has counted.
Profile ProfileOfTable(const AxisDescription& description, const Plan& plan) {
  std::vector<double> chainages_m;
  std::vector<double> up_m;
  if (!description.table.front().up_m) return {};
  for (std::size_t i = 0; i < description.table.size(); ++i) {
    chainages_m.push_back(plan.element_start(i).m);
    up_m.push_back(*description.table[i].up_m);
  }
  return Profile::Through(chainages_m, up_m);
}

void CheckExtent(const AxisDescription& description,
                 const Profile& profile,
                 const Plan& plan,
                 AxisRemarks* remarks) {
  if (!profile.exists() || description.profile.empty()) return;
  const auto say = [&](AxisRemarkCode code, int line, InternalChainage at, double size_m) {
    if (size_m <= kGapRefusedAbove_m) return;
    remarks->push_back(RemarkAt(code, Severity::kOdd, line, at, size_m));
  };
  const int first = description.profile.front().line;
  const int last = description.profile.back().line;
  const double early_m = plan.start().m - profile.start().m;
  const double late_m = profile.end().m - plan.end().m;
  say(AxisRemarkCode::kProfileOutside, first, profile.start(), early_m);
  say(AxisRemarkCode::kProfileShort, first, plan.start(), -early_m);
  say(AxisRemarkCode::kProfileOutside, last, profile.end(), late_m);
  say(AxisRemarkCode::kProfileShort, last, profile.end(), -late_m);
}

bool CheckCant(const AxisDescription& description, AxisRemarks* remarks) {
  if (description.cant.empty()) return true;
  const std::size_t before = remarks->size();
  const auto say = [&](AxisRemarkCode code, Severity severity, const CantStation& s, double size) {
    remarks->push_back(RemarkAt(code, severity, s.line, s.at, size));
  };
  if (!(description.gauge_m > 0.0) || !(description.gauge_m < 100.0)) {
    say(AxisRemarkCode::kCantGauge,
        Severity::kRefused,
        description.cant.front(),
        description.gauge_m);
  }
  for (std::size_t i = 0; i < description.cant.size(); ++i) {
    const CantStation& station = description.cant[i];
    if (!(std::abs(station.at.m) < kLargest_m) ||
        !(std::abs(station.left_over_right_m) <= kLargestCantShare * description.gauge_m)) {
      say(AxisRemarkCode::kCantTooLarge, Severity::kRefused, station, station.left_over_right_m);
    }
    if (i == 0) continue;
    const CantStation& last = description.cant[i - 1];
    const double step_m = station.at.m - last.at.m;
    const double change_m = std::abs(station.left_over_right_m - last.left_over_right_m);
    if (!(step_m > 0.0)) {
      say(AxisRemarkCode::kCantOrder, Severity::kRefused, station, step_m);
    } else if (change_m > kSteepestTwist * step_m) {
      say(AxisRemarkCode::kCantJump, Severity::kOdd, station, change_m);
    }
  }
  return !IsRefused({remarks->begin() + static_cast<std::ptrdiff_t>(before), remarks->end()});
}

// The outer rail is the higher one, unless the design means something special.
void CheckCantSides(const AxisDescription& description, const Plan& plan, AxisRemarks* remarks) {
  constexpr double kCurved_per_m = 1e-5;
  for (const CantStation& station : description.cant) {
    if (station.at < plan.start() || station.at > plan.end()) continue;
    const double bend = plan.At(station.at).curvature_right_per_m;
    if (std::abs(bend) < kCurved_per_m || bend * station.left_over_right_m >= 0.0) continue;
    remarks->push_back(RemarkAt(AxisRemarkCode::kCantWrongWay,
                                Severity::kOdd,
                                station.line,
                                station.at,
                                std::abs(station.left_over_right_m)));
  }
}

bool CheckEquations(const AxisDescription& description,
                    const std::optional<Plan>& plan,
                    AxisRemarks* remarks) {
  const std::size_t before = remarks->size();
  std::vector<StationEquation> passed;
  for (const StationEquation& equation : description.equations) {
    const auto say = [&](AxisRemarkCode code, Severity severity, double size) {
      remarks->push_back(RemarkAt(code, severity, equation.line, equation.at, size));
    };
    const bool is_finite = std::abs(equation.at.m) < kLargest_m &&
                           std::abs(equation.ahead_m) < kLargest_m &&
                           std::abs(equation.back_m.value_or(0.0)) < kLargest_m;
    if (!is_finite || (!passed.empty() && !(equation.at > passed.back().at))) {
      say(AxisRemarkCode::kEquationOrder,
          Severity::kRefused,
          passed.empty() ? 0.0 : equation.at.m - passed.back().at.m);
      continue;
    }
    if (plan && (equation.at < plan->start() || equation.at > plan->end())) {
      say(AxisRemarkCode::kEquationOutside,
          Severity::kOdd,
          std::max(plan->start().m - equation.at.m, equation.at.m - plan->end().m));
    }
    if (equation.back_m) {
      const double back_m = ChainageEquations(passed).ToOfficial(equation.at).m;
      const double off_m = std::abs(back_m - *equation.back_m);
      if (off_m > kGapRefusedAbove_m) {
        say(AxisRemarkCode::kEquationBack, Severity::kOdd, off_m);
        remarks->back().stated = *equation.back_m;
        remarks->back().computed = back_m;
      }
    }
    passed.push_back(equation);
  }
  return !IsRefused({remarks->begin() + static_cast<std::ptrdiff_t>(before), remarks->end()});
}

}  // namespace

std::optional<DesignAxis> AxisBuilder::Build(const AxisDescription& description,
                                             AxisRemarks* remarks) {
  std::optional<Plan> plan = Plan::Build(description, remarks);
  std::optional<Profile> profile = Profile::Build(description.profile, remarks);
  if (plan && profile) {
    if (!description.table.empty()) profile = ProfileOfTable(description, *plan);
    CheckExtent(description, *profile, *plan, remarks);
  }
  const bool is_cant_fine = CheckCant(description, remarks);
  if (plan && is_cant_fine) CheckCantSides(description, *plan, remarks);
  const bool are_equations_fine = CheckEquations(description, plan, remarks);
  if (!plan || !profile || !is_cant_fine || !are_equations_fine) return std::nullopt;
  DesignAxis axis;
  axis.name_ = description.name;
  axis.file_sha256_ = description.file_sha256;
  axis.plan_ = std::move(*plan);
  axis.profile_ = std::move(*profile);
  axis.cant_ = description.cant;
  axis.gauge_m_ = description.gauge_m;
  axis.equations_ = ChainageEquations(description.equations);
  return axis;
}

}  // namespace tbm
