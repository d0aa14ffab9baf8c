#include "guidance/axis/plan_build.h"

#include <algorithm>
#include <cmath>

#include "guidance/axis/plan_element.h"

namespace tbm {
namespace {

// One element that could be solved, with what happens at its start.
struct Placed {
  const PlanElement* element;  // as the file has it
  PlanElement moved;           // relative to the origin, its end where the next begins
  SolvedElement solved;
  InternalChainage at;
};

// To the left, from one direction to the next.
double TurnBetween(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  return std::atan2(CrossProduct(from, to), from.dot(to));
}

class Builder {
 public:
  Builder(const AxisDescription& description, AxisRemarks* remarks)
      : description_(description), remarks_(*remarks) {}

  std::optional<PlanRuns> Build() {
    const std::size_t before = remarks_.size();
    runs_.origin = StartOf(description_.plan.front()).array().round().matrix();
    if (!runs_.origin.allFinite()) runs_.origin.setZero();  // told when the element is solved
    const std::vector<PlanElement> elements = Joined();
    InternalChainage at = description_.start;
    for (std::size_t i = 0; i < elements.size(); ++i) at.m += Place(i, elements[i], at);
    if (placed_.size() != elements.size() || !is_joined_) return std::nullopt;
    for (std::size_t i = 1; i < placed_.size(); ++i) CheckKink(i);
    for (std::size_t i = 0; i < placed_.size(); ++i) LookForMirrors(i);
    CheckWhole(at);
    if (IsRefused({remarks_.begin() + static_cast<std::ptrdiff_t>(before), remarks_.end()})) {
      return std::nullopt;
    }
    for (Placed& placed : placed_) {
      runs_.runs.push_back({std::move(placed.solved.run), placed.at.m, CountedLength(placed)});
    }
    return std::move(runs_);
  }

 private:
  AxisRemark& Say(AxisRemarkCode code,
                  Severity severity,
                  const PlanElement& element,
                  InternalChainage at,
                  double size) {
    remarks_.push_back(RemarkAt(code, severity, element.line, at, size));
    return remarks_.back();
  }

  // Elements relative to the origin, each ending where the next begins. Empty when they do not
  // join.
  std::vector<PlanElement> Joined() {
    std::vector<PlanElement> elements;
    for (const PlanElement& element : description_.plan) {
      elements.push_back(Moved(element, -runs_.origin));
    }
    InternalChainage at = description_.start;
    for (std::size_t i = 0; i + 1 < elements.size(); ++i) {
      const double chord_m = (EndOf(elements[i]) - StartOf(elements[i])).norm();
      at.m += elements[i].stated.length_m.value_or(chord_m);
      const Eigen::Vector2d next = StartOf(elements[i + 1]);
      const double gap_m = (next - EndOf(elements[i])).norm();
      if (!(gap_m <= kGapOddAbove_m)) {
        const bool is_odd = gap_m <= kGapRefusedAbove_m;
        Say(AxisRemarkCode::kGap,
            is_odd ? Severity::kOdd : Severity::kRefused,
            elements[i + 1],
            at,
            gap_m);
        if (!is_odd) {
          SayIfSwapped(elements, i + 1, at);
          is_joined_ = false;
          continue;
        }
      }
      elements[i] = WithEnd(elements[i], next);
    }
    return elements;
  }

  // Does the element join when it is walked the other way?
  void SayIfSwapped(const std::vector<PlanElement>& elements,
                    std::size_t index,
                    InternalChainage at) {
    const PlanElement& original = description_.plan[index];
    const Eigen::Vector2d before = EndOf(description_.plan[index - 1]);
    const double swapped_m = (EndOf(original) - before).norm();
    if (swapped_m <= kGapRefusedAbove_m) {
      Say(AxisRemarkCode::kEndsSwapped, Severity::kRefused, elements[index], at, swapped_m);
    }
  }

  // Returns the chainage that the element takes.
  double Place(std::size_t index, const PlanElement& element, InternalChainage at) {
    auto solved = SolveElement(element, at, &remarks_);
    if (!solved) return element.stated.length_m.value_or(0.0);
    CompareStated(element, *solved, at, &remarks_);
    placed_.push_back({&description_.plan[index], element, std::move(*solved), at});
    return CountedLength(placed_.back());
  }

