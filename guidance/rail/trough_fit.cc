#include "guidance/rail/trough_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Core>
#include <Eigen/QR>

namespace tbm {
namespace {

constexpr std::size_t kFewestSamples = 5;
constexpr double kWindowWidths = 3.0;
constexpr double kWidthRatio = 1.25;  // from one try to the next
constexpr int kMostSteps = 100;

// Depth, centre, logarithm of the width.
using Shape = Eigen::Vector3d;

struct Rows {
  Eigen::VectorXd residual;
  Eigen::Matrix<double, Eigen::Dynamic, 3> jacobian;  // of the model
};

// Each row divided by its sigma.
Rows RowsOf(std::span<const TroughSample> samples, const Shape& shape) {
  Rows rows;
  rows.residual.resize(static_cast<Eigen::Index>(samples.size()));
  rows.jacobian.resize(rows.residual.size(), 3);
  const double width_m = std::exp(shape[2]);
  for (Eigen::Index i = 0; i < rows.residual.size(); ++i) {
    const TroughSample& sample = samples[static_cast<std::size_t>(i)];
    const double away = (sample.distance_m - shape[1]) / width_m;
    const double bell = std::exp(-0.5 * away * away);
    rows.residual[i] = (sample.dz_m + shape[0] * bell) / sample.sigma_m;
    rows.jacobian.row(i) << -bell, -shape[0] * bell * away / width_m,
        -shape[0] * bell * away * away;
    rows.jacobian.row(i) /= sample.sigma_m;
  }
  return rows;
}

// Levenberg and Marquardt's steps; false where they do not end.
bool Refine(std::span<const TroughSample> samples, Shape* shape) {
  double damping = 1e-3;
  Rows rows = RowsOf(samples, *shape);
  for (int step = 0; step < kMostSteps; ++step) {
    const Eigen::Matrix3d normal = rows.jacobian.transpose() * rows.jacobian;
    Eigen::Matrix3d damped = normal;
    damped.diagonal() += damping * normal.diagonal();
    const Shape move =
        damped.colPivHouseholderQr().solve(rows.jacobian.transpose() * rows.residual);
    const Shape next = *shape + move;
    if (!next.allFinite() || std::abs(next[2]) > 50.0) return false;
    Rows tried = RowsOf(samples, next);
    const double gain = rows.residual.squaredNorm() - tried.residual.squaredNorm();
    if (!(gain >= 0.0)) {
      damping *= 10.0;
      if (damping > 1e12) return true;
      continue;
    }
    *shape = next;
    rows = std::move(tried);
    damping = std::max(damping / 10.0, 1e-9);
    if (gain <= 1e-10 * rows.residual.squaredNorm() + 1e-14) return true;
  }
  return false;
}

// The shape with its centre at a sample that explains most of all samples: noise on the deepest one
// must not make a needle of the trough.
Shape Begin(std::span<const TroughSample> samples, double centre_m) {
  const double whole_m = samples.back().distance_m - samples.front().distance_m;
  const double spacing_m = whole_m / static_cast<double>(samples.size());
  Shape best(0.0, centre_m, 0.0);
  double most = 0.0;
  for (double width_m = spacing_m; width_m < 0.5 * whole_m; width_m *= kWidthRatio) {
    double normal = 0.0;
    double right = 0.0;
    for (const TroughSample& sample : samples) {
      const double away = (sample.distance_m - centre_m) / width_m;
      const double bell = std::exp(-0.5 * away * away) / sample.sigma_m;
      normal += bell * bell;
      right -= bell * sample.dz_m / sample.sigma_m;
    }
    const double explained = right > 0.0 ? right * right / normal : 0.0;
    if (explained <= most) continue;
    most = explained;
    best = {right / normal, centre_m, std::log(width_m)};
  }
  return best;
}

}  // namespace

std::optional<TroughFit> FitTrough(std::span<const TroughSample> samples, double peak_m) {
  if (samples.size() < kFewestSamples) return std::nullopt;
  Shape shape = Begin(samples, peak_m);
  if (!(shape[0] > 0.0)) return std::nullopt;
  // The window follows the width.
  std::span<const TroughSample> window;
  for (int round = 0; round < 3; ++round) {
    const double reach_m = kWindowWidths * std::exp(shape[2]);
    const auto before = [](const TroughSample& sample, double m) { return sample.distance_m < m; };
    const auto first = std::lower_bound(samples.begin(), samples.end(), shape[1] - reach_m, before);
    const auto last = std::lower_bound(first, samples.end(), shape[1] + reach_m, before);
    window = std::span(first, last);
    if (window.size() < kFewestSamples || window.front().distance_m >= shape[1] ||
        window.back().distance_m <= shape[1]) {
      return std::nullopt;
    }
    if (!Refine(window, &shape)) return std::nullopt;
  }
  const double width_m = std::exp(shape[2]);
  const double whole_m = samples.back().distance_m - samples.front().distance_m;
  if (!(shape[0] > 0.0) || width_m > whole_m || shape[1] < samples.front().distance_m ||
      shape[1] > samples.back().distance_m) {
    return std::nullopt;
  }
  // One sigma at every sample, each with the sign that does the most.
  const Rows rows = RowsOf(window, shape);
  const Eigen::Matrix3d normal = rows.jacobian.transpose() * rows.jacobian;
  const Eigen::Matrix<double, 3, Eigen::Dynamic> answer =
      normal.colPivHouseholderQr().solve(rows.jacobian.transpose());
  const Shape most = answer.cwiseAbs().rowwise().sum();
  if (!most.allFinite()) return std::nullopt;
  return TroughFit{shape[0], shape[1], width_m, most[0], most[1], width_m * most[2]};
}

}  // namespace tbm
