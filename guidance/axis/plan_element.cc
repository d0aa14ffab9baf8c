#include "guidance/axis/plan_element.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace tbm {
namespace {

constexpr double kLargest_m = 1e8;
constexpr double kShortest_m = 1e-6;
constexpr double kFullCircle_rad = 2.0 * std::numbers::pi;

// Not by maxCoeff(), which may pass over a NaN.
bool IsFine(const Eigen::Vector2d& p) {
  return std::abs(p.x()) < kLargest_m && std::abs(p.y()) < kLargest_m;
}

class Solver {
 public:
  Solver(const PlanElement& element, InternalChainage at, AxisRemarks* remarks)
      : element_(element), at_(at), remarks_(*remarks) {}

  std::optional<SolvedElement> Solve() {
    const Eigen::Vector2d start = StartOf(element_);
    const Eigen::Vector2d end = EndOf(element_);
    if (!IsFine(start) || !IsFine(end)) return Refused(AxisRemarkCode::kNotFinite, 0.0);
    const double chord_m = (end - start).norm();
    if (chord_m < kShortest_m) return Refused(AxisRemarkCode::kNoLength, chord_m);
    SolvedElement solved;
    solved.start = start;
    solved.end = end;
    const std::optional<PlanShape> shape = ShapeOf(chord_m, &solved);
    if (!shape) return std::nullopt;
    solved.run = CutIntoPieces(*shape);
    PlaceRun(start, end, &solved.run);
    solved.direction_start = StateAt(solved.run.pieces.front(), -1.0).direction.normalized();
    solved.direction_end = StateAt(solved.run.pieces.back(), 1.0).direction.normalized();
    for (const PlanPiece& piece : solved.run.pieces) solved.length_m += 2.0 * piece.half_length_m;
    return solved;
  }

 private:
  std::nullopt_t Refused(AxisRemarkCode code, double size) {
    Say(code, Severity::kRefused, size);
    return std::nullopt;
  }
  void Say(AxisRemarkCode code, Severity severity, double size) {
    remarks_.push_back(RemarkAt(code, severity, element_.line, at_, size));
  }
  // True when the size is refused.
  bool SayDistance(AxisRemarkCode code, double size_m) {
    if (size_m > kGapRefusedAbove_m) {
      Say(code, Severity::kRefused, size_m);
      return true;
    }
    if (size_m > kGapOddAbove_m) Say(code, Severity::kOdd, size_m);
    return false;
  }

  std::optional<PlanShape> ShapeOf(double chord_m, SolvedElement* solved) {
    if (std::holds_alternative<LineElement>(element_.shape)) return LineShape(chord_m);
    if (const auto* curve = std::get_if<CurveElement>(&element_.shape)) {
      return ShapeOfCurve(*curve, chord_m);
    }
    return ShapeOfSpiral(std::get<SpiralElement>(element_.shape), chord_m, solved);
  }

  // Half of the angle at the centre from the height of the chord's middle over the centre: the
  // same formula for less and for more than half a circle.
  std::optional<PlanShape> ShapeOfCurve(const CurveElement& curve, double chord_m) {
    const double side = curve.turning == Turning::kLeft ? 1.0 : -1.0;
    double height_m = 0.0;  // of the centre over the chord, on the side the curve turns to
    double radius_m = 0.0;
    if (curve.centre) {
      if (!IsFine(*curve.centre)) return Refused(AxisRemarkCode::kNotFinite, 0.0);
      const Eigen::Vector2d chord = (curve.end - curve.start) / chord_m;
      const Eigen::Vector2d to_centre = *curve.centre - curve.start;
      height_m = side * CrossProduct(chord, to_centre);
      radius_m = std::hypot(height_m, 0.5 * chord_m);
      const double off_m = std::abs(to_centre.norm() - (*curve.centre - curve.end).norm());
      if (SayDistance(AxisRemarkCode::kCentreOff, off_m)) return std::nullopt;
    }
    if (!curve.centre && !HeightFromRadius(curve, chord_m, &height_m, &radius_m)) {
      return std::nullopt;
    }
    if (!CompareRadius(curve, chord_m, radius_m)) return std::nullopt;
    const double turn_rad = 2.0 * std::atan2(0.5 * chord_m, height_m);
    const double length_m = radius_m * turn_rad;
    const double other_way_m = radius_m * (kFullCircle_rad - turn_rad);
    if (element_.stated.length_m) {
      const double stated_m = *element_.stated.length_m;
      if (std::abs(length_m - stated_m) > kGapRefusedAbove_m &&
          std::abs(other_way_m - stated_m) <= kGapRefusedAbove_m) {
        return Refused(AxisRemarkCode::kTurningMirrored, std::abs(length_m - stated_m));
      }
    }
    return ArcShape(length_m, side / radius_m);
  }

