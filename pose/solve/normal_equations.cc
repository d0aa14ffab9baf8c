#include "pose/solve/normal_equations.h"

#include <cmath>

namespace tbm {
namespace {

Whitener WhitenerOf(const Eigen::Matrix2d& covariance) {
  Whitener whitener;
  whitener.inverse_l00 = 1.0 / std::sqrt(covariance(0, 0));
  whitener.l10 = covariance(1, 0) * whitener.inverse_l00;
  whitener.inverse_l11 = 1.0 / std::sqrt(covariance(1, 1) - whitener.l10 * whitener.l10);
  return whitener;
}

template <class Column>
void Whiten(const Whitener& whitener, Column&& column) {
  column[0] *= whitener.inverse_l00;
  column[1] = (column[1] - whitener.l10 * column[0]) * whitener.inverse_l11;
}

// Sums of products over pairs of rows. Both rows of an LED (u and v) ride side by side in one
// two-wide register, so the sums of u and of v stay apart until the end.
template <int kUnknowns>
class PairedSums {
 public:
  using Rows = Eigen::Matrix<double, 2, kUnknowns + 1>;  // last column: residual

  PairedSums() {
    for (auto& sum : sums_) sum.setZero();
  }

  // Columns before kFirst are zero in these rows.
  template <int kFirst, int kLast>
  void Add(const Rows& rows) {
    for (int a = kFirst; a < kLast; ++a) AddColumn<kFirst>(rows, a);
    AddColumn<kFirst>(rows, kUnknowns);
    sums_[Slot(kUnknowns, kUnknowns)] += rows.col(kUnknowns).array().square();
  }

  double Sum(int a, int b) const { return sums_[Slot(a, b)].sum(); }

 private:
  static constexpr std::size_t Slot(int a, int b) {
    return static_cast<std::size_t>(a * (a + 1) / 2 + b);
  }
  template <int kFirst>
  void AddColumn(const Rows& rows, int a) {
    const int last = a < kUnknowns ? a : kUnknowns - 1;
    for (int b = kFirst; b <= last; ++b) {
      sums_[Slot(a, b)] += rows.col(a).array() * rows.col(b).array();
    }
  }

