#include "pose/centres/assign_judge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/LU>

#include "pose/solve/dense_cholesky.h"
#include "pose/solve/linearised.h"

namespace tbm::assign {
namespace {

// An explanation is believed when fewer than this many as good ones are expected by chance.
constexpr double kMostChance = 1e-3;

PoseProblem ProblemOf(const Scene& scene, const Matches& matches) {
  PoseProblem problem;
  problem.rig = scene.rig;
  for (const Match& match : matches) {
    const Spot& spot = scene.spots[static_cast<std::size_t>(match.spot)];
    problem.leds.push_back({match.led, spot.pixel_px, spot.own_sigma_px});
  }
  problem.target_tilt = scene.target_tilt;
  problem.camera_tilt = scene.camera_tilt;
  return problem;
}

double LogFactorial(double n) { return std::lgamma(n + 1.0); }

// Number of ways to name `leds` of all LEDs and give each a spot of its own.
double LogWays(int all_leds, int all_spots, int leds) {
  return LogFactorial(all_leds) - LogFactorial(leds) - LogFactorial(all_leds - leds) +
         LogFactorial(all_spots) - LogFactorial(all_spots - leds);
}

// Volume of a ball with squared radius chi2. Perfect agreement is no better evidence than good
// agreement, hence the least radius.
double LogBall(double chi2, int dimensions) {
  const double half = 0.5 * dimensions;
  const double radius2 = std::max(chi2, 0.25 * dimensions);
  return half * std::log(std::numbers::pi * radius2) - LogFactorial(half);
}

// |det|, by elimination with the largest pivot of each column.
double Determinant(Information rows) {
  double product = 1.0;
  for (int k = 0; k < 6; ++k) {
    int largest = k;
    for (int i = k + 1; i < 6; ++i) {
      if (std::abs(rows(i, k)) > std::abs(rows(largest, k))) largest = i;
    }
    const double pivot = rows(largest, k);
    if (pivot == 0.0) return 0.0;
    if (largest != k) {
      for (int j = k; j < 6; ++j) std::swap(rows(k, j), rows(largest, j));
    }
    product *= pivot;
    const double inverse = 1.0 / pivot;
    for (int i = k + 1; i < 6; ++i) {
      const double factor = rows(i, k) * inverse;
      for (int j = k + 1; j < 6; ++j) rows(i, j) -= factor * rows(k, j);
    }
  }
  return std::abs(product);
}

// |det| of the derivative of as few rows as fix the pose, for the LEDs that fix it best.
double LogBestBasis(const LinearisedProblem& linear, int leds) {
  Information rows = Information::Zero();
  double best = 0.0;
  if (linear.tilt_rows > 0) rows.bottomRows<2>() = linear.by_pose.bottomRows<2>();
  for (int i = 0; i < leds; ++i) {
    rows.topRows<2>() = linear.by_pose.middleRows<2>(2 * i);
    for (int j = i + 1; j < leds; ++j) {
      rows.middleRows<2>(2) = linear.by_pose.middleRows<2>(2 * j);
      if (linear.tilt_rows > 0) {
        best = std::max(best, Determinant(rows));
        continue;
      }
      for (int k = j + 1; k < leds; ++k) {
        rows.bottomRows<2>() = linear.by_pose.middleRows<2>(2 * k);
        best = std::max(best, Determinant(rows));
      }
    }
  }
  return std::log(best);
}

// Logarithm of the determinant of a factorised matrix.
double LogDeterminant(const Factor6& factor) {
  double product = 1.0;
  for (int k = 0; k < 6; ++k) product *= factor.inverse_pivot[k];
  return -std::log(product);
}

struct Solved {
  Information without_leds = Information::Zero();  // prior and tilts alone
  Factor6 factor;                                  // of the information of all
  double log_det_covariance = 0.0;                 // of all rows
  double log_det_tilts = 0.0;
};

// Expected chance explanations: ways to match, times the volume in which the spots that are not
// needed to fix the pose must fall, by the area they could fall in.
double LogChance(const Scene& scene,
                 const LinearisedProblem& linear,
                 const Solved& solved,
                 const Verdict& verdict,
                 UsePrior use_prior) {
  const int leds = static_cast<int>(verdict.matches.size());
  const double log_area = std::log(scene.spot_area_px2);
  const double log_ways =
      LogWays(static_cast<int>(scene.rig->leds.size()), static_cast<int>(scene.spots.size()), leds);
  const double log_det_all = LogDeterminant(solved.factor);
  if (use_prior == UsePrior::kYes) {
    Factor6 before;
    if (!Factorise(solved.without_leds, 0.0, before))
      return std::numeric_limits<double>::infinity();
    const double log_spread = 0.5 * (solved.log_det_covariance - solved.log_det_tilts +
                                     log_det_all - LogDeterminant(before));
    return log_ways + LogBall(verdict.chi2, 2 * leds) + log_spread - leds * log_area;
  }
  const int basis_leds = linear.tilt_rows > 0 ? 2 : 3;
  const double log_roots = std::log(linear.tilt_rows > 0 ? 2.0 : 4.0);
  if (leds <= basis_leds) return log_roots + log_ways;
  const double log_spread =
      0.5 * (solved.log_det_covariance + log_det_all) - LogBestBasis(linear, leds);
  const int free_leds = leds - basis_leds;
  return log_roots + log_ways + LogBall(verdict.chi2, 2 * free_leds) + log_spread -
         free_leds * log_area;
}

bool WithinDistances(const Scene& scene, const Verdict& verdict) {
  return std::all_of(verdict.matches.begin(), verdict.matches.end(), [&](const Match& match) {
    const Led& led = scene.rig->leds[static_cast<std::size_t>(match.led)];
    const double z_m = (verdict.camera_from_target * led.p_led_in_target).z();
    return z_m >= scene.options.min_distance_m && z_m <= scene.options.max_distance_m;
  });
}

// One step of generalised least squares with the whole covariance, from the pose of the search.
std::optional<Verdict> Judge(const Scene& scene, const Candidate& candidate, UsePrior use_prior) {
  const PoseProblem problem = ProblemOf(scene, candidate.matches);
  auto linear = Linearise(problem, candidate.fit.camera_from_target);
  if (!linear) return std::nullopt;
  LinearisedProblem::Rows residual = linear->residual;
  LinearisedProblem::RowsByPose by_pose = linear->by_pose;
  const Eigen::Matrix2d tilt_covariance =
      linear->tilt_rows > 0 ? Eigen::Matrix2d(linear->covariance.bottomRightCorner<2, 2>())
                            : Eigen::Matrix2d(Eigen::Matrix2d::Identity());
  if (!FactoriseCholesky(linear->covariance)) return std::nullopt;
  SolveLower(linear->covariance, residual);
  SolveLower(linear->covariance, by_pose);

  Solved solved;
  Information information;
  PoseError gradient;
  NormalOf(by_pose, residual, information, gradient);
  double chi2 = residual.squaredNorm();
  if (use_prior == UsePrior::kYes) {
    const PoseError error =
        ErrorBetween(candidate.fit.camera_from_target, scene.prior->camera_from_target);
    const PoseError pull = scene.prior->information.lazyProduct(error);
    solved.without_leds = scene.prior->information;
    information += scene.prior->information;
    gradient += pull;
    chi2 += error.dot(pull);
  }
  if (linear->tilt_rows > 0) {
    const Eigen::Matrix<double, 2, 6> tilt_rows = linear->by_pose.bottomRows<2>();
    const Eigen::Matrix<double, 2, 6> weighted = tilt_covariance.inverse().lazyProduct(tilt_rows);
    solved.without_leds += tilt_rows.transpose().lazyProduct(weighted);
    solved.log_det_tilts = std::log(tilt_covariance.determinant());
  }
  solved.log_det_covariance = LogDeterminantOfFactor(linear->covariance);
  if (!Factorise(information, 0.0, solved.factor)) return std::nullopt;
  const PoseError move = SolveWith(solved.factor, gradient);
  if (!move.allFinite()) return std::nullopt;

  Verdict verdict;
  verdict.matches = candidate.matches;
  verdict.camera_from_target = Moved(candidate.fit.camera_from_target, move);
  verdict.chi2 = std::max(0.0, chi2 - move.dot(gradient));
  verdict.dof = linear->led_rows + linear->tilt_rows - (use_prior == UsePrior::kYes ? 0 : 6);
  if (verdict.dof > 0 && verdict.chi2 > Chi2Gate(verdict.dof, scene.options.gate_sigma)) {
    return std::nullopt;
  }
  if (!WithinDistances(scene, verdict)) return std::nullopt;
  verdict.log_chance = LogChance(scene, *linear, solved, verdict, use_prior);
  return verdict;
}

// The LED whose spot a false one would replace most easily.
struct Weakest {
  std::size_t match = 0;
  double log_chance = -std::numeric_limits<double>::infinity();
};

// For each LED in turn: where all others (tilts and prior too) expect it, how surely, and how many
// of the spots left over would fall at least as near by chance, on this LED or another one without
// a spot.
Weakest WeakestLed(const Scene& scene, const Verdict& verdict, UsePrior use_prior) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  auto linear = Linearise(ProblemOf(scene, verdict.matches), verdict.camera_from_target);
  if (!linear || !FactoriseCholesky(linear->covariance)) return {0, kInfinity};
  // Everything in rows of unit variance, L^-1 times: C^-1 is then a product of columns of L^-1.
  SolveLower(linear->covariance, linear->by_pose);
  SolveLower(linear->covariance, linear->residual);
  LinearisedProblem::RowsCovariance inverse_root;
  InvertLower(linear->covariance, inverse_root);
  Information information;
  PoseError gradient;
  NormalOf(linear->by_pose, linear->residual, information, gradient);
  if (use_prior == UsePrior::kYes) information += scene.prior->information;
  Factor6 factor;
  if (!Factorise(information, 0.0, factor)) return {0, kInfinity};