  // False when the stated radius bends the arc elsewhere.
  bool CompareRadius(const CurveElement& curve, double chord_m, double radius_m) {
    if (!curve.radius_m) return true;
    const double stated_m = std::abs(*curve.radius_m);
    // What the difference moves the middle of the arc by.
    const double bend = chord_m * chord_m / (8.0 * radius_m * radius_m);
    const double off_m = std::min(bend, 1.0) * std::abs(stated_m - radius_m);
    if (off_m <= kGapOddAbove_m) return true;
    const Severity severity = off_m <= kGapRefusedAbove_m ? Severity::kOdd : Severity::kRefused;
    AxisRemark remark =
        RemarkAt(AxisRemarkCode::kValueDisagrees, severity, element_.line, at_, off_m);
    remark.quantity = StatedQuantity::kRadius;
    remark.stated = stated_m;
    remark.computed = radius_m;
    remarks_.push_back(remark);
    return severity == Severity::kOdd;
  }

  bool HeightFromRadius(const CurveElement& curve,
                        double chord_m,
                        double* height_m,
                        double* radius_m) {
    if (!curve.radius_m || !(std::abs(*curve.radius_m) < kLargest_m)) {
      (void)Refused(AxisRemarkCode::kRadiusMissing, 0.0);
      return false;
    }
    const double stated_m = std::abs(*curve.radius_m);
    const double square = stated_m * stated_m - 0.25 * chord_m * chord_m;
    if (!(square >= 0.0)) {
      (void)Refused(AxisRemarkCode::kRadiusTooSmall, 0.5 * chord_m - stated_m);
      return false;
    }
    *height_m = std::sqrt(square);
    *radius_m = stated_m;
    return true;
  }

  std::optional<PlanShape> ShapeOfSpiral(const SpiralElement& spiral,
                                         double chord_m,
                                         SolvedElement* solved) {
    const double curvature =
        std::max(std::abs(spiral.curvature_start_per_m), std::abs(spiral.curvature_end_per_m));
    if (!(spiral.length_m > kShortest_m) || !(spiral.length_m < kLargest_m) ||
        !(curvature <= 1.0 / kShortest_m)) {
      return Refused(AxisRemarkCode::kNotFinite, 0.0);
    }
    if (!(curvature * spiral.length_m < kFullCircle_rad)) {
      return Refused(AxisRemarkCode::kTurnsTooFar, curvature * spiral.length_m);
    }
    if (spiral.curvature_start_per_m == spiral.curvature_end_per_m) {
      Say(AxisRemarkCode::kSpiralRadiiEqual, Severity::kOdd, 0.0);
    }
    auto shape = SpiralShape(spiral, LengthMeaning::kAlongCurve);
    if (!shape) {
      return Refused(shape.error() == SpiralFailure::kTurnsTooFar
                         ? AxisRemarkCode::kSpiralTurnsTooFar
                         : AxisRemarkCode::kSpiralBetweenCurves,
                     0.5 * curvature * spiral.length_m);
    }
    const double computed_chord_m = ChordOf(*shape);
    double miss_m = std::abs(computed_chord_m - chord_m);
    if (!(computed_chord_m > 0.5 * chord_m && computed_chord_m < 2.0 * chord_m)) {
      return Refused(AxisRemarkCode::kSpiralMisses, miss_m);
    }
    if (IsHeightOverTangent(spiral.law)) {
      auto other = SpiralShape(spiral, LengthMeaning::kAlongTangent);
      const double other_miss_m = std::abs(ChordOf(*other) - chord_m);
      const double longer_m = other->length_m - spiral.length_m;
      if (other_miss_m < miss_m && longer_m > kGapOddAbove_m) {
        Say(AxisRemarkCode::kLengthAlongTangent, Severity::kOdd, longer_m);
        solved->is_length_along_tangent = true;
        shape = std::move(other);
        miss_m = other_miss_m;
      }
    }
    if (SayDistance(AxisRemarkCode::kSpiralMisses, miss_m)) return std::nullopt;
    return std::move(shape).value();
  }

