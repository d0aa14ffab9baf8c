#include "pose/solve/solve_pose.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pose/solve/normal_equations.h"
#include "pose/solve/observable.h"
#include "pose/solve/start_pose.h"
#include "pose/solve/vision_start.h"

namespace tbm {
namespace {

using Step = Eigen::Matrix<double, 6, 1>;

// Converged when the step is this part of a sigma, squared. Gauss-Newton's error after such a step
// is its square, far below the digits that matter even in exact problems.
constexpr double kSmallStepSquared = 1e-6;
// A pose that moved further than this [rad, or part of the distance] since it was weighed changes
// its weights by as much: weigh again, kMaxWeighings times in all so that the costs stay
// comparable.
constexpr double kStaleMove = 2e-3;
constexpr int kMaxWeighings = 4;
constexpr double kFirstDamping = 1e-4;
constexpr double kMostDamping = 1e8;

// Levenberg-Marquardt over six unknowns. Everything it needs lies inside the object.
class Refinement {
 public:
  Refinement(const PoseProblem& problem, const TiltConstraint* tilts, const SolveOptions& options)
      : problem_(problem), tilts_(tilts), options_(options) {}

  PoseResult Run(const Rigid3& start) {
    pose_ = start;
    if (!LinearisePose(problem_, tilts_, pose_, *linear_)) {
      return Failure{PoseFailure::kBehindCamera};
    }
    WeighHere();
    while (iterations_ < options_.max_iterations) {
      ++iterations_;
      const bool is_regular = Factorise(normal_.information, 0.0, factor_);
      if (is_regular && damping_ == 0.0) {
        const Step step = SolveWith(factor_, normal_.gradient);
        const double decrement = step.dot(normal_.gradient);
        if (decrement < kSmallStepSquared) return Finish(step, decrement);
        if (TryStep(step)) continue;
      }
      if (!DampedStep(is_regular)) return Unsettled(is_regular);
    }
    return Unsettled(Factorise(normal_.information, 0.0, factor_));
  }

 private:
  void WeighHere() {
    Weigh(problem_, *linear_, weights_);
    ++weighings_;
    moved_ = 0.0;
    FormNormal(*linear_, weights_, normal_);
  }

  // Goes there when the cost falls.
  bool TryStep(const Step& step) {
    const Rigid3 next = Moved(pose_, step);
    if (!LinearisePose(problem_, tilts_, next, *next_linear_)) return false;
    FormNormal(*next_linear_, weights_, next_normal_);
    if (!(next_normal_.cost < normal_.cost)) return false;
    moved_ += step.head<3>().norm() + step.tail<3>().norm() / std::abs(next.translation.z());
    pose_ = next;
    std::swap(linear_, next_linear_);
    if (moved_ > kStaleMove && weighings_ < kMaxWeighings) {
      WeighHere();
    } else {
      std::swap(normal_, next_normal_);
    }
    return true;
  }

  // Raises the damping until a step lowers the cost. False when none does.
  bool DampedStep(bool is_regular) {
    damping_ = std::max(damping_, kFirstDamping);
    for (; damping_ < kMostDamping; damping_ *= 8.0) {
      Factor6 damped;
      if (!Factorise(normal_.information, damping_, damped)) continue;
      const Step step = SolveWith(damped, normal_.gradient);
      if (!is_regular && step.dot(normal_.gradient) < kSmallStepSquared) return false;
      if (!TryStep(step)) continue;
      damping_ = damping_ > kFirstDamping ? damping_ / 8.0 : 0.0;
      return true;
    }
    return false;
  }

  PoseResult Unsettled(bool is_regular) const {
    const bool is_weak = !is_regular || !IsObservable(InverseOf(factor_), options_);
    return Failure{is_weak ? PoseFailure::kNotObservable : PoseFailure::kNotConverged};
  }

  PoseResult Finish(const Step& step, double decrement) {
    PoseEstimate estimate;
    estimate.covariance = InverseOf(factor_);
    if (!IsObservable(estimate.covariance, options_)) return Failure{PoseFailure::kNotObservable};
    estimate.camera_from_target = Moved(pose_, step);
    if (tilts_ != nullptr && !IsUpright(estimate.camera_from_target)) {
      return Failure{PoseFailure::kNotConverged};
    }
    // The last step is so small that its linear prediction is exact.
    estimate.chi2 = std::max(0.0, normal_.cost - decrement);
    estimate.dof = 2 * linear_->count + (tilts_ != nullptr ? 2 : 0) - 6;
    double sum_px2 = 0.0;
    for (int i = 0; i < linear_->count; ++i) {
      const LedRows& led = linear_->leds[static_cast<std::size_t>(i)];
      sum_px2 += (led.residual_px - led.by_pose * step).squaredNorm();
    }
    estimate.rms_px = std::sqrt(sum_px2 / (2.0 * linear_->count));
    estimate.iterations = iterations_;
    return estimate;
  }

  // The tangent residuals of the tilts vanish upside down too.
  bool IsUpright(const Rigid3& pose) const {
    return tilts_->up_in_camera.dot(pose.rotation * tilts_->up_in_target) > 0.0;
  }

