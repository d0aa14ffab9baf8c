#pragma once

#include <string>
#include <string_view>

#include "pose/base/result.h"

namespace tbm {

enum class TargetKind {
  kLed,     // a lamp: a bright spot some pixels wide
  kCircle,  // a flat disc, dark on light or light on dark
  kCoded,   // a square marker of ArUco's dictionary 4x4_50; the point is its middle
  kBoard,   // one point of a chessboard whose points are all surveyed
};

// What a surveyed target looks like.
struct TargetMark {
  TargetKind kind = TargetKind::kLed;
  double diameter_m = 0.0;  // of a circle
  int code = 0;             // of a coded target
  std::string board;        // name of the chessboard the point lies on
  int columns = 0;          // inner corners in a row of it, and rows
  int rows = 0;
  int point = 0;  // which of them, row by row, 0 first; the square before it is dark
};

enum class TargetMarkFault {
  kForm,      // none of the four forms
  kDiameter,  // no number of millimetres, or outside 1 .. 10 000
  kCode,      // no whole number from 0 to 49
  kBoard,     // no name; under 3 or over 64 points along a side; square; no such point
};
// What would be right, for the person who writes the file.
const char* Advice(TargetMarkFault fault);

// "led", "circle:DIAMETER_MM", "coded:NUMBER", "board:NAME:COLUMNSxROWS:POINT".
Result<TargetMark, TargetMarkFault> ParseTargetMark(std::string_view text);

}  // namespace tbm