  static double ChordOf(const PlanShape& shape) { return CutIntoPieces(shape).end.norm(); }

  const PlanElement& element_;
  InternalChainage at_;
  AxisRemarks& remarks_;
};

Eigen::Vector2d Reflected(const Eigen::Vector2d& p,
                          const Eigen::Vector2d& on,
                          const Eigen::Vector2d& along) {
  const Eigen::Vector2d axis = along.normalized();
  const Eigen::Vector2d from = p - on;
  return on + 2.0 * from.dot(axis) * axis - from;
}

Turning Opposite(Turning turning) {
  return turning == Turning::kLeft ? Turning::kRight : Turning::kLeft;
}

}  // namespace

Eigen::Vector2d StartOf(const PlanElement& element) {
  return std::visit([](const auto& shape) { return shape.start; }, element.shape);
}

Eigen::Vector2d EndOf(const PlanElement& element) {
  return std::visit([](const auto& shape) { return shape.end; }, element.shape);
}

PlanElement Moved(PlanElement element, const Eigen::Vector2d& by) {
  std::visit(
      [&by](auto& shape) {
        shape.start += by;
        shape.end += by;
      },
      element.shape);
  if (auto* curve = std::get_if<CurveElement>(&element.shape)) {
    if (curve->centre) *curve->centre += by;
  }
  if (element.stated.intersection) *element.stated.intersection += by;
  return element;
}

PlanElement WithEnd(PlanElement element, const Eigen::Vector2d& end) {
  std::visit([&end](auto& shape) { shape.end = end; }, element.shape);
  return element;
}

PlanElement EndsSwapped(PlanElement element) {
  std::visit([](auto& shape) { std::swap(shape.start, shape.end); }, element.shape);
  return element;
}

PlanElement TurnedToTheOtherSide(PlanElement element) {
  if (auto* curve = std::get_if<CurveElement>(&element.shape)) {
    curve->turning = Opposite(curve->turning);
  } else if (auto* spiral = std::get_if<SpiralElement>(&element.shape)) {
    spiral->turning = Opposite(spiral->turning);
  }
  return element;
}

PlanElement MirroredOnItsChord(PlanElement element) {
  element = TurnedToTheOtherSide(std::move(element));
  if (auto* curve = std::get_if<CurveElement>(&element.shape); curve && curve->centre) {
    curve->centre = Reflected(*curve->centre, curve->start, curve->end - curve->start);
  }
  return element;
}

PlanElement RadiiSwapped(PlanElement element) {
  if (auto* spiral = std::get_if<SpiralElement>(&element.shape)) {
    std::swap(spiral->curvature_start_per_m, spiral->curvature_end_per_m);
  }
  return element;
}

std::optional<SolvedElement> SolveElement(const PlanElement& element,
                                          InternalChainage at,
                                          AxisRemarks* remarks) {
  return Solver(element, at, remarks).Solve();
}

}  // namespace tbm