  const PoseProblem& problem_;
  const TiltConstraint* tilts_;
  const SolveOptions& options_;
  Rigid3 pose_;
  LinearPose linear_store_[2];
  LinearPose* linear_ = &linear_store_[0];
  LinearPose* next_linear_ = &linear_store_[1];
  Weights weights_;
  NormalEquations normal_;
  NormalEquations next_normal_;
  Factor6 factor_;
  double damping_ = 0.0;
  double moved_ = 0.0;
  int weighings_ = 0;
  int iterations_ = 0;
};

void CheckIsOurs(const PoseProblem& problem) {
  TBM_CHECK(problem.rig != nullptr);
  const int leds = static_cast<int>(problem.rig->leds.size());
  for (const LedObservation& led : problem.leds) {
    TBM_CHECK(led.led_index >= 0 && led.led_index < leds);
  }
}

PoseResult Refine(const PoseProblem& problem,
                  const TiltConstraint* tilts,
                  const Rigid3& start,
                  const SolveOptions& options) {
  return Refinement(problem, tilts, options).Run(start);
}

// Few LEDs leave two roots. Near the singular geometries (both LEDs on one plumb line or at camera
// height, and the surface between: y1 |h|^2 = dv (p . h)) they merge, and the sigma predicted at
// either one no longer says how far noise carries it: with n the noise along the weak direction in
// sigmas, the roots stand 4 n of their predicted sigmas apart (pose/docs/pose_from_leds.md, "Two
// LEDs"). Asking for 20 refuses all geometries that could be singular within five sigmas of noise.
constexpr double kRootSeparationSigma = 20.0;
// Two roots whose chi2 differ by less than this are not told apart by the noise: 1 to 400.
constexpr double kClearlyBetterChi2 = 12.0;
constexpr double kSamePoseRad = 1e-3;

double TurnBetween(const Rigid3& a, const Rigid3& b) { return ErrorBetween(a, b).head<3>().norm(); }

// The other root's place is the start pose's: exact for two LEDs, near enough for more.
bool RootsMerge(const PoseEstimate& estimate, const TiltConstraint& tilts, const Rigid3& other) {
  const Eigen::Vector3d& up = tilts.up_in_camera;
  const double sigma_rad = std::sqrt(up.dot(estimate.covariance.topLeftCorner<3, 3>() * up));
  return TurnBetween(estimate.camera_from_target, other) < kRootSeparationSigma * sigma_rad;
}

PoseResult SolveNearStart(const PoseProblem& problem,
                          const TiltConstraint& tilts,
                          const Rigid3& start,
                          const SolveOptions& options) {
  PoseResult result = Refine(problem, &tilts, start, options);
  if (!result || problem.leds.size() > 3) return result;
  const auto roots = StartPose(problem);
  if (!roots) return Failure{roots.error()};
  const auto& poses = roots->camera_from_target;
  if (poses.size() < 2) return result;
  const Rigid3& found = result->camera_from_target;
  const bool is_first = TurnBetween(found, poses[0]) < TurnBetween(found, poses[1]);
  const Rigid3& other = is_first ? poses[1] : poses[0];
  if (RootsMerge(*result, tilts, other)) return Failure{PoseFailure::kNotObservable};
  return result;
}

PoseResult SolveCold(const PoseProblem& problem,
                     const TiltConstraint& tilts,
                     const SolveOptions& options) {
  const auto roots = StartPose(problem);
  if (!roots) return Failure{roots.error()};
  const auto& poses = roots->camera_from_target;
  PoseResult best = Refine(problem, &tilts, poses[0], options);
  if (poses.size() < 2) return best;
  PoseResult other = Refine(problem, &tilts, poses[1], options);
  if (!best || (other && other->chi2 < best->chi2)) std::swap(best, other);
  if (!best) return best;
  if (!other) {
    // Two LEDs fit both roots exactly, whether or not the other one settles.
    if (problem.leds.size() > 2) return best;
    const bool is_weak = other.error() == PoseFailure::kNotObservable;
    return Failure{is_weak ? PoseFailure::kNotObservable : PoseFailure::kAmbiguous};
  }
  if (TurnBetween(best->camera_from_target, other->camera_from_target) < kSamePoseRad) return best;
  if (RootsMerge(*best, tilts, other->camera_from_target)) {
    return Failure{PoseFailure::kNotObservable};
  }
  if (other->chi2 - best->chi2 < kClearlyBetterChi2) return Failure{PoseFailure::kAmbiguous};
  return best;
}

}  // namespace

PoseResult SolveFused(const PoseProblem& problem,
                      const std::optional<Rigid3>& start,
                      const SolveOptions& options) {
  CheckIsOurs(problem);
  const auto tilts = TiltConstraint::From(problem);
  if (!tilts) return SolveVision(problem, start, options);
  if (problem.leds.size() < 2) return Failure{PoseFailure::kTooFewLeds};
  return start ? SolveNearStart(problem, *tilts, *start, options)
               : SolveCold(problem, *tilts, options);
}

PoseResult SolveVision(const PoseProblem& problem,
                       const std::optional<Rigid3>& start,
                       const SolveOptions& options) {
  CheckIsOurs(problem);
  if (problem.leds.size() < 3) return Failure{PoseFailure::kTooFewLeds};
  if (start) return Refine(problem, nullptr, *start, options);
  if (const auto starts = StartPose(problem)) {
    return Refine(problem, nullptr, starts->camera_from_target[0], options);
  }
  const VisionStarts starts = StartVision(problem);
  PoseResult best = Failure{PoseFailure::kNotObservable};
  for (const Rigid3& candidate : starts) {
    PoseResult result = Refine(problem, nullptr, candidate, options);
    if (!result) {
      if (!best) best = std::move(result);
      continue;
    }
    if (!best) {
      best = std::move(result);
      continue;
    }
    const double apart_rad = TurnBetween(best->camera_from_target, result->camera_from_target);
    if (apart_rad < kSamePoseRad) continue;
    if (std::abs(best->chi2 - result->chi2) < kClearlyBetterChi2) {
      return Failure{PoseFailure::kAmbiguous};
    }
    if (result->chi2 < best->chi2) best = std::move(result);
  }
  return best;
}

}  // namespace tbm
