#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "pose/solve/integrity.h"
#include "pose/solve/normal_equations.h"
#include "pose/solve/tails.h"
#include "pose/solve/whitened.h"

namespace tbm {
namespace {

// One explanation of the readings: where the target is if it is right.
struct Hypothesis {
  Rigid3 camera_from_target;
  PoseCovariance covariance = PoseCovariance::Zero();
  bool plausible = true;
};
using Hypotheses = FixedVector<Hypothesis, kMaxLeds + 2>;

bool WithinLimits(const PoseCovariance& covariance, const IntegrityOptions& options) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> turn;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> shift;
  turn.computeDirect(covariance.topLeftCorner<3, 3>(), Eigen::EigenvaluesOnly);
  shift.computeDirect(covariance.bottomRightCorner<3, 3>(), Eigen::EigenvaluesOnly);
  return std::sqrt(turn.eigenvalues()[2]) <= options.max_sigma_rotation_rad &&
         std::sqrt(shift.eigenvalues()[2]) <= options.max_sigma_translation_m;
}

bool Plausible(double chi2, int dof, const IntegrityOptions& options) {
  return dof <= 0 || ChiSquaredTail(chi2, dof) >= options.implausible_risk;
}

// From the readings alone. Empty when they leave a direction unlimited.
std::optional<Hypothesis> ByReadings(const SubsetNormal& normal,
                                     const Rigid3& linearised_at,
                                     const IntegrityOptions& options) {
  const auto solution = Solve(normal);
  if (!solution || !WithinLimits(solution->covariance, options)) return std::nullopt;
  return Hypothesis{Moved(linearised_at, solution->e),
                    solution->covariance,
                    Plausible(solution->chi2, normal.rows - 6, options)};
}

// With the prior, at which `normal` is linearised. Readings and prior share the calibration's
// errors: weighted by one half each, the sigma is not too small however the two are correlated
// (covariance intersection). Their disagreement counts in full.
std::optional<Hypothesis> ByPrior(const SubsetNormal& normal,
                                  const PosePriorInfo& prior,
                                  const PoseCovariance& prior_information,
                                  const IntegrityOptions& options) {
  SubsetNormal both = normal;
  both.information += prior_information;
  const auto solution = Solve(both);
  if (!solution) return std::nullopt;
  return Hypothesis{Moved(prior.camera_from_target, solution->e),
                    2.0 * solution->covariance,
                    Plausible(solution->chi2, normal.rows, options)};
}

// Makes the explanations of one problem.
class Explanations {
 public:
  Explanations(const PoseProblem& problem,
               const Rigid3& published,
               const std::optional<PosePriorInfo>& prior,
               const IntegrityOptions& options)
      : published_(published), prior_(prior), options_(options) {
    at_published_ = WhitenedProblem::From(problem, published);
    if (!prior) return;
    Factor6 factor;
    if (!Factorise(prior->covariance, 0.0, factor)) return;
    prior_information_ = InverseOf(factor);
    at_prior_ = WhitenedProblem::From(problem, prior->camera_from_target);
  }

  // Rows `omitted` are wrong. Empty when then nothing limits the pose.
  std::optional<Hypothesis> Without(int omitted) const {
    if (!at_published_) return std::nullopt;
    const SubsetNormal normal = at_published_->Without(omitted);
    auto alone = ByReadings(normal, published_, options_);
    // Readings that check each other need no prior, which may itself come from a wrong reading.
    if ((alone && normal.rows > 6) || !at_prior_) return alone;
    const auto limited =
        ByPrior(at_prior_->Without(omitted), *prior_, prior_information_, options_);
    if (!alone || !limited) return limited ? limited : alone;
    // By geometry, not by what was read: choosing the nicer answer would cost risk. Turns decide
    // how far off a point at some distance is.
    const bool tighter = limited->covariance.topLeftCorner<3, 3>().trace() <
                         alone->covariance.topLeftCorner<3, 3>().trace();
    return tighter ? limited : alone;
  }

 private:
  Rigid3 published_;
  std::optional<PosePriorInfo> prior_;
  IntegrityOptions options_;
  PoseCovariance prior_information_ = PoseCovariance::Zero();
  std::optional<WhitenedProblem> at_published_;
  std::optional<WhitenedProblem> at_prior_;
};

// All explanations with at most one wrong reading that the residuals allow. False when one of them
// leaves the pose unlimited.
bool FindPlausible(const PoseProblem& problem,
                   const Rigid3& published,
                   const std::optional<PosePriorInfo>& prior,
                   const IntegrityOptions& options,
                   Hypotheses& plausible) {
  const Explanations explanations(problem, published, prior, options);
  const auto add = [&](int omitted) {
    const auto hypothesis = explanations.Without(omitted);
    if (hypothesis && hypothesis->plausible) plausible.push_back(*hypothesis);
    return hypothesis.has_value();
  };
  if (!add(kNothingOmitted)) return false;
  const bool has_tilts = problem.target_tilt && problem.camera_tilt;
  const int pairs_of_rows = static_cast<int>(problem.leds.size()) + (has_tilts ? 1 : 0);
  for (int i = 0; i < pairs_of_rows; ++i) {
    if (!add(2 * i)) return false;
  }
  return !plausible.empty();
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
    const Rigid3& pose = hypothesis.camera_from_target;
    const double separation_m = (pose * point.p_point_in_target - p_published).norm();
    const double radius_m =
        ErrorRadius(PointCovariance(pose, point, hypothesis.covariance), noise_risk);
    bound_m = std::max(bound_m, separation_m + radius_m);
  }
  return bound_m;
}

}  // namespace

PointResults CheckPoints(const PoseProblem& problem,
                         const CheckedPose& checked,
                         const std::optional<PosePriorInfo>& prior,
                         const IntegrityOptions& options) {
  const Rigid3& published = checked.pose.camera_from_target;
  Hypotheses hypotheses;
  const bool is_limited = FindPlausible(problem, published, prior, options, hypotheses);
  PointResults results;
  for (const NamedPoint& point : problem.rig->points) {
    PointResult result;
    result.p_in_camera = published * point.p_point_in_target;
    result.sigma_m = std::sqrt(PointCovariance(published, point, checked.pose.covariance).trace());
    if (is_limited) result.bound_m = Bound(point, published, hypotheses, options);
    results.push_back(result);
  }
  return results;
}

}  // namespace tbm