  static double CountedLength(const Placed& placed) {
    const SolvedElement& solved = placed.solved;
    const double stated_m = placed.moved.stated.length_m.value_or(solved.length_m);
    const bool is_rounding = std::abs(stated_m - solved.length_m) <= kGapRefusedAbove_m;
    const bool counts = is_rounding || solved.is_length_along_tangent;
    // An element of a few millimetres must not lose its length to rounding.
    return counts && stated_m > 0.5 * solved.length_m ? stated_m : solved.length_m;
  }

  double KinkBefore(std::size_t i, const SolvedElement& element) const {
    return i == 0 ? 0.0 : TurnBetween(placed_[i - 1].solved.direction_end, element.direction_start);
  }
  double KinkBehind(std::size_t i, const SolvedElement& element) const {
    return i + 1 == placed_.size()
               ? 0.0
               : TurnBetween(element.direction_end, placed_[i + 1].solved.direction_start);
  }

  void CheckKink(std::size_t i) {
    const double kink_rad = std::abs(KinkBefore(i, placed_[i].solved));
    if (!(kink_rad > kKinkOddAbove_rad)) return;
    const auto is_line = [this](std::size_t k) {
      return std::holds_alternative<LineElement>(placed_[k].moved.shape);
    };
    const bool is_refused = kink_rad > kKinkRefusedAbove_rad && !(is_line(i - 1) && is_line(i));
    Say(AxisRemarkCode::kKink,
        is_refused ? Severity::kRefused : Severity::kOdd,
        *placed_[i].element,
        placed_[i].at,
        kink_rad);
  }

  // Do the kinks at both ends vanish when the element is mirrored, or its radii are exchanged?
  void LookForMirrors(std::size_t i) {
    constexpr double kWorthLooking_rad = 1e-4;
    const Placed& placed = placed_[i];
    if (std::holds_alternative<LineElement>(placed.moved.shape)) return;
    const double kinks_rad = Kinks(i, placed.solved);
    if (kinks_rad < kWorthLooking_rad) return;
    const struct {
      PlanElement element;
      AxisRemarkCode code;
    } others[] = {{MirroredOnItsChord(placed.moved), AxisRemarkCode::kTurningMirrored},
                  {TurnedToTheOtherSide(placed.moved), AxisRemarkCode::kTurningMirrored},
                  {RadiiSwapped(placed.moved), AxisRemarkCode::kRadiiSwapped}};
    for (const auto& other : others) {
      AxisRemarks ignored;
      const auto solved = SolveElement(other.element, placed.at, &ignored);
      if (!solved || !(Kinks(i, *solved) < 0.1 * kinks_rad)) continue;
      const double chord_m = (placed.solved.end - placed.solved.start).norm();
      Say(other.code, Severity::kRefused, *placed.element, placed.at, kinks_rad * chord_m);
      return;
    }
  }

  double Kinks(std::size_t i, const SolvedElement& element) const {
    return std::abs(KinkBefore(i, element)) + std::abs(KinkBehind(i, element));
  }

  void CheckWhole(InternalChainage end) {
    if (!description_.stated_length_m) return;
    const double length_m = end.m - description_.start.m;
    const double off_m = std::abs(*description_.stated_length_m - length_m);
    if (!(off_m > kGapRefusedAbove_m)) return;
    AxisRemark& remark = Say(AxisRemarkCode::kValueDisagrees,
                             Severity::kOdd,
                             description_.plan.front(),
                             description_.start,
                             off_m);
    remark.quantity = StatedQuantity::kAlignmentLength;
    remark.stated = *description_.stated_length_m;
    remark.computed = length_m;
  }

  const AxisDescription& description_;
  AxisRemarks& remarks_;
  PlanRuns runs_;
  std::vector<Placed> placed_;
  bool is_joined_ = true;
};

}  // namespace

bool IsRefused(const AxisRemarks& remarks) {
  return std::any_of(remarks.begin(), remarks.end(), [](const AxisRemark& remark) {
    return remark.severity == Severity::kRefused;
  });
}

std::optional<PlanRuns> BuildPlanRuns(const AxisDescription& description, AxisRemarks* remarks) {
  constexpr double kLargest_m = 1e8;
  if (!(std::abs(description.start.m) < kLargest_m)) {
    remarks->push_back({AxisRemarkCode::kNotFinite, Severity::kRefused, 0, {}, 0.0});
    return std::nullopt;
  }
  if (!description.table.empty()) return BuildTableRuns(description, remarks);
  if (description.plan.empty()) {
    remarks->push_back({AxisRemarkCode::kNoPlan, Severity::kRefused, 0, {}, 0.0});
    return std::nullopt;
  }
  return Builder(description, remarks).Build();
}

}  // namespace tbm
