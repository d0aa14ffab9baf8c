#include "pose/frame/frame_solver.h"

#include <bit>
#include <cmath>
#include <limits>

namespace tbm {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

FinderOptions FinderOptionsOf(const Rig& rig) {
  FinderOptions options;
  options.gain_dn_per_electron = rig.gain_dn_per_electron;
  options.read_noise_dn = rig.read_noise_dn;
  return options;
}

PoseReason ReasonOf(ImageFailure failure) {
  return failure == ImageFailure::kDark ? PoseReason::kFrameDark : PoseReason::kFrameSaturated;
}

PoseReason ReasonOf(AssignFailure failure) {
  switch (failure) {
    case AssignFailure::kTooFewCentres:
      return PoseReason::kTooFewLeds;
    case AssignFailure::kNoMatch:
      return PoseReason::kNoMatch;
    case AssignFailure::kAmbiguous:
      return PoseReason::kAmbiguous;
  }
  TBM_CHECK(false);
  return PoseReason::kNoMatch;
}

Inclination InclinationOf(const FrameTilt& tilt) {
  return tilt.observation ? tilt.observation->inclination : Inclination{kNaN, kNaN};
}

double Jump(const Inclination& now, const Inclination& before) {
  return std::hypot(now.beta_rad - before.beta_rad, now.gamma_rad - before.gamma_rad);
}

std::optional<PosePriorInfo> InfoOf(const std::optional<PosePrior>& prior) {
  if (!prior) return std::nullopt;
  return PosePriorInfo{prior->camera_from_target, prior->covariance};
}

}  // namespace

FrameSolver::FrameSolver(const Rig& rig,
                         const FrameSolverOptions& options,
                         PublishedSolver published)
    : rig_(rig),
      options_(options),
      published_(published),
      finder_(FinderOptionsOf(rig)),
      target_history_(options.tilt),
      camera_history_(options.tilt),
      monitor_(rig, options.monitor) {
  TBM_CHECK(options.method != PoseMethod::kPublished || published != nullptr);
  TBM_CHECK(rig.points.size() <= PointResults::capacity());
}

void FrameSolver::AddTilt(const TiltReading& reading) {
  TiltHistory& history = reading.sensor == TiltSensor::kTarget ? target_history_ : camera_history_;
  history.Add(reading.sensed_at, reading.inclination);
}

const FrameResult& FrameSolver::Solve(const FrameInput& frame) {
  result_ = FrameResult{};
  result_.led_of_centre.fill(-1);
  result_.sensed_at = frame.sensed_at;
  if (last_sensed_at_ && *last_sensed_at_ - frame.sensed_at > kClockSetBack) {
    accepted_.reset();
  } else if (last_sensed_at_ && frame.sensed_at <= *last_sensed_at_) {
    result_.reason = PoseReason::kStampNotIncreasing;
    return result_;
  }
  last_sensed_at_ = frame.sensed_at;
  SolveInto(frame, result_);
  TBM_CHECK((result_.status == PoseStatus::kNone) == !result_.pose.has_value());
  TBM_CHECK((result_.status == PoseStatus::kOk) == (result_.reason == PoseReason::kNone));
  return result_;
}

void FrameSolver::SolveInto(const FrameInput& frame, FrameResult& result) {
  result.target_tilt = TiltAt(target_history_, rig_.target_tilt, frame.sensed_at);
  result.camera_tilt = TiltAt(camera_history_, rig_.camera_tilt, frame.sensed_at);

  if (frame.image_fault != PoseReason::kNone) {
    result.reason = frame.image_fault;
    return;
  }
  if (frame.image.width_px != rig_.camera.image_width_px ||
      frame.image.height_px != rig_.camera.image_height_px) {
    result.reason = PoseReason::kFrameSize;
    return;
  }
  const auto found = finder_.Find(frame.image);
  if (!found) {
    result.reason = ReasonOf(found.error());
    return;
  }
  result.centres = (*found)->centres;
  result.levels = (*found)->levels;

  const std::optional<PosePrior> prior = PriorAt(frame.sensed_at);
  const auto assignment = Assign(result, prior);
  if (!assignment) {
    result.reason = ReasonOf(assignment.error());
    return;
  }
  for (std::size_t i = 0; i < assignment->leds.size(); ++i) {
    result.led_of_centre[static_cast<std::size_t>(assignment->spot_of_led[i])] =
        static_cast<std::int8_t>(assignment->leds[i].led_index);
  }
  SolveAssigned(*assignment, prior, result);
}

Result<Assignment, AssignFailure> FrameSolver::Assign(const FrameResult& result,
                                                      const std::optional<PosePrior>& prior) const {
  const auto& target_tilt = result.target_tilt.observation;
  const auto& camera_tilt = result.camera_tilt.observation;
  auto assignment =
      AssignLeds(rig_, result.centres, target_tilt, camera_tilt, prior, options_.assign);
  // Tilts that contradict the image leave no match, or several bad ones. The image alone may still
  // have one; the checks that follow then find the tilts at fault.
  if (!assignment && assignment.error() != AssignFailure::kTooFewCentres && target_tilt &&
      camera_tilt) {
    auto doubting = AssignLedsDoubtingTilts(
        rig_, result.centres, *target_tilt, *camera_tilt, prior, options_.assign);
    if (doubting && doubting->leds.size() >= 4) return doubting;
  }
  return assignment;
}

