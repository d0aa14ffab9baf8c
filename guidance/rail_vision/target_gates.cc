#include "guidance/rail_vision/target_gates.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/LU>

namespace tbm {
namespace {

// Chi-squared of two degrees of freedom: one target of a million lies further out.
constexpr double kGate = 27.6;
// How many stray candidates may be expected in a gate.
constexpr double kMostStrays = 0.05;
// A disc seen from the side keeps its longer diameter; how far it is away is known to some percent.
constexpr double kSizeTolerance = 0.2;
constexpr double kSizeSlack_px = 1.0;

bool HasSize(double expected_px, double seen_px) {
  return std::abs(seen_px - expected_px) <= kSizeTolerance * expected_px + kSizeSlack_px;
}

}  // namespace

double TargetGates::Gate::Distance(const Eigen::Vector2d& at_px) const {
  const Eigen::Vector2d off_px = at_px - pixel_px;
  return off_px.dot(covariance_px2.inverse() * off_px);
}

bool TargetGates::Gate::Has(const Eigen::Vector2d& at_px) const { return Distance(at_px) <= kGate; }

double TargetGates::Gate::HalfWidth_px() const {
  return std::sqrt(kGate * covariance_px2.diagonal().maxCoeff());
}

double TargetGates::Gate::Area_px2() const {
  return std::numbers::pi * kGate * std::sqrt(std::max(0.0, covariance_px2.determinant()));
}

TargetGates::Gate TargetGates::At(std::size_t target, double sigma_px) const {
  const ExpectedPixel& expected = Expected(target);
  Gate gate;
  const Eigen::Vector2d moved_px = expected.by_state * e_;
  gate.pixel_px = expected.pixel_px + moved_px;
  gate.covariance_px2 = expected.by_state * covariance_ * expected.by_state.transpose();
  const double bend_px = Bend_px(moved_px, gate.covariance_px2);
  gate.covariance_px2.diagonal().array() +=
      sigma_px * sigma_px + bend_px * bend_px + expected.survey_sigma_px * expected.survey_sigma_px;
  return gate;
}

double TargetGates::Bend_px(const Eigen::Vector2d& moved_px,
                            const Eigen::Matrix2d& covariance_px2) const {
  return (moved_px.squaredNorm() + covariance_px2.trace()) / expected_.focal_px;
}

void TargetGates::Take(std::size_t target, const Eigen::Vector2d& pixel_px, double sigma_px) {
  const Gate gate = At(target, sigma_px);
  const auto& by_state = Expected(target).by_state;
  const Eigen::MatrixXd gain = covariance_ * by_state.transpose() * gate.covariance_px2.inverse();
  e_ += gain * (pixel_px - gate.pixel_px);
  covariance_ -= gain * gate.covariance_px2 * gain.transpose();
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
}

std::vector<GateMatch> MatchInGates(const std::vector<std::size_t>& targets,
                                    const std::vector<double>& diameters_m,
                                    const std::vector<GateCandidate>& candidates,
                                    double area_px2,
                                    TargetGates* gates) {
  std::vector<GateMatch> matches(targets.size());
  std::vector<bool> is_taken(candidates.size(), false);
  for (std::size_t i = 0; i < targets.size(); ++i) matches[i].target = targets[i];
  for (;;) {
    // What lies in whose gate, as far as the gates are known by now.
    std::vector<int> rivals(candidates.size(), 0);
    std::vector<std::vector<std::size_t>> inside(targets.size());
    std::vector<double> areas(targets.size(), 0.0);
    for (std::size_t i = 0; i < targets.size(); ++i) {
      if (matches[i].verdict == MatchVerdict::kMatched) continue;
      for (std::size_t c = 0; c < candidates.size(); ++c) {
        if (is_taken[c]) continue;
        const double expected_px = diameters_m[i] * gates->Expected(targets[i]).px_per_m;
        if (diameters_m[i] > 0.0 && !HasSize(expected_px, candidates[c].diameter_px)) continue;
        const auto gate = gates->At(targets[i], candidates[c].sigma_px);
        if (!gate.Has(candidates[c].pixel_px)) continue;
        inside[i].push_back(c);
        ++rivals[c];
        areas[i] = std::max(areas[i], gate.Area_px2());
      }
      matches[i].verdict =
          inside[i].empty() ? MatchVerdict::kNothingThere : MatchVerdict::kAmbiguous;
    }
    // Every candidate that is not yet a target may be a stray one.
    double free = 0.0;
    for (std::size_t c = 0; c < candidates.size(); ++c) {
      if (!is_taken[c] && rivals[c] == 0) free += 1.0;
    }
    std::size_t best = targets.size();
    for (std::size_t i = 0; i < targets.size(); ++i) {
      if (matches[i].verdict != MatchVerdict::kAmbiguous || inside[i].size() != 1) continue;
      if (rivals[inside[i].front()] != 1) continue;
      if ((free + 1.0) * areas[i] / area_px2 > kMostStrays) continue;
      if (best == targets.size() || areas[i] < areas[best]) best = i;
    }
    if (best == targets.size()) return matches;
    const std::size_t candidate = inside[best].front();
    matches[best] = {targets[best], MatchVerdict::kMatched, candidate};
    is_taken[candidate] = true;
    gates->Take(targets[best], candidates[candidate].pixel_px, candidates[candidate].sigma_px);
  }
}

}  // namespace tbm
