#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "guidance/axis/plan_shape.h"

namespace tbm {

// A stretch of the plan as polynomials of tau = -1 .. 1 over its length, about its middle: the
// direction is a Chebyshev interpolation of degree 10 of the exact one, the place its integral.
// Pieces are cut until direction and curvature agree with the shape to kPieceError, so that a
// place is wrong by less than 1e-12 of the piece's length; a line or an arc is nothing special.
// Why: docs/axis.md, section 4.
inline constexpr int kDirectionTerms = 11;
inline constexpr int kPlaceTerms = 12;
inline constexpr double kPieceError = 2e-13;  // of the direction, a unit vector
inline constexpr double kPieceLargestTurn_rad = 0.6;

struct PlanPiece {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();      // [m]
  Eigen::Vector2d direction = Eigen::Vector2d::UnitX();  // at the middle, unit length
  double half_length_m = 0.0;                            // along the curve
  std::array<double, kPlaceTerms> along{};               // in half lengths, along `direction`
  std::array<double, kPlaceTerms> left{};                // in half lengths, to its left
  std::array<double, kDirectionTerms> curvature_left_per_m{};
};

struct PlanState {
  Eigen::Vector2d place;
  Eigen::Vector2d direction;  // unit length to 1e-12
};

inline Eigen::Vector2d LeftOf(const Eigen::Vector2d& direction) {
  return {-direction.y(), direction.x()};
}
inline double CrossProduct(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

PlanState StateAt(const PlanPiece& piece, double tau);
double CurvatureLeftAt(const PlanPiece& piece, double tau);

// A shape cut into pieces, beginning at the origin along x.
struct PieceRun {
  std::vector<PlanPiece> pieces;
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  double turn_rad = 0.0;  // from start to end, to the left
};

// Shapes of finite length above zero, turning by at most a few circles; ends when a piece would be
// shorter than 1e-9 of the whole, which no smooth shape needs.
PieceRun CutIntoPieces(const PlanShape& shape);

// The run moved, turned and stretched so that it leads from `start` to `end`. The stretch is what
// the rounding of a file's coordinates makes of it: callers have found it to be tiny.
void PlaceRun(const Eigen::Vector2d& start, const Eigen::Vector2d& end, PieceRun* run);

}  // namespace tbm
