#include "guidance/rail/rail_filter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "guidance/fusion/displacement_update.h"
#include "guidance/fusion/rest_update.h"

namespace tbm {
namespace {

// The covariance is brought forward at least so often.
constexpr Duration kLongestEpoch = std::chrono::milliseconds(100);
// What may have happened while samples are missing.
constexpr double kGapForce_m_s2 = 0.5;
constexpr double kGapRate_rad_s = 0.05;
// How well the start is known before the filter begins: so badly that the same readings, when the
// filter takes them, are not counted twice.
constexpr double kStartLevel_rad = 2e-3;
constexpr double kStartHeading_rad = 5e-3;
constexpr double kStartVelocity_m_s = 1e-3;
// By how much a trolley's acceleration may change between two readings of the wheel: an eighth of
// it times the span is what the mean speed may be off the speed of half way.
constexpr double kMostChange_m_s2 = 0.2;

std::vector<FusionOption> OptionsOf(const RailSetup& setup) {
  std::vector<FusionOption> options;
  if (setup.camera) {
    options = {
        FusionOption::kTimeOffset, FusionOption::kCameraRotation, FusionOption::kCameraPosition};
  }
  if (setup.tilt && setup.tilt->sigma_rotation_rad > 0.0) {
    options.push_back(FusionOption::kTiltOffset);
  }
  if (setup.odometer) {
    options.push_back(FusionOption::kOdometerScale);
    options.push_back(FusionOption::kOdometerTurn);
  }
  if (setup.ground) {
    options.push_back(FusionOption::kImageScale);
    options.push_back(FusionOption::kImageTurn);
  }
  return options;
}

}  // namespace

RailPrior MakeRailPrior(const RailSetup& setup,
                        const Eigen::Quaterniond& world_from_imu,
                        int modes) {
  RailPrior prior;
  prior.layout = FusionLayout(OptionsOf(setup), modes);
  FusionState& state = prior.state;
  state.motion.position_world_m = setup.start.position_world_m;
  state.motion.world_from_imu = world_from_imu;
  FusionVector sigma = FusionVector::Zero(prior.layout.size());
  sigma.segment<3>(FusionLayout::kPosition).setConstant(setup.start.sigma_position_m);
  sigma.segment<3>(FusionLayout::kVelocity).setConstant(kStartVelocity_m_s);
  sigma.segment<3>(FusionLayout::kGyroBias)
      .setConstant(std::hypot(setup.imu.gyro_bias_sigma_rad_s, kEarthRate_rad_s));
  sigma.segment<3>(FusionLayout::kAccelBias).setConstant(setup.imu.accel_bias_sigma_m_s2);
  if (setup.camera) {
    const RailCamera& camera = *setup.camera;
    state.time_offset_s = camera.time_offset_s;
    state.camera_from_imu = camera.camera_from_imu;
    state.camera_in_imu_m = camera.in_imu_m;
    sigma[prior.layout.At(FusionOption::kTimeOffset)] = camera.sigma_time_offset_s;
    sigma.segment<3>(prior.layout.At(FusionOption::kCameraRotation))
        .setConstant(camera.sigma_rotation_rad);
    sigma.segment<3>(prior.layout.At(FusionOption::kCameraPosition))
        .setConstant(camera.sigma_position_m);
  }
  if (prior.layout.Has(FusionOption::kTiltOffset)) {
    sigma.segment<2>(prior.layout.At(FusionOption::kTiltOffset))
        .setConstant(setup.tilt->sigma_rotation_rad);
  }
  if (setup.odometer) {
    sigma[prior.layout.At(FusionOption::kOdometerScale)] = setup.odometer->sigma_scale;
    sigma.segment<2>(prior.layout.At(FusionOption::kOdometerTurn))
        .setConstant(setup.odometer->sigma_rotation_rad);
  }
  if (setup.ground) {
    sigma[prior.layout.At(FusionOption::kImageScale)] =
        setup.ground->sigma_height_m / setup.ground->height_m;
    sigma[prior.layout.At(FusionOption::kImageTurn)] = setup.ground->sigma_rotation_rad;
  }
  state.modes.setZero(modes);
  if (modes > 0) sigma.tail(modes).setOnes();
  // What is exactly known is known to a millionth of what matters.
  sigma = sigma.cwiseMax(1e-9);
  prior.covariance = sigma.cwiseAbs2().asDiagonal();
  // Level is known better than heading; both about the axes of the world.
  const Eigen::Matrix3d imu_from_world = world_from_imu.conjugate().toRotationMatrix();
  const double level_rad =
      setup.tilt
          ? std::hypot(kStartLevel_rad, setup.tilt->sigma_rotation_rad)
          : std::hypot(kStartLevel_rad, setup.imu.accel_bias_sigma_m_s2 / setup.gravity_m_s2);
  const double seen_rad =
      std::hypot(kStartHeading_rad, setup.camera ? setup.camera->sigma_rotation_rad : 0.0);
  const double heading_rad = setup.start.heading_rad ? setup.start.sigma_heading_rad : seen_rad;
  const Eigen::Vector3d attitude(level_rad, level_rad, heading_rad);
  prior.covariance.block<3, 3>(FusionLayout::kAttitude, FusionLayout::kAttitude) =
      imu_from_world * attitude.cwiseAbs2().asDiagonal() * imu_from_world.transpose();
  return prior;
}

void FeedUpTo(
    FusionFilter& filter, const RailSetup& setup, ImuSample sample, Timestamp to, double gap_s) {
  sample.interval_s = SecondsBetween(filter.now(), to);
  sample.ends_at = to;
  if (gap_s <= 0.0) return filter.Feed(sample);
  ImuNoise unknown = setup.imu.noise;
  unknown.angle_random_walk_rad = kGapRate_rad_s * std::sqrt(gap_s);
  unknown.velocity_random_walk_m_s = kGapForce_m_s2 * std::sqrt(gap_s);
  filter.Feed(sample, unknown);
}

RailFilter::RailFilter(const RailSetup& setup,
                       const std::vector<SurveyedTarget>& targets,
                       const std::vector<RestSpan>& rests,
                       const RailPrior& prior,
                       Timestamp begin,
                       FusionSmoother* smoother)
    : setup_(setup),
      targets_(targets),
      rests_(rests),
      begin_(begin),
      filter_(std::in_place,
              prior.layout,
              prior.state,
              prior.covariance,
              setup.imu.noise,
              setup.gravity_m_s2,
              begin_),
      smoother_(smoother) {}

void RailFilter::Feed(const ImuSample& sample) {
  if (!last_epoch_) EndEpoch();
  gap_s_ = GapBefore(setup_, filter_->now(), sample);
  if (gap_s_ > 0.0) gaps_.push_back({filter_->now(), sample.ends_at});
  // Where rest ends it is made sure of, before the motion begins.
  if (!held_.empty() && (gap_s_ > 0.0 || !SaysRest(sample.ends_at))) EndEpoch();
  while (NextStamp() < sample.ends_at) Advance(sample, NextStamp());
  Advance(sample, sample.ends_at);
}

void RailFilter::Finish() {
  if (last_epoch_ && *last_epoch_ < filter_->now()) EndEpoch();
  for (const TrolleyTilt& tilt : std::exchange(tilts_, {})) {
    Outside(tilt.sensed_at, FusionUpdate::kTilt);
  }
  for (const TargetImage& image : std::exchange(images_, {})) {
    Outside(image.stamped_at, FusionUpdate::kTargets);
  }
  for (const OdometerSpan& span : std::exchange(wheels_, {})) {
    Outside(span.Middle(), FusionUpdate::kOdometer);
  }
  for (const GroundDisplacement& ground : std::exchange(grounds_, {})) {
    Outside(ground.to, FusionUpdate::kImageDisplacement);
  }
}

std::vector<RailRejection> RailFilter::TakeRejections() { return std::exchange(rejections_, {}); }

// The next stamp that has to be an epoch.
Timestamp RailFilter::NextStamp() const {
  Timestamp next = *last_epoch_ + kLongestEpoch;
  if (!tilts_.empty()) next = std::min(next, tilts_.front().sensed_at);
  if (!images_.empty()) next = std::min(next, images_.front().stamped_at);
  if (!wheels_.empty()) next = std::min(next, wheels_.front().Middle());
  if (!grounds_.empty()) {
    next = std::min(next, ground_from_ ? grounds_.front().to : grounds_.front().from);
  }
  return next;
}

void RailFilter::Advance(const ImuSample& sample, Timestamp to) {
  if (to > filter_->now()) {
    // Also a trolley that rested may have been moved while samples are missing.
    in_gap_ = gap_s_ > 0.0;
    if (!in_gap_ && rests_now_ && SaysRest(to)) {
      Hold(sample, to);
    } else {
      const double span_s = SecondsBetween(filter_->now(), to);
      fed_.span_s += span_s;
      fed_.gyro_rad_s += span_s * sample.gyro_rad_s;
      fed_.accel_m_s2 += span_s * sample.accel_m_s2;
      FeedUpTo(*filter_, setup_, sample, to, gap_s_);
    }
  }
  if (NextStamp() <= to) EndEpoch();
}

// What the start declares, or the samples show.
bool RailFilter::SaysRest(Timestamp at) const {
  if (SecondsBetween(begin_, at) <= setup_.start.at_rest_s) return true;
  return std::any_of(rests_.begin(), rests_.end(), [&](const RestSpan& span) {
    return span.begins_at <= at && at <= span.ends_at;
  });
}

// By something outside of the unit, so lately that rest goes on holding it.
bool RailFilter::IsHeld(Timestamp at) const {
  const Timestamp last = fixes_.empty() ? begin_ : fixes_.back();
  if (!gaps_.empty() && gaps_.back().ends_at > last) return false;
  return SecondsBetween(last, at) <= kHeld_s;
}

void RailFilter::Hold(ImuSample sample, Timestamp to) {
  if (held_.empty()) before_held_.emplace(*filter_);
  sample.interval_s = SecondsBetween(filter_->now(), to);
  sample.ends_at = to;
  held_.push_back(sample);
  filter_->Hold(sample);
}

// It was no rest: what was held is integrated after all.
void RailFilter::IntegrateHeld() {
  filter_.emplace(*before_held_);
  for (const ImuSample& sample : held_) filter_->Feed(sample);
  filter_->BringForward();
}

// Whether the unit rests now. Tried before anything is remembered of this epoch. An even push is as
// quiet as rest: where rest begins, what was felt before must be gravity alone.
bool RailFilter::TakeRest() {
  const FusionFilter::Held fed = std::exchange(fed_, {});
  if (in_gap_ || !SaysRest(filter_->now())) return false;
  FusionFilter tried = *filter_;
  const FusionVerdict verdict =
      held_.empty() && fed.span_s > 0.0
          ? TryRest(
                tried, {}, {fed.span_s, fed.gyro_rad_s / fed.span_s, fed.accel_m_s2 / fed.span_s})
          : UpdateByRest(tried, {});
  if (verdict.accepted) return true;
  Count(verdict);
  if (!held_.empty()) IntegrateHeld();
  return false;
}

void RailFilter::EndEpoch() {
  const Timestamp now = filter_->now();
  last_epoch_ = now;
  filter_->BringForward();
  rests_now_ = TakeRest();
  held_.clear();
  if (smoother_ != nullptr) smoother_->Before(*filter_);
  arrived_ = filter_->state().motion;
  if (rests_now_) {
    Count(UpdateByRest(*filter_, {}));
    if (IsHeld(now)) fixes_.push_back(now);
  }
  for (; !tilts_.empty() && tilts_.front().sensed_at <= now; tilts_.pop_front()) {
    const TrolleyTilt& tilt = tilts_.front();
    if (!setup_.tilt) continue;
    if (tilt.sensed_at < now) {
      Outside(tilt.sensed_at, FusionUpdate::kTilt);
      continue;
    }
    Count(UpdateByTilt(*filter_, *setup_.tilt, tilt.angles, rests_now_));
  }
  for (; !images_.empty() && images_.front().stamped_at <= now; images_.pop_front()) {
    TakeImage(images_.front());
  }
  for (; !wheels_.empty() && wheels_.front().Middle() <= now; wheels_.pop_front()) {
    TakeWheel(wheels_.front());
  }
  CorrectGroundFrom();
  TakeGrounds();
  if (smoother_ != nullptr) smoother_->After(*filter_);
}

void RailFilter::TakeImage(const TargetImage& image) {
  if (!setup_.camera) return;
  const Timestamp now = filter_->now();
  if (image.stamped_at < now) return Outside(image.stamped_at, FusionUpdate::kTargets);
  const TargetsVerdict outcome = UpdateByTargets(
      *filter_, setup_.camera->model, setup_.camera->residual_px, targets_, image.pixels);
  Count(outcome.verdict);
  for (const RejectedPixel& rejected : outcome.rejected) {
    rejections_.push_back({now,
                           targets_[static_cast<std::size_t>(rejected.target)].name,
                           std::string(rejected.why_not)});
  }
  if (outcome.verdict.accepted) fixes_.push_back(now);
}

void RailFilter::TakeWheel(const OdometerSpan& span) {
  if (!setup_.odometer) return;
  const Timestamp at = span.Middle();
  if (at < filter_->now()) return Outside(at, FusionUpdate::kOdometer);
  const double span_s = SecondsBetween(span.from.sensed_at, span.to.sensed_at);
  OdometerMounting mounting = setup_.odometer->mounting;
  mounting.sigma_m_s = std::hypot(std::sqrt(2.0) * setup_.odometer->sigma_m / span_s,
                                  0.125 * kMostChange_m_s2 * span_s);
  Count(UpdateByOdometer(*filter_, mounting, (span.to.distance_m - span.from.distance_m) / span_s));
}

// What corrects the unit now corrects where the first image was taken: the same error, brought back
// by the time since.
void RailFilter::CorrectGroundFrom() {
  if (!ground_from_) return;
  const Motion& before = arrived_;
  const Motion& after = filter_->state().motion;
  const double since_s = SecondsBetween(ground_from_at_, filter_->now());
  ground_from_->position_world_m +=
      after.position_world_m - before.position_world_m -
      since_s * (after.velocity_world_m_s - before.velocity_world_m_s);
  ground_from_->world_from_imu =
      (after.world_from_imu * before.world_from_imu.conjugate() * ground_from_->world_from_imu)
          .normalized();
}

void RailFilter::TakeGrounds() {
  const Timestamp now = filter_->now();
  while (!grounds_.empty()) {
    const GroundDisplacement& ground = grounds_.front();
    if (!ground_from_) {
      if (ground.from > now) return;
      if (ground.from == now) {
        ground_from_ = filter_->state().motion;
        ground_from_at_ = now;
        return;
      }
      Outside(ground.to, FusionUpdate::kImageDisplacement);
    } else {
      if (ground.to > now) return;
      Count(UpdateByImageDisplacement(
          *filter_,
          GroundVehicle(*setup_.ground),
          *ground_from_,
          {ground.told_m, SecondsBetween(ground.from, ground.to), ground.sigma_m}));
      ground_from_.reset();
    }
    grounds_.pop_front();
  }
}

// Before the first sample or after the last.
void RailFilter::Outside(Timestamp at, FusionUpdate update) {
  FusionVerdict verdict;
  verdict.update = update;
  verdict.sensed_at = at;
  verdict.why_not = "outside_of_samples";
  Count(verdict);
}

void RailFilter::Count(const FusionVerdict& verdict) {
  RailConsistency& kind = consistency_[static_cast<std::size_t>(verdict.update)];
  ++kind.given;
  if (!verdict.accepted) {
    rejections_.push_back(
        {verdict.sensed_at, std::string(Word(verdict.update)), std::string(verdict.why_not)});
    return;
  }
  ++kind.accepted;
  kind.nis += verdict.nis;
  kind.dof += verdict.dof;
  kind.last_accepted_at = verdict.sensed_at;
}

}  // namespace tbm
