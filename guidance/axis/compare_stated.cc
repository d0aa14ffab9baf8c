#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "guidance/axis/plan_element.h"

namespace tbm {
namespace {

constexpr double kPi = std::numbers::pi;
// What a file that rounds its angles to a second of arc may be off.
constexpr double kAngle_rad = 1e-5;

double Bearing(const Eigen::Vector2d& direction) {
  const double bearing_rad = std::atan2(direction.x(), direction.y());
  return bearing_rad < 0.0 ? bearing_rad + 2.0 * kPi : bearing_rad;
}

// Smallest turn between two directions.
double AngleBetween(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, 2.0 * kPi));
}

class Comparison {
 public:
  Comparison(const PlanElement& element,
             const SolvedElement& solved,
             InternalChainage at,
             AxisRemarks* remarks)
      : element_(element),
        stated_(element.stated),
        solved_(solved),
        at_(at),
        remarks_(*remarks),
        chord_(solved.end - solved.start) {}

  void Run() {
    CompareLength();
    CompareDistance(StatedQuantity::kChord, stated_.chord_m, chord_.norm());
    CompareTurn();
    CompareBearing(
        StatedQuantity::kBearingStart, stated_.bearing_start_rad, solved_.direction_start);
    CompareBearing(StatedQuantity::kBearingEnd, stated_.bearing_end_rad, solved_.direction_end);
    CompareStation();
    if (std::holds_alternative<CurveElement>(element_.shape)) {
      CompareDistance(StatedQuantity::kTangent, stated_.tangent_m, Tangents()[0]);
    }
    if (const auto* spiral = std::get_if<SpiralElement>(&element_.shape)) CompareSpiral(*spiral);
    CompareIntersection();
  }

 private:
  AxisRemark& Say(AxisRemarkCode code, Severity severity, double size) {
    remarks_.push_back(RemarkAt(code, severity, element_.line, at_, size));
    return remarks_.back();
  }
  void SayDisagrees(StatedQuantity quantity, double stated, double computed, Severity severity) {
    AxisRemark& remark =
        Say(AxisRemarkCode::kValueDisagrees, severity, std::abs(stated - computed));
    remark.quantity = quantity;
    remark.stated = stated;
    remark.computed = computed;
  }

  // Chainage is counted by the stated length, so it may not be off by more than rounding.
  void CompareLength() {
    if (!stated_.length_m || solved_.is_length_along_tangent) return;
    const double off_m = std::abs(*stated_.length_m - solved_.length_m);
    if (!(off_m > kGapOddAbove_m)) return;
    const bool is_spiral = std::holds_alternative<SpiralElement>(element_.shape);
    // The length of a spiral makes its shape; an end that does not fit has been told.
    if (is_spiral) return;
    SayDisagrees(StatedQuantity::kLength,
                 *stated_.length_m,
                 solved_.length_m,
                 off_m > kGapRefusedAbove_m ? Severity::kRefused : Severity::kOdd);
  }

  void CompareDistance(StatedQuantity quantity, std::optional<double> stated_m, double computed_m) {
    if (!stated_m || !(std::abs(*stated_m - computed_m) > kGapRefusedAbove_m)) return;
    SayDisagrees(quantity, *stated_m, computed_m, Severity::kOdd);
  }

  // Angles of a file that says one unit and writes another.
  void CompareTurn() {
    if (!stated_.turn_rad) return;
    const double computed_rad = std::abs(solved_.run.turn_rad);
    const double stated_rad = std::abs(*stated_.turn_rad);
    if (!(std::abs(stated_rad - computed_rad) > kAngle_rad)) return;
    for (const double factor :
         {kPi / 180.0, 180.0 / kPi, kPi / 200.0, 200.0 / kPi, 0.9, 1.0 / 0.9}) {
      if (computed_rad > 1e-3 && std::abs(stated_rad * factor / computed_rad - 1.0) < 1e-4) {
        Say(AxisRemarkCode::kAngleUnit, Severity::kOdd, factor);
        return;
      }
    }
    SayDisagrees(StatedQuantity::kTurn, stated_rad, computed_rad, Severity::kOdd);
  }

  void CompareBearing(StatedQuantity quantity,
                      std::optional<double> stated_rad,
                      const Eigen::Vector2d& direction) {
    if (!stated_rad) return;
    const double computed_rad = Bearing(direction);
    if (!(AngleBetween(*stated_rad, computed_rad) > kAngle_rad)) return;
    const double from_east_rad = 0.5 * kPi - computed_rad;
    if (AngleBetween(*stated_rad, from_east_rad) <= kAngle_rad) {
      Say(AxisRemarkCode::kBearingConvention,
          Severity::kOdd,
          AngleBetween(*stated_rad, computed_rad));
      return;
    }
    SayDisagrees(quantity, *stated_rad, computed_rad, Severity::kOdd);
    remarks_.back().size = AngleBetween(*stated_rad, computed_rad);
  }

