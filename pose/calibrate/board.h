#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "pose/base/result.h"

namespace tbm {

enum class BoardKind {
  kChessboard,         // points are inner corners, where four squares meet
  kCircles,            // points are centres of circles in rows and columns
  kAsymmetricCircles,  // the same, every second row moved aside by one pitch
};

// A flat calibration board. Frame `board`: origin in the first point, x along the first row, y from
// row to row, z into the board; so x right and y down for one who looks at it, as in an image.
struct Board {
  BoardKind kind = BoardKind::kChessboard;
  int columns = 0;  // points in a row
  int rows = 0;
  double pitch_m = 0.0;  // from point to point; of an asymmetric grid from row to row
  // Of a circle. The middle of its picture is not the picture of its middle: without the diameter
  // that stays in the result (up to some tenths of a pixel for large circles, steeply seen).
  std::optional<double> diameter_m;
};

enum class BoardFault {
  kForm,      // not KIND:COLUMNSxROWS:PITCH_MM or KIND:COLUMNSxROWS:PITCH_MM:DIAMETER_MM
  kKind,      // another word than the three
  kSize,      // under 3 or over 64 points along one side
  kPitch,     // no number of millimetres, or outside 0.1 .. 10 000
  kDiameter,  // of a chessboard; no number; or circles that touch
};
// What would be right, for the person at the command line.
const char* Advice(BoardFault fault);

// "chessboard:9x6:25", "circles:7x5:30:12", "asymmetric_circles:4x11:20:14": points along a row,
// rows, pitch in mm and, of circles, diameter in mm.
Result<Board, BoardFault> ParseBoard(std::string_view text);

// All points in the board's frame [m], row by row.
std::vector<Eigen::Vector3d> BoardPoints(const Board& board);

// The board turned by half a turn (some by a quarter) looks the same: its frame is not the same in
// every picture. Harmless for the camera, useless for a tilt calibration.
bool LooksTheSameTurned(const Board& board);

}  // namespace tbm
