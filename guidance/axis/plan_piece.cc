#include "guidance/axis/plan_piece.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pose/base/check.h"

namespace tbm {
namespace {

using Direction = std::array<double, kDirectionTerms>;
using Place = std::array<double, kPlaceTerms>;

// Takes values at the Chebyshev nodes to the coefficients of 1, tau, tau^2, ..
class Interpolation {
 public:
  Interpolation() {
    constexpr int n = kDirectionTerms;
    std::array<Direction, n> chebyshev{};  // T_m in powers of tau
    chebyshev[0][0] = 1.0;
    chebyshev[1][1] = 1.0;
    for (std::size_t m = 2; m < n; ++m) {
      for (std::size_t p = 0; p < n; ++p) {
        chebyshev[m][p] = (p > 0 ? 2.0 * chebyshev[m - 1][p - 1] : 0.0) - chebyshev[m - 2][p];
      }
    }
    for (std::size_t j = 0; j < n; ++j) {
      const double angle = std::numbers::pi * (static_cast<double>(j) + 0.5) / n;
      nodes_[j] = std::cos(angle);
      for (std::size_t m = 0; m < n; ++m) {
        const double share = (m == 0 ? 1.0 : 2.0) / n * std::cos(static_cast<double>(m) * angle);
        for (std::size_t p = 0; p < n; ++p) power_from_value_[p][j] += share * chebyshev[m][p];
      }
    }
  }
  const Direction& nodes() const { return nodes_; }
  Direction Powers(const Direction& values) const {
    Direction powers{};
    for (std::size_t p = 0; p < kDirectionTerms; ++p) {
      for (std::size_t j = 0; j < kDirectionTerms; ++j) {
        powers[p] += power_from_value_[p][j] * values[j];
      }
    }
    return powers;
  }

 private:
  Direction nodes_{};
  std::array<Direction, kDirectionTerms> power_from_value_{};
};

const Interpolation& TheInterpolation() {
  static const Interpolation interpolation;
  return interpolation;
}

template <std::size_t N>
double Evaluate(const std::array<double, N>& powers, double tau) {
  double value = powers[N - 1];
  for (std::size_t p = N - 1; p-- > 0;) value = value * tau + powers[p];
  return value;
}

Place Integrated(const Direction& powers) {
  Place integral{};
  for (std::size_t p = 0; p < kDirectionTerms; ++p) {
    integral[p + 1] = powers[p] / static_cast<double>(p + 1);
  }
  return integral;
}

class Cutter {
 public:
  explicit Cutter(const PlanShape& shape) : shape_(shape) {}

  PieceRun Cut() {
    std::vector<double> bounds_m = {0.0};
    for (const double at_m : shape_.breaks_m) {
      if (at_m > bounds_m.back() && at_m < shape_.length_m) bounds_m.push_back(at_m);
    }
    bounds_m.push_back(shape_.length_m);
    for (std::size_t i = 1; i < bounds_m.size(); ++i) Append(bounds_m[i - 1], bounds_m[i]);
    run_.turn_rad = shape_.turn_rad(shape_.length_m);
    return std::move(run_);
  }

 private:
  void Append(double from_m, double to_m) {
    PlanPiece piece;
    const bool is_fine = Fit(from_m, to_m, &piece);
    if (!is_fine && to_m - from_m > 1e-9 * shape_.length_m) {
      const double middle_m = 0.5 * (from_m + to_m);
      Append(from_m, middle_m);
      Append(middle_m, to_m);
      return;
    }
    const Eigen::Vector2d at_start = StateAt(piece, -1.0).place;
    piece.middle += run_.end - at_start;
    run_.end = StateAt(piece, 1.0).place;
    run_.pieces.push_back(piece);
  }

