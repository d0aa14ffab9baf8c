#include "guidance/rail/rail_tracker.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "guidance/fusion/target_modes.h"

namespace tbm {
namespace {

// Without samples of the unit nothing is filtered: what comes meanwhile may not fill the memory.
constexpr std::size_t kMostKept = 10'000;

}  // namespace

RailTracker::RailTracker(RailSetup setup,
                         std::vector<SurveyedTarget> targets,
                         const RailTrackerSettings& settings)
    : setup_(std::move(setup)),
      targets_(std::move(targets)),
      lag_(std::llround(settings.lag_s * 1e9)) {}

void RailTracker::Add(const ImuSample& sample) {
  if (phase_ == RailTrackerPhase::kNoRun) {
    phase_ = RailTrackerPhase::kWaitingForRest;
    rest_ends_at_ = BeginOfRun(sample) + Duration(std::llround(setup_.start.at_rest_s * 1e9));
  } else if (sample.ends_at <= newest_) {
    ++came_too_late_;
    return;
  }
  newest_ = sample.ends_at;
  if (phase_ == RailTrackerPhase::kStartFailed) return;
  samples_.push_back(sample);
  if (phase_ == RailTrackerPhase::kTracks) {
    quiet_->Feed(sample);
    Step();
  } else if (rest_ends_at_ + lag_ <= newest_) {
    Start();
  }
}

void RailTracker::Add(const TrolleyTilt& tilt) { Keep(tilt.sensed_at, tilt, &tilts_); }
void RailTracker::Add(const TargetImage& image) { Keep(image.stamped_at, image, &images_); }
void RailTracker::Add(const OdometerReading& reading) {
  const std::optional<OdometerReading> before = std::exchange(last_reading_, reading);
  if (!before) return;
  if (reading.sensed_at <= before->sensed_at) {
    last_reading_ = before;
    ++came_too_late_;
    return;
  }
  const OdometerSpan span{*before, reading};
  Keep(span.Middle(), span, &wheels_);
}

template <class Input>
void RailTracker::Keep(Timestamp at, const Input& input, Kept<Input>* kept) {
  if (phase_ == RailTrackerPhase::kStartFailed) return;
  if (filter_ && at <= filter_->filter().now()) {
    ++came_too_late_;
    return;
  }
  kept->emplace(at, input);
  if (kept->size() > kMostKept) kept->erase(kept->begin());
}

template <class Input>
void RailTracker::Pass(Timestamp up_to, Kept<Input>* kept) {
  const auto end = kept->upper_bound(up_to);
  for (auto it = kept->begin(); it != end; ++it) filter_->Add(it->second);
  kept->erase(kept->begin(), end);
}

void RailTracker::Start() {
  RailRecording so_far;
  so_far.imu.assign(samples_.begin(), samples_.end());
  for (const auto& [at, tilt] : tilts_) so_far.tilts.push_back(tilt);
  for (const auto& [at, image] : images_) so_far.images.push_back(image);
  so_far.targets = targets_;
  const auto rest = FindRestSignature(setup_, so_far);
  const auto attitude = rest ? FindStartAttitude(setup_, so_far, *rest)
                             : Result<Eigen::Quaterniond, RailStartFailure>(Failure{rest.error()});
  if (!attitude) {
    phase_ = RailTrackerPhase::kStartFailed;
    start_failure_ = attitude.error();
    samples_.clear();
    tilts_.clear();
    images_.clear();
    wheels_.clear();
    return;
  }
  phase_ = RailTrackerPhase::kTracks;
  quiet_.emplace(setup_, *rest);
  for (const ImuSample& sample : samples_) quiet_->Feed(sample);
  // What is wrong with the survey takes a whole run to be seen: the line that is smoothed in the
  // end has it in its state. This one takes the targets as they stand, image after image: its own
  // covariance knows nothing of an error that all images share, so WeighSurvey adds it.
  filter_.emplace(setup_,
                  targets_,
                  quiet_->spans(),
                  MakeRailPrior(setup_, *attitude, 0),
                  BeginOfRun(samples_.front()),
                  nullptr);
  at_last_epoch_m_ = setup_.start.position_world_m;
  Step();
}

void RailTracker::Step() {
  while (!samples_.empty() && samples_.front().ends_at + lag_ <= newest_) {
    Follow(samples_.front());
    samples_.pop_front();
  }
}

void RailTracker::Follow(const ImuSample& sample) {
  const auto newest = images_.upper_bound(sample.ends_at);
  if (newest != images_.begin()) newest_image_ = std::prev(newest)->second;
  Pass(sample.ends_at, &tilts_);
  Pass(sample.ends_at, &images_);
  Pass(sample.ends_at, &wheels_);
  filter_->Feed(sample);
  rejections_ += filter_->TakeRejections().size();
  if (filter_->last_epoch() != last_epoch_) AddDistance();
  WeighSurvey();
}

// Of the last image that was taken; it stays when none come, as the place does.
void RailTracker::WeighSurvey() {
  const RailConsistency& seen =
      filter_->consistency()[static_cast<std::size_t>(FusionUpdate::kTargets)];
  if (!newest_image_ || seen.last_accepted_at != newest_image_->stamped_at) return;
  const FusionState& state = filter_->filter().state();
  const Rigid3 world_from_imu{state.motion.world_from_imu, state.motion.position_world_m};
  const Rigid3 camera_from_imu{state.camera_from_imu,
                               state.camera_from_imu * -state.camera_in_imu_m};
  TargetView view{camera_from_imu * Inverse(world_from_imu), {}};
  for (const TargetPixel& pixel : newest_image_->pixels) view.targets.push_back(pixel.target);
  const double level_rad = setup_.tilt
                               ? std::hypot(setup_.tilt->sigma_rad, setup_.tilt->sigma_rotation_rad)
                               : setup_.imu.accel_bias_sigma_m_s2 / setup_.gravity_m_s2;
  survey_sigma_m_ = SurveySigma(
      view, setup_.camera->model, setup_.camera->residual_px, std::max(level_rad, 1e-6), targets_);
  newest_image_.reset();
}

// As along a finished line: between epochs, and not at all where the trolley stands.
void RailTracker::AddDistance() {
  const Timestamp epoch = *filter_->last_epoch();
  if (last_epoch_) {
    // What is corrected at an epoch was not run.
    const double chord_m = (filter_->arrived().position_world_m - at_last_epoch_m_).norm();
    if (chord_m > kStill_m_s * SecondsBetween(*last_epoch_, epoch)) distance_m_ += chord_m;
  }
  at_last_epoch_m_ = filter_->filter().state().motion.position_world_m;
  last_epoch_ = epoch;
}

TrolleyHold RailTracker::HoldAt(Timestamp at) const {
  const std::vector<Timestamp>& fixes = filter_->fixes();
  const std::vector<RestSpan>& gaps = filter_->gaps();
  if (!gaps.empty() && (fixes.empty() || fixes.back() < gaps.back().ends_at)) {
    return TrolleyHold::kGap;
  }
  const bool is_held = !fixes.empty() && SecondsBetween(fixes.back(), at) <= kHeld_s;
  return is_held ? TrolleyHold::kFixed : TrolleyHold::kOpen;
}

std::optional<TrolleyPlace> RailTracker::Place() const {
  if (phase_ != RailTrackerPhase::kTracks || !filter_->last_epoch()) return {};
  FusionFilter ahead = filter_->filter();
  TrolleyPlace place;
  place.hold = HoldAt(samples_.empty() ? ahead.now() : samples_.back().ends_at);
  for (const ImuSample& sample : samples_) {
    const double gap_s = GapBefore(setup_, ahead.now(), sample);
    if (gap_s > 0.0) place.hold = TrolleyHold::kGap;
    FeedUpTo(ahead, setup_, sample, sample.ends_at, gap_s);
  }
  ahead.BringForward();
  place.at = ahead.now();
  place.motion = ahead.state().motion;
  const FusionVector sigma = ahead.covariance().diagonal().cwiseSqrt();
  place.sigma_position_m =
      (sigma.segment<3>(FusionLayout::kPosition).cwiseAbs2() + survey_sigma_m_.cwiseAbs2())
          .cwiseSqrt();
  place.sigma_velocity_m_s = sigma.segment<3>(FusionLayout::kVelocity);
  place.sigma_attitude_rad = sigma.segment<3>(FusionLayout::kAttitude);
  place.gyro_bias_rad_s = ahead.state().gyro_bias_rad_s;
  place.sigma_gyro_bias_rad_s = sigma.segment<3>(FusionLayout::kGyroBias);
  place.accel_bias_m_s2 = ahead.state().accel_bias_m_s2;
  place.sigma_accel_bias_m_s2 = sigma.segment<3>(FusionLayout::kAccelBias);
  const double beyond_m = (place.motion.position_world_m - at_last_epoch_m_).norm();
  const bool moves = beyond_m > kStill_m_s * SecondsBetween(*last_epoch_, place.at);
  place.distance_m = distance_m_ + (moves ? beyond_m : 0.0);
  const auto age = [&](FusionUpdate update) -> std::optional<double> {
    const auto& at = filter_->consistency()[static_cast<std::size_t>(update)].last_accepted_at;
    if (!at) return {};
    return SecondsBetween(*at, place.at);
  };
  place.target_age_s = age(FusionUpdate::kTargets);
  place.tilt_age_s = age(FusionUpdate::kTilt);
  place.rest_age_s = age(FusionUpdate::kRest);
  return place;
}

}  // namespace tbm
