#include "pose/solve/integrity.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>

#include "pose/solve/solve_pose.h"
#include "pose/solve/start_pose.h"
#include "pose/solve/tails.h"
#include "pose/solve/whitened.h"

namespace tbm {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr std::size_t kMaxExclusions = kMaxLeds + 1;

bool HasTilts(const PoseProblem& problem) { return problem.target_tilt && problem.camera_tilt; }

PoseResult SolveWhatIsThere(const PoseProblem& problem,
                            const std::optional<Rigid3>& start,
                            const SolveOptions& options) {
  return HasTilts(problem) ? SolveFused(problem, start, options)
                           : SolveVision(problem, start, options);
}

// Failures that say the readings are too few or too badly placed, which no wrong reading causes.
bool TooLittle(PoseFailure failure) {
  return failure == PoseFailure::kTooFewLeds || failure == PoseFailure::kNotObservable ||
         failure == PoseFailure::kAmbiguous;
}

bool PassesGate(const PoseEstimate& pose, const IntegrityOptions& options) {
  return pose.dof == 0 || ChiSquaredTail(pose.chi2, pose.dof) >= options.gate_false_alarm;
}

// One reading that may be wrong: the LED at `led` in the problem's order, or the tilts.
struct Reading {
  static constexpr int kTilts = -1;
  int led = kTilts;