  // Leaves the middle at the origin. False when the polynomials do not describe the shape.
  bool Fit(double from_m, double to_m, PlanPiece* piece) const {
    const double middle_m = 0.5 * (from_m + to_m);
    const double half_m = 0.5 * (to_m - from_m);
    const double turn_rad = shape_.turn_rad(middle_m);
    piece->direction = {std::cos(turn_rad), std::sin(turn_rad)};
    piece->half_length_m = half_m;
    Direction cosine;
    Direction sine;
    Direction curvature;
    for (std::size_t j = 0; j < kDirectionTerms; ++j) {
      const double s_m = middle_m + half_m * TheInterpolation().nodes()[j];
      const double more_rad = shape_.turn_rad(s_m) - turn_rad;
      if (std::abs(more_rad) > 0.5 * kPieceLargestTurn_rad) return false;
      cosine[j] = std::cos(more_rad);
      sine[j] = std::sin(more_rad);
      curvature[j] = shape_.curvature_left_per_m(s_m);
    }
    const Direction along = TheInterpolation().Powers(cosine);
    const Direction left = TheInterpolation().Powers(sine);
    piece->curvature_left_per_m = TheInterpolation().Powers(curvature);
    piece->along = Integrated(along);
    piece->left = Integrated(left);
    // Between the nodes, where an interpolation is worst, and at the ends.
    for (const double tau : {-1.0, -0.95, -0.65, -0.15, 0.15, 0.65, 0.95, 1.0}) {
      const double s_m = middle_m + half_m * tau;
      const double more_rad = shape_.turn_rad(s_m) - turn_rad;
      const double error = std::max(std::abs(Evaluate(along, tau) - std::cos(more_rad)),
                                    std::abs(Evaluate(left, tau) - std::sin(more_rad)));
      const double curvature_error =
          std::abs(CurvatureLeftAt(*piece, tau) - shape_.curvature_left_per_m(s_m)) * half_m;
      if (!(error < kPieceError) || !(curvature_error < 1e-10)) return false;
    }
    return true;
  }

  const PlanShape& shape_;
  PieceRun run_;
};

}  // namespace

PlanState StateAt(const PlanPiece& piece, double tau) {
  // Value and derivative of both polynomials in one pass.
  double along = piece.along[kPlaceTerms - 1];
  double left = piece.left[kPlaceTerms - 1];
  double along_by_tau = 0.0;
  double left_by_tau = 0.0;
  for (std::size_t p = kPlaceTerms - 1; p-- > 0;) {
    along_by_tau = along_by_tau * tau + along;
    left_by_tau = left_by_tau * tau + left;
    along = along * tau + piece.along[p];
    left = left * tau + piece.left[p];
  }
  const Eigen::Vector2d normal = LeftOf(piece.direction);
  return {piece.middle + piece.half_length_m * (along * piece.direction + left * normal),
          along_by_tau * piece.direction + left_by_tau * normal};
}

double CurvatureLeftAt(const PlanPiece& piece, double tau) {
  return Evaluate(piece.curvature_left_per_m, tau);
}

PieceRun CutIntoPieces(const PlanShape& shape) {
  TBM_CHECK(shape.length_m > 0.0);
  return Cutter(shape).Cut();
}

void PlaceRun(const Eigen::Vector2d& start, const Eigen::Vector2d& end, PieceRun* run) {
  const Eigen::Vector2d chord = end - start;
  const double scale = chord.norm() / run->end.norm();
  // Rotation as a complex number: chord / (scale * end of the run).
  const Eigen::Vector2d turn(chord.dot(run->end) / (scale * run->end.squaredNorm()),
                             CrossProduct(run->end, chord) / (scale * run->end.squaredNorm()));
  const auto turned = [&turn](const Eigen::Vector2d& v) -> Eigen::Vector2d {
    return {turn.x() * v.x() - turn.y() * v.y(), turn.y() * v.x() + turn.x() * v.y()};
  };
  for (PlanPiece& piece : run->pieces) {
    piece.middle = start + scale * turned(piece.middle);
    piece.direction = turned(piece.direction).normalized();
    piece.half_length_m *= scale;
    for (double& power : piece.curvature_left_per_m) power /= scale;
  }
  run->end = end;
}

}  // namespace tbm