void FrameSolver::SolveAssigned(const Assignment& assignment,
                                const std::optional<PosePrior>& prior,
                                FrameResult& result) {
  PoseProblem problem;
  problem.rig = &rig_;
  problem.leds = assignment.leds;
  IntegrityOptions integrity = options_.integrity;
  if (options_.method == PoseMethod::kVision) {
    integrity.expect_tilts = false;
  } else if (result.target_tilt.observation && result.camera_tilt.observation) {
    problem.target_tilt = result.target_tilt.observation;
    problem.camera_tilt = result.camera_tilt.observation;
  }

  const std::optional<PosePriorInfo> info = InfoOf(prior);
  auto checked = CheckPose(problem, assignment.camera_from_target, info, integrity, options_.solve);
  if (checked && options_.method == PoseMethod::kPublished) {
    checked = PublishedInstead(problem, *checked);
  }
  if (!checked) {
    result.reason = checked.error();
    return;
  }
  result.pose = *checked;
  result.points = CheckPoints(problem, *checked, info, integrity);
  result.status = checked->status;
  result.reason = checked->reason;
  NameTiltFault(result);
  WatchMountings(problem, result);
  Accept(result);
}

Result<CheckedPose, PoseReason> FrameSolver::PublishedInstead(const PoseProblem& problem,
                                                              const CheckedPose& checked) const {
  // Eq. 18 has no idea of a wrong reading and needs both tilts; it gets what passed the checks.
  PoseProblem passed;
  passed.rig = problem.rig;
  for (const LedObservation& led : problem.leds) {
    if (((checked.leds_used >> led.led_index) & 1u) != 0) passed.leds.push_back(led);
  }
  if (!checked.tilts_used) return Failure{PoseReason::kNotObservable};
  passed.target_tilt = problem.target_tilt;
  passed.camera_tilt = problem.camera_tilt;
  const PoseResult published = published_(passed, checked.pose.camera_from_target, options_.solve);
  if (!published) return Failure{ReasonOf(published.error())};
  CheckedPose out = checked;
  out.pose = *published;
  return out;
}

void FrameSolver::NameTiltFault(FrameResult& result) const {
  if (options_.method == PoseMethod::kVision) return;
  if (result.reason == PoseReason::kTiltDisagrees) result.tilt_suspect = SuspectTilt(result);
  for (const FrameTilt* tilt : {&result.target_tilt, &result.camera_tilt}) {
    if (tilt->fault == PoseReason::kNone) continue;
    result.status = PoseStatus::kDegraded;
    result.reason = tilt->fault;
    return;
  }
}

// The alarm stands until a full window says otherwise.
void FrameSolver::WatchMountings(const PoseProblem& problem, FrameResult& result) {
  result.mounting = monitor_.Add(problem, *result.pose);
  if (result.mounting.moved()) {
    mounting_moved_ = true;
  } else if (result.mounting.absolute) {
    mounting_moved_ = false;
  }
  if (mounting_moved_ && result.status == PoseStatus::kOk) {
    result.status = PoseStatus::kDegraded;
    result.reason = PoseReason::kMountingMoved;
  }
}

// A pose that nothing checks (two LEDs, or three without tilts) must not steer the next frames.
void FrameSolver::Accept(const FrameResult& result) {
  const int leds = std::popcount(result.pose->leds_used);
  if (leds < (result.pose->tilts_used ? 3 : 4)) return;
  AcceptedPose accepted;
  accepted.sensed_at = result.sensed_at;
  accepted.camera_from_target = result.pose->pose.camera_from_target;
  accepted.covariance = result.pose->pose.covariance;
  if (result.pose->tilts_used) {
    accepted.target_tilt = InclinationOf(result.target_tilt);
    accepted.camera_tilt = InclinationOf(result.camera_tilt);
  } else if (accepted_) {
    accepted.target_tilt = accepted_->target_tilt;
    accepted.camera_tilt = accepted_->camera_tilt;
  }
  accepted_ = accepted;
}

std::optional<PosePrior> FrameSolver::PriorAt(Timestamp at) const {
  if (!accepted_ || at - accepted_->sensed_at > options_.prior_max_age) return std::nullopt;
  const double age_s = SecondsBetween(accepted_->sensed_at, at);
  PosePrior prior{accepted_->camera_from_target, accepted_->covariance};
  const double turn_rad = options_.motion_sigma_rad_per_s * age_s;
  const double shift_m = options_.motion_sigma_m_per_s * age_s;
  prior.covariance.diagonal().head<3>().array() += turn_rad * turn_rad;
  prior.covariance.diagonal().tail<3>().array() += shift_m * shift_m;
  return prior;
}

// Whose reading moved since the last accepted pose while the other's did not. One frame alone
// cannot tell: only the difference of both tilts shows in the image.
std::optional<TiltSensor> FrameSolver::SuspectTilt(const FrameResult& result) const {
  if (!accepted_) return std::nullopt;
  const double target_jump = Jump(InclinationOf(result.target_tilt), accepted_->target_tilt);
  const double camera_jump = Jump(InclinationOf(result.camera_tilt), accepted_->camera_tilt);
  constexpr double kClearly = 5.0;
  if (target_jump > kClearly * camera_jump) return TiltSensor::kTarget;
  if (camera_jump > kClearly * target_jump) return TiltSensor::kCamera;
  return std::nullopt;
}

FrameTilt FrameSolver::TiltAt(const TiltHistory& history,
                              const TiltMount& mount,
                              Timestamp at) const {
  const auto tilt = history.At(at, mount);
  if (!tilt) return {std::nullopt, tilt.error()};
  return {*tilt, PoseReason::kNone};
}

}  // namespace tbm