  const double others = static_cast<double>(verdict.matches.size()) - 1.0;
  const double free_leds = static_cast<double>(scene.rig->leds.size()) - others;
  const double free_spots = static_cast<double>(scene.spots.size()) - others;
  Weakest weakest;
  for (std::size_t i = 0; i < verdict.matches.size(); ++i) {
    const Eigen::Index row = 2 * static_cast<Eigen::Index>(i);
    // The LED's block of C^-1 - C^-1 J (information)^-1 J^T C^-1, and of C^-1 residual.
    Eigen::Matrix2d of_led;
    Eigen::Vector2d pull;
    std::array<PoseError, 2> by_pose;
    for (Eigen::Index p = 0; p < 2; ++p) {
      const auto root = inverse_root.col(row + p);
      pull[p] = root.dot(linear->residual);
      for (int k = 0; k < 6; ++k)
        by_pose[static_cast<std::size_t>(p)][k] = root.dot(linear->by_pose.col(k));
    }
    for (Eigen::Index p = 0; p < 2; ++p) {
      const PoseError explained = SolveWith(factor, by_pose[static_cast<std::size_t>(p)]);
      for (Eigen::Index q = 0; q < 2; ++q) {
        of_led(q, p) = inverse_root.col(row + q).dot(inverse_root.col(row + p)) -
                       by_pose[static_cast<std::size_t>(q)].dot(explained);
      }
    }
    const double distance2 = pull.dot(of_led.inverse() * pull);
    const double log_chance = std::log(free_leds * free_spots) + LogBall(distance2, 2) -
                              0.5 * std::log(of_led.determinant()) - std::log(scene.spot_area_px2);
    if (!(log_chance <= weakest.log_chance)) weakest = {i, log_chance};
  }
  return weakest;
}

bool IsLikelyChance(double log_chance) { return !(log_chance < std::log(kMostChance)); }

// Leaves out LEDs that a false spot may well be, as long as three remain that stand on their own.
void LeaveOutWeak(const Scene& scene, UsePrior use_prior, Decision& decision) {
  while (decision.best.matches.size() > 3) {
    const Weakest weakest = WeakestLed(scene, decision.best, use_prior);
    if (!IsLikelyChance(weakest.log_chance)) return;
    Candidate fewer;
    fewer.matches = decision.best.matches;
    fewer.matches.erase(weakest.match);
    fewer.fit.camera_from_target = decision.best.camera_from_target;
    const std::optional<Verdict> verdict = Judge(scene, fewer, use_prior);
    if (!verdict || IsLikelyChance(verdict->log_chance)) {
      decision.outcome = Outcome::kAmbiguous;
      return;
    }
    decision.best = *verdict;
  }
}

}  // namespace

