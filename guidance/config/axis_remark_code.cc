#include "guidance/config/axis_file.h"

namespace tbm {

std::string_view RemarkCode(AxisRemarkCode code) {
  switch (code) {
    case AxisRemarkCode::kNoPlan:
      return "no_plan";
    case AxisRemarkCode::kNotFinite:
      return "not_finite";
    case AxisRemarkCode::kNoLength:
      return "no_length";
    case AxisRemarkCode::kGap:
      return "gap";
    case AxisRemarkCode::kKink:
      return "kink";
    case AxisRemarkCode::kEndsSwapped:
      return "ends_swapped";
    case AxisRemarkCode::kTurningMirrored:
      return "turning_mirrored";
    case AxisRemarkCode::kRadiiSwapped:
      return "radii_swapped";
    case AxisRemarkCode::kRadiusMissing:
      return "radius_missing";
    case AxisRemarkCode::kRadiusTooSmall:
      return "radius_too_small";
    case AxisRemarkCode::kCentreOff:
      return "centre_off";
    case AxisRemarkCode::kSpiralMisses:
      return "spiral_misses";
    case AxisRemarkCode::kSpiralTurnsTooFar:
      return "spiral_turns_too_far";
    case AxisRemarkCode::kSpiralBetweenCurves:
      return "spiral_between_curves";
    case AxisRemarkCode::kSpiralRadiiEqual:
      return "spiral_radii_equal";
    case AxisRemarkCode::kLengthAlongTangent:
      return "length_along_tangent";
    case AxisRemarkCode::kValueDisagrees:
      return "value_disagrees";
    case AxisRemarkCode::kBearingConvention:
      return "bearing_convention";
    case AxisRemarkCode::kAngleUnit:
      return "angle_unit";
    case AxisRemarkCode::kStationDisagrees:
      return "station_disagrees";
    case AxisRemarkCode::kTurnsTooFar:
      return "turns_too_far";
    case AxisRemarkCode::kProfileOrder:
      return "profile_order";
    case AxisRemarkCode::kProfileOverlap:
      return "profile_overlap";
    case AxisRemarkCode::kProfileCurveAtEnd:
      return "profile_curve_at_end";
    case AxisRemarkCode::kProfileCircle:
      return "profile_circle";
    case AxisRemarkCode::kProfileLength:
      return "profile_length";
    case AxisRemarkCode::kProfileKink:
      return "profile_kink";
    case AxisRemarkCode::kProfileOutside:
      return "profile_outside";
    case AxisRemarkCode::kProfileShort:
      return "profile_short";
    case AxisRemarkCode::kProfileNotFinite:
      return "profile_not_finite";
    case AxisRemarkCode::kCantOrder:
      return "cant_order";
    case AxisRemarkCode::kCantTooLarge:
      return "cant_too_large";
    case AxisRemarkCode::kCantJump:
      return "cant_jump";
    case AxisRemarkCode::kCantGauge:
      return "cant_gauge";
    case AxisRemarkCode::kCantWrongWay:
      return "cant_wrong_way";
    case AxisRemarkCode::kEquationOrder:
      return "equation_order";
    case AxisRemarkCode::kEquationOutside:
      return "equation_outside";
    case AxisRemarkCode::kEquationBack:
      return "equation_back";
    case AxisRemarkCode::kTableSpacing:
      return "table_spacing";
    case AxisRemarkCode::kTableSticksOut:
      return "table_sticks_out";
    case AxisRemarkCode::kTableChainage:
      return "table_chainage";
    case AxisRemarkCode::kTableRounded:
      return "table_rounded";
    case AxisRemarkCode::kTableMixed:
      return "table_mixed";
  }
  return "";
}

}  // namespace tbm