  void CompareStation() {
    if (!stated_.start_chainage_m) return;
    const double off_m = std::abs(*stated_.start_chainage_m - at_.m);
    if (!(off_m > kGapRefusedAbove_m)) return;
    AxisRemark& remark = Say(AxisRemarkCode::kStationDisagrees, Severity::kOdd, off_m);
    remark.stated = *stated_.start_chainage_m;
    remark.computed = at_.m;
  }

  // From start and from end to where the tangents meet; 0 where they hardly do.
  std::array<double, 2> Tangents() const {
    const double sine = CrossProduct(solved_.direction_start, solved_.direction_end);
    if (std::abs(sine) < 1e-6) return {0.0, 0.0};
    return {CrossProduct(chord_, solved_.direction_end) / sine,
            CrossProduct(solved_.direction_start, chord_) / sine};
  }

  void CompareSpiral(const SpiralElement& spiral) {
    if (spiral.law == SpiralLaw::kClothoid && stated_.clothoid_constant_m.value_or(0.0) > 0.0) {
      const double change = std::abs(spiral.curvature_end_per_m - spiral.curvature_start_per_m);
      if (change > 0.0) {
        CompareConstant(std::sqrt(spiral.length_m / change));
      }
    }
    const auto tangents = Tangents();
    if (tangents[0] != 0.0) {
      CompareDistance(
          StatedQuantity::kTangentLong, stated_.tangent_long_m, std::max(tangents[0], tangents[1]));
      CompareDistance(StatedQuantity::kTangentShort,
                      stated_.tangent_short_m,
                      std::min(tangents[0], tangents[1]));
    }
    CompareTotals(spiral);
  }

  // The schema does not say what `constant` is; A and A squared are both in use, 0 means none.
  void CompareConstant(double computed_m) {
    const double stated_m = *stated_.clothoid_constant_m;
    if (std::abs(stated_m - computed_m) <= 1e-3 * computed_m) return;
    if (std::abs(stated_m - computed_m * computed_m) <= 1e-3 * computed_m * computed_m) return;
    SayDisagrees(StatedQuantity::kClothoidConstant, stated_m, computed_m, Severity::kOdd);
  }

  // Extent along and height over the tangent of the flatter end. Some writers count them backwards.
  void CompareTotals(const SpiralElement& spiral) {
    const bool is_flat_at_start =
        std::abs(spiral.curvature_start_per_m) <= std::abs(spiral.curvature_end_per_m);
    const Eigen::Vector2d tangent =
        is_flat_at_start ? solved_.direction_start : solved_.direction_end;
    const double x_m = std::abs(chord_.dot(tangent));
    const double y_m = std::abs(CrossProduct(tangent, chord_));
    if (stated_.total_x_m && *stated_.total_x_m != 0.0) {
      CompareDistance(StatedQuantity::kTotalX, std::abs(*stated_.total_x_m), x_m);
    }
    if (stated_.total_y_m && *stated_.total_y_m != 0.0) {
      CompareDistance(StatedQuantity::kTotalY, std::abs(*stated_.total_y_m), y_m);
    }
  }

  // How far a point lies off both tangents: unlike their intersection this does not grow beyond all
  // bounds where the element hardly turns.
  static double OffTangents(const SolvedElement& solved, const Eigen::Vector2d& point) {
    return std::max(std::abs(CrossProduct(solved.direction_start, point - solved.start)),
                    std::abs(CrossProduct(solved.direction_end, point - solved.end)));
  }

  void CompareIntersection() {
    if (!stated_.intersection || std::holds_alternative<LineElement>(element_.shape)) return;
    const Eigen::Vector2d point = *stated_.intersection;
    const double off_m = OffTangents(solved_, point);
    if (!(off_m > kGapRefusedAbove_m)) return;
    if (Fits(MirroredOnItsChord(element_), point)) {
      Say(AxisRemarkCode::kTurningMirrored, Severity::kRefused, off_m);
    } else if (Fits(RadiiSwapped(element_), point)) {
      Say(AxisRemarkCode::kRadiiSwapped, Severity::kRefused, off_m);
    } else {
      SayDisagrees(StatedQuantity::kIntersection, 0.0, off_m, Severity::kOdd);
    }
  }

  bool Fits(const PlanElement& other, const Eigen::Vector2d& point) const {
    AxisRemarks ignored;
    const auto solved = SolveElement(other, at_, &ignored);
    return solved && OffTangents(*solved, point) <= kGapRefusedAbove_m;
  }

  const PlanElement& element_;
  const StatedValues& stated_;
  const SolvedElement& solved_;
  InternalChainage at_;
  AxisRemarks& remarks_;
  Eigen::Vector2d chord_;
};

}  // namespace

void CompareStated(const PlanElement& element,
                   const SolvedElement& solved,
                   InternalChainage at,
                   AxisRemarks* remarks) {
  Comparison(element, solved, at, remarks).Run();
}

}  // namespace tbm
