#include "pose/centres/assign_judge.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/LU>

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
        best = std::max(best, std::abs(rows.determinant()));
        continue;
      }
      for (int k = j + 1; k < leds; ++k) {
        rows.bottomRows<2>() = linear.by_pose.middleRows<2>(2 * k);
        best = std::max(best, std::abs(rows.determinant()));
      }
    }
  }
  return std::log(best);
}

template <class Factor>
double LogDeterminant(const Factor& llt) {
  return 2.0 * llt.matrixLLT().diagonal().array().log().sum();
}

struct Solved {
  Information without_leds = Information::Zero();  // prior and tilts alone
  Information information = Information::Zero();
  double log_det_covariance = 0.0;  // of all rows
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
  const Eigen::LLT<Information> all(solved.information);
  if (use_prior == UsePrior::kYes) {
    const Eigen::LLT<Information> before(solved.without_leds);
    const double log_spread = 0.5 * (solved.log_det_covariance - solved.log_det_tilts +
                                     LogDeterminant(all) - LogDeterminant(before));
    return log_ways + LogBall(verdict.chi2, 2 * leds) + log_spread - leds * log_area;
  }
  const int basis_leds = linear.tilt_rows > 0 ? 2 : 3;
  const double log_roots = std::log(linear.tilt_rows > 0 ? 2.0 : 4.0);
  if (leds <= basis_leds) return log_roots + log_ways;
  const double log_spread =
      0.5 * (solved.log_det_covariance + LogDeterminant(all)) - LogBestBasis(linear, leds);
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
  const auto linear = Linearise(problem, candidate.fit.camera_from_target);
  if (!linear) return std::nullopt;
  const Eigen::LLT<LinearisedProblem::RowsCovariance> noise(linear->covariance);
  if (noise.info() != Eigen::Success) return std::nullopt;
  const LinearisedProblem::Rows residual = noise.matrixL().solve(linear->residual);
  const LinearisedProblem::RowsByPose by_pose = noise.matrixL().solve(linear->by_pose);

  Solved solved;
  PoseError gradient = by_pose.transpose() * residual;
  double chi2 = residual.squaredNorm();
  if (use_prior == UsePrior::kYes) {
    const PoseError error =
        ErrorBetween(candidate.fit.camera_from_target, scene.prior->camera_from_target);
    solved.without_leds = scene.prior->information;
    gradient += scene.prior->information * error;
    chi2 += error.dot(scene.prior->information * error);
  }
  solved.information = solved.without_leds + by_pose.transpose() * by_pose;
  if (linear->tilt_rows > 0) {
    const Eigen::Matrix<double, 2, 6> tilt_rows = linear->by_pose.bottomRows<2>();
    const Eigen::Matrix2d tilt_covariance = linear->covariance.bottomRightCorner<2, 2>();
    solved.without_leds += tilt_rows.transpose() * tilt_covariance.inverse() * tilt_rows;
    solved.log_det_tilts = std::log(tilt_covariance.determinant());
  }
  solved.log_det_covariance = LogDeterminant(noise);
  const PoseError move = solved.information.ldlt().solve(gradient);
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
  const auto linear = Linearise(ProblemOf(scene, verdict.matches), verdict.camera_from_target);
  if (!linear) return {0, std::numeric_limits<double>::infinity()};
  const Eigen::LLT<LinearisedProblem::RowsCovariance> noise(linear->covariance);
  const LinearisedProblem::RowsByPose weighted_by_pose = noise.solve(linear->by_pose);
  const LinearisedProblem::Rows weighted_residual = noise.solve(linear->residual);
  Information information = linear->by_pose.transpose() * weighted_by_pose;
  if (use_prior == UsePrior::kYes) information += scene.prior->information;
  const Eigen::Index rows = linear->residual.size();
  LinearisedProblem::RowsCovariance weight =
      noise.solve(LinearisedProblem::RowsCovariance::Identity(rows, rows));
  weight -= weighted_by_pose * information.ldlt().solve(weighted_by_pose.transpose());

  const double others = static_cast<double>(verdict.matches.size()) - 1.0;
  const double free_leds = static_cast<double>(scene.rig->leds.size()) - others;
  const double free_spots = static_cast<double>(scene.spots.size()) - others;
  Weakest weakest;
  for (std::size_t i = 0; i < verdict.matches.size(); ++i) {
    const Eigen::Index row = 2 * static_cast<Eigen::Index>(i);
    const Eigen::Matrix2d of_led = weight.block<2, 2>(row, row);
    const Eigen::Vector2d pull = weighted_residual.segment<2>(row);
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
