#include "pose/solve/integrity.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "pose/solve/solve_pose.h"
#include "pose/solve/tails.h"
#include "pose/solve/whitened.h"

namespace tbm {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr std::size_t kMaxExclusions = kMaxLeds + 1;

PoseReason ReasonOf(PoseFailure failure) {
  switch (failure) {
    case PoseFailure::kTooFewLeds:
      return PoseReason::kTooFewLeds;
    case PoseFailure::kNotObservable:
      return PoseReason::kNotObservable;
    case PoseFailure::kBehindCamera:
      return PoseReason::kBehindCamera;
    case PoseFailure::kNotConverged:
      return PoseReason::kNotConverged;
    case PoseFailure::kAmbiguous:
      return PoseReason::kAmbiguous;
  }
  TBM_CHECK(false);
  return PoseReason::kNone;
}

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

// A problem that one wrong reading has bent may lead from one start into a false minimum: the best
// of all starts counts.
PoseResult BestOfStarts(const PoseProblem& problem,
                        const FixedVector<Rigid3, 3>& starts,
                        const SolveOptions& options) {
  PoseResult best = SolveWhatIsThere(problem, std::nullopt, options);
  for (const Rigid3& start : starts) {
    const PoseResult other = SolveWhatIsThere(problem, start, options);
    if (other && (!best || other->chi2 < best->chi2)) best = other;
  }
  return best;
}

struct Exclusion {
  Reading reading;
  PoseResult pose = Failure{PoseFailure::kNotConverged};
  // Of what is left. 0 where too little is left to be solved: such an exclusion can never be
  // denied.
  double chi2 = kNever;
  int dof = 0;
};
using Exclusions = FixedVector<Exclusion, kMaxExclusions>;

Exclusion Exclude(const PoseProblem& problem,
                  const Reading& reading,
                  const FixedVector<Rigid3, 3>& starts,
                  const SolveOptions& options) {
  Exclusion exclusion;
  exclusion.reading = reading;
  exclusion.pose = BestOfStarts(Without(problem, reading), starts, options);
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
  if (next_chi2 < best.chi2 + options.isolation_chi2) return Verdict::kMoreThanOneMends;
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

Result<CheckedPose, PoseReason> LeaveOneOut(const PoseProblem& problem,
                                            const FixedVector<Rigid3, 3>& starts,
                                            const std::optional<PosePriorInfo>& prior,
                                            const IntegrityOptions& options,
                                            const SolveOptions& solve_options) {
  Exclusions exclusions;
  for (const Reading& reading : ReadingsOf(problem)) {
    exclusions.push_back(Exclude(problem, reading, starts, solve_options));
  }
  Verdict verdict = Judge(exclusions, options);
  if (verdict == Verdict::kMoreThanOneMends && prior) {
    ScoreByPrior(problem, *prior, exclusions);
    verdict = Judge(exclusions, options);
  }
  if (verdict == Verdict::kNoneMends) return Failure{PoseReason::kInconsistent};
  if (verdict == Verdict::kMoreThanOneMends) return Failure{PoseReason::kAmbiguous};
  const Exclusion& found = exclusions[0];
  if (!found.pose) return Failure{ReasonOf(found.pose.error())};
  return Accept(problem, *found.pose, found.reading, options);
}

// One explanation of the readings, seen from the published pose.
struct Hypothesis {
  PoseError e = PoseError::Zero();  // to its own solution
  PoseCovariance covariance = PoseCovariance::Zero();
};
using Hypotheses = FixedVector<Hypothesis, kMaxExclusions + 1>;

bool WithinLimits(const PoseCovariance& covariance, const IntegrityOptions& options) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> turn;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> shift;
  turn.computeDirect(covariance.topLeftCorner<3, 3>(), Eigen::EigenvaluesOnly);
  shift.computeDirect(covariance.bottomRightCorner<3, 3>(), Eigen::EigenvaluesOnly);
  return std::sqrt(turn.eigenvalues()[2]) <= options.max_sigma_rotation_rad &&
         std::sqrt(shift.eigenvalues()[2]) <= options.max_sigma_translation_m;
}

// Subset and prior weighted by one half each: never too optimistic, however the two are correlated
// (they share the calibration's errors). Covariance intersection.
std::optional<Hypothesis> WithPrior(const SubsetNormal& normal,
                                    const Rigid3& published,
                                    const PosePriorInfo& prior) {
  const Eigen::LLT<PoseCovariance> root(prior.covariance);
  if (root.info() != Eigen::Success) return std::nullopt;
  const PoseCovariance prior_information = root.solve(PoseCovariance::Identity());
  const PoseError to_prior = ErrorBetween(published, prior.camera_from_target);
  SubsetNormal both = normal;
  both.information = 0.5 * (normal.information + prior_information);
  both.gradient = 0.5 * (normal.gradient + prior_information * to_prior);
  const auto solution = Solve(both);
  if (!solution) return std::nullopt;
  return Hypothesis{solution->e, solution->covariance};
}

// All explanations with at most one wrong reading that the residuals allow. Empty when one of them
// leaves the pose unlimited.
std::optional<Hypotheses> PlausibleHypotheses(const PoseProblem& problem,
                                              const Rigid3& published,
                                              const std::optional<PosePriorInfo>& prior,
                                              const IntegrityOptions& options) {
  const auto whitened = WhitenedProblem::From(problem, published);
  if (!whitened) return std::nullopt;
  Hypotheses hypotheses;
  const auto add = [&](int omitted) {
    const SubsetNormal normal = whitened->Without(omitted);
    const auto solution = Solve(normal);
    if (solution && WithinLimits(solution->covariance, options)) {
      const int dof = normal.rows - 6;
      const bool plausible =
          dof <= 0 || ChiSquaredTail(solution->chi2, dof) >= options.implausible_risk;
      if (plausible) hypotheses.push_back({solution->e, solution->covariance});
      return true;
    }
    if (!prior) return false;
    const auto limited = WithPrior(normal, published, *prior);
    if (limited) hypotheses.push_back(*limited);
    return limited.has_value();
  };
  if (!add(kNothingOmitted)) return std::nullopt;
  for (const Reading& reading : ReadingsOf(problem)) {
    if (!add(reading.first_row(problem))) return std::nullopt;
  }
  return hypotheses;
}

Eigen::Matrix3d PointCovariance(const Rigid3& pose,
                                const NamedPoint& point,
                                const PoseCovariance& covariance) {
  const Eigen::Matrix<double, 3, 6> by_error = PointByError(pose, point.p_point_in_target);
  Eigen::Matrix3d of_point = by_error * covariance * by_error.transpose();
  of_point.diagonal().array() += point.sigma_m * point.sigma_m;
  return of_point;
}

double Bound(const NamedPoint& point,
             const Rigid3& published,
             const Hypotheses& hypotheses,
             const IntegrityOptions& options) {
  const Eigen::Vector3d p_published = published * point.p_point_in_target;
  const double noise_risk = options.bound_risk - options.implausible_risk;
  double bound_m = 0.0;
  for (const Hypothesis& hypothesis : hypotheses) {
    const Rigid3 pose = Moved(published, hypothesis.e);
    const double separation_m = (pose * point.p_point_in_target - p_published).norm();
    const double radius_m =
        ErrorRadius(PointCovariance(pose, point, hypothesis.covariance), noise_risk);
    bound_m = std::max(bound_m, separation_m + radius_m);
  }
  return bound_m;
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
  FixedVector<Rigid3, 3> starts;
  if (start) starts.push_back(*start);
  if (whole) starts.push_back(whole->camera_from_target);
  if (prior) starts.push_back(prior->camera_from_target);
  return LeaveOneOut(problem, starts, prior, options, solve_options);
}

PointResults CheckPoints(const PoseProblem& problem,
                         const CheckedPose& checked,
                         const std::optional<PosePriorInfo>& prior,
                         const IntegrityOptions& options) {
  const Rigid3& published = checked.pose.camera_from_target;
  const auto hypotheses = PlausibleHypotheses(problem, published, prior, options);
  PointResults results;
  for (const NamedPoint& point : problem.rig->points) {
    PointResult result;
    result.p_in_camera = published * point.p_point_in_target;
    result.sigma_m = std::sqrt(PointCovariance(published, point, checked.pose.covariance).trace());
    if (hypotheses) result.bound_m = Bound(point, published, *hypotheses, options);
    results.push_back(result);
  }
  return results;
}

}  // namespace tbm
