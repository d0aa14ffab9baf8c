#include "pose/calibrate/board.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "pose/base/parse_number.h"

namespace tbm {
namespace {

constexpr std::int64_t kLeastPoints = 3;
constexpr std::int64_t kMostPoints = 64;
constexpr double kLeastPitch_mm = 0.1;
constexpr double kMostPitch_mm = 10'000.0;

std::optional<BoardKind> KindOf(std::string_view word) {
  if (word == "chessboard") return BoardKind::kChessboard;
  if (word == "circles") return BoardKind::kCircles;
  if (word == "asymmetric_circles") return BoardKind::kAsymmetricCircles;
  return std::nullopt;
}

// Between the nearest points.
double LeastDistance(const Board& board) {
  return board.kind == BoardKind::kAsymmetricCircles ? std::numbers::sqrt2 * board.pitch_m
                                                     : board.pitch_m;
}

}  // namespace

const char* Advice(BoardFault fault) {
  switch (fault) {
    case BoardFault::kForm:
      return "must be KIND:COLUMNSxROWS:PITCH_MM, as chessboard:9x6:25, circles:7x5:30:12 (with "
             "the "
             "diameter) or asymmetric_circles:4x11:20:14";
    case BoardFault::kKind:
      return "the kind must be chessboard, circles or asymmetric_circles";
    case BoardFault::kSize:
      return "must have 3 to 64 points along a row and 3 to 64 rows; of a chessboard inner corners "
             "count, one fewer than squares";
    case BoardFault::kPitch:
      return "the pitch must be 0.1 to 10000 mm, from point to point";
    case BoardFault::kDiameter:
      return "the diameter belongs to circles only, is in mm, more than 0 and less than from "
             "centre "
             "to centre";
  }
  return "";
}

Result<Board, BoardFault> ParseBoard(std::string_view text) {
  std::array<std::string_view, 4> parts;
  std::size_t count = 0;
  for (;;) {
    if (count == parts.size()) return Failure{BoardFault::kForm};
    const std::size_t colon = text.find(':');
    parts[count++] = text.substr(0, colon);
    if (colon == std::string_view::npos) break;
    text.remove_prefix(colon + 1);
  }
  if (count < 3) return Failure{BoardFault::kForm};
  const auto kind = KindOf(parts[0]);
  if (!kind) return Failure{BoardFault::kKind};
  const std::size_t times = parts[1].find('x');
  if (times == std::string_view::npos) return Failure{BoardFault::kForm};
  const auto columns = ParseInteger(parts[1].substr(0, times));
  const auto rows = ParseInteger(parts[1].substr(times + 1));
  for (const auto& side : {columns, rows}) {
    if (!side || *side < kLeastPoints || *side > kMostPoints) return Failure{BoardFault::kSize};
  }
  const auto pitch_mm = ParseReal(parts[2]);
  if (!pitch_mm || !(*pitch_mm >= kLeastPitch_mm && *pitch_mm <= kMostPitch_mm)) {
    return Failure{BoardFault::kPitch};
  }
  Board board{*kind, static_cast<int>(*columns), static_cast<int>(*rows), 1e-3 * *pitch_mm, {}};
  if (count == 4) {
    const auto diameter_mm = ParseReal(parts[3]);
    if (*kind == BoardKind::kChessboard || !diameter_mm ||
        !(*diameter_mm > 0.0 && 1e-3 * *diameter_mm < LeastDistance(board))) {
      return Failure{BoardFault::kDiameter};
    }
    board.diameter_m = 1e-3 * *diameter_mm;
  }
  return board;
}

std::vector<Eigen::Vector3d> BoardPoints(const Board& board) {
  std::vector<Eigen::Vector3d> points;
  points.reserve(static_cast<std::size_t>(board.columns) * static_cast<std::size_t>(board.rows));
  const bool is_asymmetric = board.kind == BoardKind::kAsymmetricCircles;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      const int along = is_asymmetric ? 2 * column + row % 2 : column;
      points.emplace_back(along * board.pitch_m, row * board.pitch_m, 0.0);
    }
  }
  return points;
}

bool LooksTheSameTurned(const Board& board) {
  switch (board.kind) {
    case BoardKind::kChessboard:
      // Colours are exchanged by half a turn where one side is even and the other odd.
      return (board.columns + board.rows) % 2 == 0;
    case BoardKind::kCircles:
      return true;
    case BoardKind::kAsymmetricCircles:
      // With an odd number of rows half a turn takes the rows that stand out to the other side.
      return board.rows % 2 == 0;
  }
  return true;
}

}  // namespace tbm
