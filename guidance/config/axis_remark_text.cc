#include <cmath>

#include <fmt/format.h>

#include "guidance/config/axis_file.h"
#include "pose/base/angle.h"

namespace tbm {
namespace {

std::string_view QuantityName(StatedQuantity quantity) {
  switch (quantity) {
    case StatedQuantity::kNone:
      break;
    case StatedQuantity::kLength:
      return "length";
    case StatedQuantity::kRadius:
      return "radius";
    case StatedQuantity::kChord:
      return "chord";
    case StatedQuantity::kTurn:
      return "delta or theta";
    case StatedQuantity::kBearingStart:
      return "dir or dirStart";
    case StatedQuantity::kBearingEnd:
      return "dirEnd";
    case StatedQuantity::kClothoidConstant:
      return "constant";
    case StatedQuantity::kTotalX:
      return "totalX";
    case StatedQuantity::kTotalY:
      return "totalY";
    case StatedQuantity::kTangent:
      return "tangent";
    case StatedQuantity::kTangentLong:
      return "tanLong";
    case StatedQuantity::kTangentShort:
      return "tanShort";
    case StatedQuantity::kIntersection:
      return "PI";
    case StatedQuantity::kAlignmentLength:
      return "the alignment's length";
  }
  return "a value";
}

std::string Millimetres(double size_m) {
  if (!(std::abs(size_m) < 10.0)) return fmt::format("{:.3f} m", size_m);
  return fmt::format("{:.2f} mm", 1e3 * size_m);
}

std::string Degrees(double angle_rad) {
  return fmt::format("{:.5f} deg ({:.4f} mm per m)", RadToDeg(angle_rad), 1e3 * angle_rad);
}

std::string DisagreementText(const AxisRemark& remark) {
  switch (remark.quantity) {
    case StatedQuantity::kTurn:
    case StatedQuantity::kBearingStart:
    case StatedQuantity::kBearingEnd:
      return fmt::format("{} says {:.6f} deg, the geometry {:.6f} deg: {} apart",
                         QuantityName(remark.quantity),
                         RadToDeg(remark.stated),
                         RadToDeg(remark.computed),
                         Degrees(remark.size));
    case StatedQuantity::kIntersection:
      return fmt::format("PI lies {} off the tangents at Start and End", Millimetres(remark.size));
    default:
      return fmt::format("{} says {:.6f} m, the geometry {:.6f} m",
                         QuantityName(remark.quantity),
                         remark.stated,
                         remark.computed);
  }
}

std::string PlanText(const AxisRemark& remark) {
  const std::string size = Millimetres(remark.size);
  switch (remark.code) {
    case AxisRemarkCode::kNoPlan:
      return "there is no plan: neither elements nor a table of two points";
    case AxisRemarkCode::kNotFinite:
      return "a coordinate or length is no number, or beyond 100 000 km";
    case AxisRemarkCode::kNoLength:
      return "start and end are the same point";
    case AxisRemarkCode::kGap:
      return fmt::format("gap of {} to the element before", size);
    case AxisRemarkCode::kKink:
      return fmt::format("the direction jumps by {}", Degrees(remark.size));
    case AxisRemarkCode::kEndsSwapped:
      return "it joins the element before when Start and End change places";
    case AxisRemarkCode::kTurningMirrored:
      return fmt::format(
          "it fits ({} otherwise) when it turns to the other side: rot, or Center, is mirrored",
          size);
    case AxisRemarkCode::kRadiiSwapped:
      return fmt::format("it fits ({} otherwise) with radiusStart and radiusEnd exchanged", size);
    case AxisRemarkCode::kRadiusMissing:
      return "neither Center nor a usable radius";
    case AxisRemarkCode::kRadiusTooSmall:
      return fmt::format("the radius is {} too small to reach from Start to End", size);
    case AxisRemarkCode::kCentreOff:
      return fmt::format("Start and End differ by {} in their distance to Center", size);
    case AxisRemarkCode::kSpiralMisses:
      return fmt::format(
          "length, radii and type lead {} further or less far than from Start to End", size);
    case AxisRemarkCode::kSpiralTurnsTooFar:
      return fmt::format("turns by {:.1f} deg; a height over the tangent is no transition there",
                         RadToDeg(remark.size));
    case AxisRemarkCode::kSpiralBetweenCurves:
      return "this type has a formula only with one radius INF";
    case AxisRemarkCode::kSpiralRadiiEqual:
      return "both radii are equal: this is a line or an arc";
    case AxisRemarkCode::kLengthAlongTangent:
      return fmt::format("length is that of the tangent; the curve is {} longer", size);
    case AxisRemarkCode::kValueDisagrees:
      return DisagreementText(remark);
    case AxisRemarkCode::kBearingConvention:
      return "bearings fit when counted from east, counter-clockwise; the schema counts from "
             "north, "
             "clockwise. Are the coordinates east-first?";
    case AxisRemarkCode::kAngleUnit:
      return fmt::format(
          "the angle fits when multiplied by {:.6g}: is the angular unit of the "
          "file right?",
          remark.size);
    case AxisRemarkCode::kStationDisagrees:
      return fmt::format(
          "staStart says {:.4f} m, the lengths so far {:.4f} m", remark.stated, remark.computed);
    case AxisRemarkCode::kTurnsTooFar:
      return fmt::format("turns by {:.1f} deg within one element or interval",
                         RadToDeg(remark.size));
    default:
      return "";
  }
}

std::string ProfileText(const AxisRemark& remark) {
  const std::string size = Millimetres(remark.size);
  switch (remark.code) {
    case AxisRemarkCode::kProfileOrder:
      return fmt::format(
          "chainages of the profile must increase; this step is {:.4f} m, and two "
          "points are needed",
          remark.size);
    case AxisRemarkCode::kProfileOverlap:
      return fmt::format("its rounding reaches {} into the one before", size);
    case AxisRemarkCode::kProfileCurveAtEnd:
      return "a rounding needs a gradient on either side; the first and last point are PVI";
    case AxisRemarkCode::kProfileCircle:
      return "its radius is missing";
    case AxisRemarkCode::kProfileLength:
      return fmt::format(
          "length says {:.4f} m, radius and gradients {:.4f} m", remark.stated, remark.computed);
    case AxisRemarkCode::kProfileKink:
      return fmt::format("the gradient jumps by {:.3f} mm per m", 1e3 * remark.size);
    case AxisRemarkCode::kProfileOutside:
      return fmt::format("the profile reaches {} beyond the plan; that part is never used", size);
    case AxisRemarkCode::kProfileShort:
      return fmt::format("the profile is {} shorter than the plan; heights are absent there", size);
    case AxisRemarkCode::kProfileNotFinite:
      return "a value of the profile is no number, negative, or beyond 100 000 km";
    case AxisRemarkCode::kCantOrder:
      return fmt::format("stations of the cant must increase; this step is {:.4f} m", remark.size);
    case AxisRemarkCode::kCantTooLarge:
      return fmt::format("a cant of {} is more than a third of the gauge", size);
    case AxisRemarkCode::kCantJump:
      return fmt::format("the cant changes by {}, steeper than 1 in 50", size);
    case AxisRemarkCode::kCantGauge:
      return "the gauge is missing or no distance from rail to rail";
    case AxisRemarkCode::kCantWrongWay:
      return fmt::format("a cant of {} raises the inner side of the curve", size);
    case AxisRemarkCode::kEquationOrder:
      return "chainage equations must stand at different places, all numbers";
    case AxisRemarkCode::kEquationOutside:
      return fmt::format("lies {} outside the plan", size);
    case AxisRemarkCode::kEquationBack:
      return fmt::format("staBack says {:.4f} m, the counting before it gives {:.4f} m",
                         remark.stated,
                         remark.computed);
    default:
      return "";
  }
}

std::string TableText(const AxisRemark& remark) {
  const std::string size = Millimetres(remark.size);
  switch (remark.code) {
    case AxisRemarkCode::kTableSpacing:
      return fmt::format("the next point is {} away, more than three times the usual", size);
    case AxisRemarkCode::kTableSticksOut:
      return fmt::format("this point lies {} off the curve through its neighbours", size);
    case AxisRemarkCode::kTableChainage:
      return fmt::format("chainage and plan length of this interval differ by {}", size);
    case AxisRemarkCode::kTableRounded:
      return fmt::format(
          "coordinates are rounded to {}: the direction is uncertain by {}, the "
          "curvature is of no use",
          Millimetres(remark.stated),
          Degrees(remark.size));
    case AxisRemarkCode::kTableMixed:
      return "heights or chainages stand at some points only";
    default:
      return "";
  }
}

}  // namespace

std::string RemarkText(const AxisRemark& remark, const std::string& file) {
  std::string text = file;
  if (remark.line > 0) text += fmt::format("{}{}", file.empty() ? "line " : ":", remark.line);
  if (!text.empty()) text += ": ";
  text += fmt::format("chainage {:.3f} m: ", remark.at.m);
  const int code = static_cast<int>(remark.code);
  return text + (code < 30   ? PlanText(remark)
                 : code < 60 ? ProfileText(remark)
                             : TableText(remark));
}

}  // namespace tbm