  bool is_tilts() const { return led == kTilts; }
  int first_row(const PoseProblem& problem) const {
    return 2 * (is_tilts() ? static_cast<int>(problem.leds.size()) : led);
  }
};

FixedVector<Reading, kMaxExclusions> ReadingsOf(const PoseProblem& problem) {
  FixedVector<Reading, kMaxExclusions> readings;
  for (std::size_t i = 0; i < problem.leds.size(); ++i) readings.push_back({static_cast<int>(i)});
  if (HasTilts(problem)) readings.push_back({Reading::kTilts});
  return readings;
}

PoseProblem Without(const PoseProblem& problem, const Reading& reading) {
  PoseProblem rest = problem;
  if (reading.is_tilts()) {
    rest.target_tilt.reset();
    rest.camera_tilt.reset();
  } else {
    rest.leds.erase(static_cast<std::size_t>(reading.led));
  }
  return rest;
}

struct Exclusion {
  Reading reading;
  PoseResult pose = Failure{PoseFailure::kNotConverged};
  // Of what is left. 0 where too little is left to be solved: such an exclusion can never be
  // denied.
  double chi2 = kNever;
  int dof = 0;
  bool twofold = false;  // a second pose, far from the first, fits about as well
};
using Exclusions = FixedVector<Exclusion, kMaxExclusions>;

// Where a search may begin: six by pairs, and the caller's.
using Starts = FixedVector<Rigid3, 9>;

// Three LEDs and tilts can have a mirror image, turned about the vertical, that fits as well. The
// two roots of each pair of LEDs lead to all there is.
void AddPairStarts(const PoseProblem& rest, Starts& starts) {
  if (rest.leds.size() != 3 || !HasTilts(rest)) return;
  for (std::size_t left_out = 0; left_out < 3; ++left_out) {
    PoseProblem pair = rest;
    pair.leds.erase(left_out);
    const auto roots = StartPose(pair);
    if (!roots) continue;
    for (const Rigid3& root : roots->camera_from_target) starts.push_back(root);
  }
}

bool FarApart(const Rigid3& a, const Rigid3& b) {
  constexpr double kOtherMinimumRad = 0.05;
  return ErrorBetween(a, b).head<3>().norm() > kOtherMinimumRad;
}

// What one wrong reading has bent may lead from one start into a false minimum: the best of all
// counts.
void SolveFromAll(const PoseProblem& rest,
                  const Starts& starts,
                  const IntegrityOptions& options,
                  const SolveOptions& solve_options,
                  Exclusion& exclusion) {
  exclusion.pose = SolveWhatIsThere(rest, std::nullopt, solve_options);
  double rival_chi2 = kNever;
  for (const Rigid3& start : starts) {
    PoseResult other = SolveWhatIsThere(rest, start, solve_options);
    if (!other) continue;
    if (!exclusion.pose || other->chi2 < exclusion.pose->chi2) std::swap(other, exclusion.pose);
    if (other && FarApart(other->camera_from_target, exclusion.pose->camera_from_target)) {
      rival_chi2 = std::min(rival_chi2, other->chi2);
    }
  }
  exclusion.twofold = exclusion.pose && rival_chi2 < exclusion.pose->chi2 + options.isolation_chi2;
}

Exclusion Exclude(const PoseProblem& problem,
                  const Reading& reading,
                  const Starts& given,
                  const std::optional<PosePriorInfo>& prior,
                  const IntegrityOptions& options,
                  const SolveOptions& solve_options) {
  Exclusion exclusion;
  exclusion.reading = reading;
  const PoseProblem rest = Without(problem, reading);
  if (prior) exclusion.pose = SolveWhatIsThere(rest, prior->camera_from_target, solve_options);
  if (!exclusion.pose || !PassesGate(*exclusion.pose, options)) {
    Starts starts = given;
    if (prior) starts.push_back(prior->camera_from_target);
    AddPairStarts(rest, starts);
    SolveFromAll(rest, starts, options, solve_options, exclusion);
  }
  if (exclusion.pose) {
    exclusion.chi2 = exclusion.pose->chi2;
    exclusion.dof = exclusion.pose->dof;
  } else if (TooLittle(exclusion.pose.error())) {
    exclusion.chi2 = 0.0;
  }
  return exclusion;
}

// The same scores with the prior as six more rows, linearised at the prior: every exclusion can be
// judged then, also one that leaves less than a pose.
void ScoreByPrior(const PoseProblem& problem, const PosePriorInfo& prior, Exclusions& exclusions) {
  const auto whitened = WhitenedProblem::From(problem, prior.camera_from_target);
  const Eigen::LLT<PoseCovariance> root(prior.covariance);
  if (!whitened || root.info() != Eigen::Success) return;
  const PoseCovariance prior_information = root.solve(PoseCovariance::Identity());
  for (Exclusion& exclusion : exclusions) {
    SubsetNormal normal = whitened->Without(exclusion.reading.first_row(problem));
    normal.information += prior_information;
    const auto solution = Solve(normal);
    exclusion.chi2 = solution ? solution->chi2 : 0.0;
    exclusion.dof = normal.rows;
    exclusion.twofold = false;
  }
}

enum class Verdict { kFound, kNoneMends, kMoreThanOneMends };

// Puts the winner first.
Verdict Judge(Exclusions& exclusions, const IntegrityOptions& options) {
  std::sort(exclusions.begin(), exclusions.end(), [](const Exclusion& a, const Exclusion& b) {
    return a.chi2 < b.chi2;
  });
  if (exclusions.empty()) return Verdict::kNoneMends;
  const Exclusion& best = exclusions[0];
  const bool mends = best.dof == 0
                         ? best.chi2 < kNever
                         : ChiSquaredTail(best.chi2, best.dof) >= options.gate_false_alarm;
  if (!mends) return Verdict::kNoneMends;
  const double next_chi2 = exclusions.size() > 1 ? exclusions[1].chi2 : kNever;
  if (best.twofold || next_chi2 < best.chi2 + options.isolation_chi2)
    return Verdict::kMoreThanOneMends;
  return Verdict::kFound;
}

void SetStatus(const PoseProblem& problem, const IntegrityOptions& options, CheckedPose& checked) {
  const auto used = problem.leds.size() - (checked.excluded_led ? 1u : 0u);
  checked.reason = PoseReason::kNone;
  if (checked.excluded_led) {
    checked.reason = PoseReason::kLedExcluded;
  } else if (HasTilts(problem) && !checked.tilts_used) {
    checked.reason = PoseReason::kTiltDisagrees;
  } else if (used == 2) {
    checked.reason = PoseReason::kTwoLeds;
  } else if (used < problem.rig->leds.size()) {
    checked.reason = PoseReason::kFewLeds;
  } else if (options.expect_tilts && !checked.tilts_used) {
    checked.reason = PoseReason::kTiltMissing;
  }
  checked.status = checked.reason == PoseReason::kNone ? PoseStatus::kOk : PoseStatus::kDegraded;
}

CheckedPose Accept(const PoseProblem& problem,
                   const PoseEstimate& pose,
                   const std::optional<Reading>& excluded,
                   const IntegrityOptions& options) {
  CheckedPose checked;
  checked.pose = pose;
  for (std::size_t i = 0; i < problem.leds.size(); ++i) {
    const int led_index = problem.leds[i].led_index;
    if (excluded && excluded->led == static_cast<int>(i)) {
      checked.excluded_led = led_index;
    } else {
      checked.leds_used |= std::uint32_t{1} << led_index;
    }
  }
  checked.tilts_used = HasTilts(problem) && !(excluded && excluded->is_tilts());
  SetStatus(problem, options, checked);
  return checked;
}

// More than one exclusion mends a problem that fails the gate by little: noise out of the ordinary,
// a small fault. The best of them goes out, marked, since the bound covers them all; where each
// fits by lack of redundancy, nothing is left out.
Result<CheckedPose, PoseReason> InDoubt(const PoseProblem& problem,
                                        const PoseResult& whole,
                                        const Exclusion& best,
                                        const IntegrityOptions& options) {
  if (!whole || ChiSquaredTail(whole->chi2, whole->dof) < options.doubt_limit) {
    return Failure{PoseReason::kAmbiguous};
  }
  std::optional<CheckedPose> checked;
  const bool same_minimum = best.pose && !best.twofold &&
                            !FarApart(best.pose->camera_from_target, whole->camera_from_target);
  if (same_minimum && best.pose->dof > 0) {
    checked = Accept(problem, *best.pose, best.reading, options);
  } else if (problem.leds.size() < problem.rig->leds.size()) {
    checked = Accept(problem, *whole, std::nullopt, options);
  }
  if (!checked) return Failure{PoseReason::kAmbiguous};
  checked->doubtful = true;
  return *checked;
}

Result<CheckedPose, PoseReason> LeaveOneOut(const PoseProblem& problem,
                                            const PoseResult& whole,
                                            const Starts& starts,
                                            const std::optional<PosePriorInfo>& prior,
                                            const IntegrityOptions& options,
                                            const SolveOptions& solve_options) {
  Exclusions exclusions;
  for (const Reading& reading : ReadingsOf(problem)) {
    exclusions.push_back(Exclude(problem, reading, starts, prior, options, solve_options));
  }
  Verdict verdict = Judge(exclusions, options);
  if (verdict == Verdict::kMoreThanOneMends && prior) {
    ScoreByPrior(problem, *prior, exclusions);
    verdict = Judge(exclusions, options);
    // Few readings have more than one solution; the one that was judged is the one at the prior.
    exclusions[0].pose = SolveWhatIsThere(
        Without(problem, exclusions[0].reading), prior->camera_from_target, solve_options);
  }
  if (verdict == Verdict::kNoneMends) return Failure{PoseReason::kInconsistent};
  if (verdict == Verdict::kMoreThanOneMends) {
    return InDoubt(problem, whole, exclusions[0], options);
  }
  const Exclusion& found = exclusions[0];
  if (!found.pose) return Failure{ReasonOf(found.pose.error())};
  return Accept(problem, *found.pose, found.reading, options);
}

}  // namespace

Result<CheckedPose, PoseReason> CheckPose(const PoseProblem& problem,
                                          const std::optional<Rigid3>& start,
                                          const std::optional<PosePriorInfo>& prior,
                                          const IntegrityOptions& options,
                                          const SolveOptions& solve_options) {
  PoseResult whole = SolveWhatIsThere(problem, start, solve_options);
  if (!whole && !start && prior && whole.error() == PoseFailure::kAmbiguous) {
    whole = SolveWhatIsThere(problem, prior->camera_from_target, solve_options);
  }
  if (whole && PassesGate(*whole, options)) {
    return Accept(problem, *whole, std::nullopt, options);
  }
  // One wrong reading can also keep the whole from converging.
  if (!whole && TooLittle(whole.error())) return Failure{ReasonOf(whole.error())};
  Starts starts;
  if (start) starts.push_back(*start);
  if (whole) starts.push_back(whole->camera_from_target);
  return LeaveOneOut(problem, whole, starts, prior, options, solve_options);
}

}  // namespace tbm