Decision Decide(const Scene& scene, const Candidates& candidates, UsePrior use_prior) {
  const std::size_t fewest_leds = scene.ups_are_sharp ? 2 : 3;
  Decision decision;
  double second_chi2 = std::numeric_limits<double>::infinity();
  for (const Candidate& candidate : candidates) {
    const bool fewer_leds = decision.outcome != Outcome::kNone &&
                            candidate.matches.size() < decision.best.matches.size();
    if (fewer_leds) break;  // candidates come with the most LEDs first
    if (candidate.matches.size() < fewest_leds) break;
    const std::optional<Verdict> verdict = Judge(scene, candidate, use_prior);
    if (!verdict) continue;
    if (decision.outcome == Outcome::kNone || verdict->chi2 < decision.best.chi2) {
      if (decision.outcome != Outcome::kNone) second_chi2 = decision.best.chi2;
      decision.best = *verdict;
      decision.outcome = Outcome::kClear;
    } else {
      second_chi2 = std::min(second_chi2, verdict->chi2);
    }
  }
  if (decision.outcome == Outcome::kNone) return decision;
  const double least_gap = scene.options.ambiguous_chi2_per_dof * std::max(1, decision.best.dof);
  const bool rivalled = second_chi2 - decision.best.chi2 < least_gap;
  if (rivalled || IsLikelyChance(decision.best.log_chance)) {
    decision.outcome = Outcome::kAmbiguous;
    return decision;
  }
  LeaveOutWeak(scene, use_prior, decision);
  return decision;
}

}  // namespace tbm::assign