  std::array<Eigen::Array2d, Slot(kUnknowns, kUnknowns) + 1> sums_;
};

// Order of unknowns: intrinsics (when kNuisances is 4), then the pose.
template <int kNuisances>
void Form(const LinearPose& linear, const Weights& weights, NormalEquations& normal) {
  constexpr int kUnknowns = kNuisances + 6;
  PairedSums<kUnknowns> sums;
  typename PairedSums<kUnknowns>::Rows rows;
  for (int i = 0; i < linear.count; ++i) {
    const auto slot = static_cast<std::size_t>(i);
    const LedRows& led = linear.leds[slot];
    if constexpr (kNuisances == 4) {
      const Eigen::Vector4d& sigma = weights.intrinsics_sigma_px;
      const Eigen::Vector2d& focal = weights.by_focal_length[slot];
      rows.template leftCols<4>() << sigma[0] * focal.x(), 0.0, sigma[2], 0.0, 0.0,
          sigma[1] * focal.y(), 0.0, sigma[3];
    }
    rows.template middleCols<6>(kNuisances) = led.by_pose;
    rows.col(kUnknowns) = led.residual_px;
    for (int a = 0; a <= kUnknowns; ++a) Whiten(weights.leds[slot], rows.col(a));
    sums.template Add<0, kUnknowns>(rows);
  }
  if (linear.has_tilts) {
    rows.template middleCols<3>(kNuisances) = linear.tilts.by_turn;
    rows.col(kUnknowns) = linear.tilts.residual;
    for (int a = kNuisances; a < kNuisances + 3; ++a) Whiten(weights.tilts, rows.col(a));
    Whiten(weights.tilts, rows.col(kUnknowns));
    rows.template rightCols<4>().template leftCols<3>().setZero();
    sums.template Add<kNuisances, kNuisances + 3>(rows);
  }

  double matrix[kUnknowns + 1][kUnknowns + 1];
  for (int a = 0; a <= kUnknowns; ++a) {
    for (int b = 0; b <= a; ++b) matrix[a][b] = sums.Sum(a, b);
  }
  // Eliminating the nuisances (their prior is a unit variance) leaves the pose's own system; the
  // last row carries the gradient and, on the diagonal, the cost.
  for (int k = 0; k < kNuisances; ++k) {
    const double inverse_pivot = 1.0 / (matrix[k][k] + 1.0);
    for (int a = k + 1; a <= kUnknowns; ++a) {
      const double factor = matrix[a][k] * inverse_pivot;
      for (int b = k + 1; b <= a; ++b) matrix[a][b] -= factor * matrix[b][k];
    }
  }
  for (int a = 0; a < 6; ++a) {
    for (int b = 0; b <= a; ++b) {
      normal.information(a, b) = normal.information(b, a) = matrix[kNuisances + a][kNuisances + b];
    }
    normal.gradient[a] = matrix[kUnknowns][kNuisances + a];
  }
  normal.cost = matrix[kUnknowns][kUnknowns];
}

}  // namespace

bool LinearisePose(const PoseProblem& problem,
                   const TiltConstraint* tilts,
                   const Rigid3& camera_from_target,
                   LinearPose& linear) {
  const Eigen::Matrix3d rotation = camera_from_target.rotation.toRotationMatrix();
  linear.count = static_cast<int>(problem.leds.size());
  linear.has_tilts = tilts != nullptr;
  const LedObservation* led = problem.leds.data();
  for (int i = 0; i < linear.count; ++i, ++led) {
    LedRows& rows = linear.leds[static_cast<std::size_t>(i)];
    if (!RowsOfLed(*problem.rig, *led, rotation, camera_from_target.translation, rows)) {
      return false;
    }
  }
  if (tilts != nullptr) linear.tilts = tilts->At(rotation);
  return true;
}

void Weigh(const PoseProblem& problem, const LinearPose& linear, Weights& weights) {
  weights.has_intrinsics = !problem.rig->intrinsics_sigma_px.isZero(0.0);
  weights.intrinsics_sigma_px = problem.rig->intrinsics_sigma_px;
  const LedObservation* led = problem.leds.data();
  for (int i = 0; i < linear.count; ++i, ++led) {
    const auto slot = static_cast<std::size_t>(i);
    weights.leds[slot] = WhitenerOf(CovarianceOfLed(*problem.rig, *led, linear.leds[slot]));
    weights.by_focal_length[slot] = linear.leds[slot].by_focal_length;
  }
  if (linear.has_tilts) weights.tilts = WhitenerOf(linear.tilts.covariance);
}

void FormNormal(const LinearPose& linear, const Weights& weights, NormalEquations& normal) {
  if (weights.has_intrinsics) {
    Form<4>(linear, weights, normal);
  } else {
    Form<0>(linear, weights, normal);
  }
}

// Loops of six, unrolled: their counters would cost as much as what they count.
bool Factorise(const Eigen::Matrix<double, 6, 6>& information, double damping, Factor6& factor) {
  // A pivot this far below its diagonal is what rounding leaves of zero.
  constexpr double kSingular = 1e-14;
  Eigen::Matrix<double, 6, 6>& lower = factor.lower;
  lower = information;
#pragma GCC unroll 6
  for (int k = 0; k < 6; ++k) {
    const double diagonal = information(k, k);
    const double pivot = lower(k, k) + damping * diagonal;
    if (!(pivot > kSingular * diagonal)) return false;
    const double inverse_pivot = 1.0 / pivot;
    factor.inverse_pivot[k] = inverse_pivot;
#pragma GCC unroll 6
    for (int i = k + 1; i < 6; ++i) {
      const double ratio = lower(i, k) * inverse_pivot;
#pragma GCC unroll 6
      for (int j = k + 1; j <= i; ++j) lower(i, j) -= ratio * lower(j, k);
    }
#pragma GCC unroll 6
    for (int i = k + 1; i < 6; ++i) lower(i, k) *= inverse_pivot;
  }
  return true;
}

Eigen::Matrix<double, 6, 1> SolveWith(const Factor6& factor,
                                      const Eigen::Matrix<double, 6, 1>& right) {
  Eigen::Matrix<double, 6, 1> x = right;
#pragma GCC unroll 6
  for (int k = 0; k < 6; ++k) {
#pragma GCC unroll 6
    for (int i = k + 1; i < 6; ++i) x[i] -= factor.lower(i, k) * x[k];
  }
  x.array() *= factor.inverse_pivot.array();
#pragma GCC unroll 6
  for (int k = 5; k >= 0; --k) {
#pragma GCC unroll 6
    for (int i = 0; i < k; ++i) x[i] -= factor.lower(k, i) * x[k];
  }
  return x;
}

Eigen::Matrix<double, 6, 6> InverseOf(const Factor6& factor) {
  // Rows of L^-1, then L^-T D^-1 L^-1.
  Eigen::Matrix<double, 6, 6> inverse_lower = Eigen::Matrix<double, 6, 6>::Identity();
#pragma GCC unroll 6
  for (int j = 0; j < 6; ++j) {
#pragma GCC unroll 6
    for (int i = j + 1; i < 6; ++i) {
      double sum = factor.lower(i, j);
#pragma GCC unroll 6
      for (int k = j + 1; k < i; ++k) sum += factor.lower(i, k) * inverse_lower(k, j);
      inverse_lower(i, j) = -sum;
    }
  }
  Eigen::Matrix<double, 6, 6> inverse;
#pragma GCC unroll 6
  for (int a = 0; a < 6; ++a) {
#pragma GCC unroll 6
    for (int b = 0; b <= a; ++b) {
      double sum = 0.0;
#pragma GCC unroll 6
      for (int k = a; k < 6; ++k) {
        sum += inverse_lower(k, a) * factor.inverse_pivot[k] * inverse_lower(k, b);
      }
      inverse(a, b) = inverse(b, a) = sum;
    }
  }
  return inverse;
}

}  // namespace tbm
