#pragma once

#include <vector>

#include "guidance/axis/chainage.h"

namespace tbm {

// What is odd in the description of an axis. Append only: the codes stand in reports.
enum class AxisRemarkCode {
  // Plan. `size` is metres unless said otherwise.
  kNoPlan = 1,                // neither elements nor a table of two points
  kNotFinite = 2,             // a coordinate or length that is no number, or beyond 1e8 m
  kNoLength = 3,              // start and end are the same point
  kGap = 4,                   // the element does not begin where the one before ends
  kKink = 5,                  // [rad] direction jumps at its start
  kEndsSwapped = 6,           // the gaps vanish when start and end of the element change places
  kTurningMirrored = 7,       // it fits when it turns to the other side
  kRadiiSwapped = 8,          // a spiral that fits with its radii exchanged
  kRadiusMissing = 9,         // a curve with neither centre nor radius
  kRadiusTooSmall = 10,       // half of the chord does not fit
  kCentreOff = 11,            // distances from the centre to start and end differ
  kSpiralMisses = 12,         // length, radii and type lead elsewhere than to the stated end
  kSpiralTurnsTooFar = 13,    // [rad] beyond where the formula describes a curve
  kSpiralBetweenCurves = 14,  // the type has a formula only with one infinite radius
  kSpiralRadiiEqual = 15,     // both radii are infinite, or equal: a line or an arc
  kLengthAlongTangent = 16,   // the stated length is that of the tangent, not of the curve
  kValueDisagrees = 17,       // a redundant value; see `quantity`
  kBearingConvention = 18,    // bearings fit when counted from east, counter-clockwise
  kAngleUnit = 19,         // angles fit when read in another unit; `size`: grads 400, degrees 360
  kStationDisagrees = 20,  // staStart of the element is not where it begins
  kTurnsTooFar = 21,       // [rad] one element turns by more than a full circle
  // Profile.
  kProfileOrder = 30,       // chainages do not increase
  kProfileOverlap = 31,     // two roundings reach into each other
  kProfileCurveAtEnd = 32,  // a rounding where only one gradient exists
  kProfileCircle = 33,      // no such circle: radius missing, or gradients too steep for it
  kProfileLength = 34,      // the stated length of a circle is neither its arc nor its plan length
  kProfileKink = 35,        // [1] gradient jumps
  kProfileOutside = 36,     // reaches beyond the plan; that part is never used
  kProfileShort = 37,       // ends before the plan does; heights are absent there
  kProfileNotFinite = 38,
  // Cant.
  kCantOrder = 40,
  kCantTooLarge = 41,  // more than a third of the gauge
  kCantJump = 42,      // [m] two stations at one chainage, or steeper than 1 in 50
  kCantGauge = 43,     // missing or not positive
  kCantWrongWay = 44,  // the outer side of the curve is the lower one
  // Equations.
  kEquationOrder = 50,
  kEquationOutside = 51,
  kEquationBack = 52,  // staBack is not what the counting before gives
  // Table.
  kTableSpacing = 60,    // a gap of more than three times the usual spacing
  kTableSticksOut = 61,  // a point off the curve through its neighbours
  kTableChainage = 62,   // chainage and plan length of one interval differ
  kTableRounded = 63,    // [rad] what the rounding of the coordinates makes of the direction
  kTableMixed = 64,      // heights or chainages at some points only
};

enum class Severity {
  kRefused,  // no axis is made of it
  kOdd,      // usable; somebody should look at it
};

enum class StatedQuantity {
  kNone,
  kLength,
  kRadius,
  kChord,
  kTurn,
  kBearingStart,
  kBearingEnd,
  kClothoidConstant,
  kTotalX,
  kTotalY,
  kTangent,
  kTangentLong,
  kTangentShort,
  kIntersection,
  kAlignmentLength,
};

struct AxisRemark {
  AxisRemarkCode code = AxisRemarkCode::kNoPlan;
  Severity severity = Severity::kOdd;
  int line = 0;         // in the file; 0: as a whole
  InternalChainage at;  // where it is on the axis, as far as that is known
  double size = 0.0;    // how large it is; the unit stands at the code
  StatedQuantity quantity = StatedQuantity::kNone;
  double stated = 0.0;
  double computed = 0.0;
};
using AxisRemarks = std::vector<AxisRemark>;

inline AxisRemark RemarkAt(
    AxisRemarkCode code, Severity severity, int line, InternalChainage at, double size) {
  AxisRemark remark;
  remark.code = code;
  remark.severity = severity;
  remark.line = line;
  remark.at = at;
  remark.size = size;
  return remark;
}

bool IsRefused(const AxisRemarks& remarks);

// Limits, each the smallest that real files need.
//
// Exporters round coordinates to a millimetre at worst; two such points are 1.4 mm apart.
inline constexpr double kGapRefusedAbove_m = 0.005;
inline constexpr double kGapOddAbove_m = 0.0005;
// 2 seconds of arc: what 1 mm does over 100 m.
inline constexpr double kKinkOddAbove_rad = 1e-5;
// No transition is built with 6 degrees; the element is mirrored or out of order.
inline constexpr double kKinkRefusedAbove_rad = 0.1;

}  // namespace tbm
