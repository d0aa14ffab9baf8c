#include "guidance/rail/rail_line.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "guidance/fusion/fusion_smoother.h"
#include "guidance/fusion/rest_update.h"
#include "guidance/fusion/target_modes.h"
#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

// The covariance is brought forward at least so often.
constexpr Duration kLongestEpoch = std::chrono::milliseconds(100);
// A sample that ends later than one and a half periods after the one before leaves a gap.
constexpr double kGapPeriods = 1.5;
// What may have happened while samples are missing.
constexpr double kGapForce_m_s2 = 0.5;
constexpr double kGapRate_rad_s = 0.05;
constexpr double kHeld_s = 1.0;
constexpr double kStill_m_s = 0.003;
// How well the start is known before the filter begins: so badly that the same readings, when the
// filter takes them, are not counted twice.
constexpr double kStartLevel_rad = 2e-3;
constexpr double kStartHeading_rad = 5e-3;
constexpr double kStartVelocity_m_s = 1e-3;
// The state is no better for it than it was.
constexpr double kToldNothing = 0.9;

std::vector<FusionOption> OptionsOf(const RailSetup& setup) {
  std::vector<FusionOption> options;
  if (setup.camera) {
    options = {
        FusionOption::kTimeOffset, FusionOption::kCameraRotation, FusionOption::kCameraPosition};
  }
  if (setup.odometer) options.push_back(FusionOption::kOdometerScale);
  return options;
}

struct Prior {
  FusionLayout layout;
  FusionState state;
  FusionMatrix covariance;
};

Prior MakePrior(const RailSetup& setup, const Eigen::Quaterniond& world_from_imu, int modes) {
  Prior prior;
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
  if (setup.odometer) {
    sigma[prior.layout.At(FusionOption::kOdometerScale)] = setup.odometer->sigma_scale;
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
          ? kStartLevel_rad
          : std::hypot(kStartLevel_rad, setup.imu.accel_bias_sigma_m_s2 / setup.gravity_m_s2);
  const double seen_rad =
      std::hypot(kStartHeading_rad, setup.camera ? setup.camera->sigma_rotation_rad : 0.0);
  const double heading_rad = setup.start.heading_rad ? setup.start.sigma_heading_rad : seen_rad;
  const Eigen::Vector3d attitude(level_rad, level_rad, heading_rad);
  prior.covariance.block<3, 3>(FusionLayout::kAttitude, FusionLayout::kAttitude) =
      imu_from_world * attitude.cwiseAbs2().asDiagonal() * imu_from_world.transpose();
  return prior;
}

// Filters a recording once, from its first sample to its last.
class Run {
 public:
  Run(const RailSetup& setup,
      const RailRecording& recording,
      const std::vector<SurveyedTarget>& targets,
      const std::vector<RestSpan>& rests,
      const Prior& prior)
      : setup_(setup),
        recording_(recording),
        targets_(targets),
        rests_(rests),
        begin_(recording.imu.front().ends_at -
               Duration(std::llround(recording.imu.front().interval_s * 1e9))),
        filter_(prior.layout,
                prior.state,
                prior.covariance,
                setup.imu.noise,
                setup.gravity_m_s2,
                begin_),
        smoother_(prior.layout) {}

  void Go(RailLine* line) {
    line_ = line;
    EndEpoch();
    for (const ImuSample& sample : recording_.imu) {
      const double span_s = SecondsBetween(filter_.now(), sample.ends_at);
      const bool is_gap = span_s > kGapPeriods / setup_.imu.rate_hz;
      if (is_gap) gaps_.push_back({filter_.now(), sample.ends_at});
      gap_s_ = is_gap ? span_s : 0.0;
      while (NextStamp() < sample.ends_at) Advance(sample, NextStamp());
      Advance(sample, sample.ends_at);
    }
    if (smoother_.at(smoother_.size() - 1) < filter_.now()) EndEpoch();
    for (; tilt_ < recording_.tilts.size(); ++tilt_) {
      Outside(recording_.tilts[tilt_].sensed_at, FusionUpdate::kTilt);
    }
    for (; image_ < recording_.images.size(); ++image_) {
      Outside(recording_.images[image_].stamped_at, FusionUpdate::kTargets);
    }
    for (; wheel_ < recording_.odometer.size(); ++wheel_) {
      Outside(MiddleOf(wheel_), FusionUpdate::kOdometer);
    }
  }

  const FusionSmoother& smoother() const { return smoother_; }
  const std::vector<RestSpan>& gaps() const { return gaps_; }
  // When the position was held by something outside of the unit, in the order of time.
  const std::vector<Timestamp>& fixes() const { return fixes_; }

 private:
  // The next stamp that has to be an epoch.
  Timestamp NextStamp() const {
    Timestamp next = smoother_.at(smoother_.size() - 1) + kLongestEpoch;
    if (tilt_ < recording_.tilts.size()) {
      next = std::min(next, recording_.tilts[tilt_].sensed_at);
    }
    if (image_ < recording_.images.size()) {
      next = std::min(next, recording_.images[image_].stamped_at);
    }
    if (wheel_ < recording_.odometer.size()) next = std::min(next, MiddleOf(wheel_));
    return next;
  }

  // Between two readings the wheel has run with its mean speed, as it had it half way.
  Timestamp MiddleOf(std::size_t reading) const {
    const Timestamp before = recording_.odometer[reading - 1].sensed_at;
    return before + Duration((recording_.odometer[reading].sensed_at - before).count() / 2);
  }

  void Advance(const ImuSample& sample, Timestamp to) {
    if (to > filter_.now()) {
      ImuSample part = sample;
      part.interval_s = SecondsBetween(filter_.now(), to);
      part.ends_at = to;
      if (gap_s_ > 0.0) {
        // Also a trolley that rested may have been moved meanwhile.
        ImuNoise unknown = setup_.imu.noise;
        unknown.angle_random_walk_rad = kGapRate_rad_s * std::sqrt(gap_s_);
        unknown.velocity_random_walk_m_s = kGapForce_m_s2 * std::sqrt(gap_s_);
        filter_.Feed(part, unknown);
      } else if (rests_now_ && SaysRest(to)) {
        filter_.Hold(part);
      } else {
        filter_.Feed(part);
      }
    }
    if (NextStamp() <= to) EndEpoch();
  }

  // What the start declares, or the samples show.
  bool SaysRest(Timestamp at) const {
    if (SecondsBetween(begin_, at) <= setup_.start.at_rest_s) return true;
    return std::any_of(rests_.begin(), rests_.end(), [&](const RestSpan& span) {
      return span.begins_at <= at && at <= span.ends_at;
    });
  }

  void EndEpoch() {
    const Timestamp now = filter_.now();
    filter_.BringForward();
    smoother_.Before(filter_);
    rests_now_ = false;
    if (SaysRest(now)) {
      const FusionVerdict verdict = UpdateByRest(filter_, {});
      Count(verdict);
      rests_now_ = verdict.accepted;
    }
    if (rests_now_) fixes_.push_back(now);
    while (tilt_ < recording_.tilts.size() && recording_.tilts[tilt_].sensed_at <= now) {
      const TiltSample& tilt = recording_.tilts[tilt_++];
      if (!setup_.tilt) continue;
      if (tilt.sensed_at < now) {
        Outside(tilt.sensed_at, FusionUpdate::kTilt);
        continue;
      }
      Count(UpdateByTilt(filter_, *setup_.tilt, tilt.angles, rests_now_));
    }
    while (image_ < recording_.images.size() && recording_.images[image_].stamped_at <= now) {
      const TargetImage& image = recording_.images[image_++];
      if (!setup_.camera) continue;
      if (image.stamped_at < now) {
        Outside(image.stamped_at, FusionUpdate::kTargets);
        continue;
      }
      const TargetsVerdict outcome = UpdateByTargets(
          filter_, setup_.camera->model, setup_.camera->residual_px, targets_, image.pixels);
      Count(outcome.verdict);
      for (const RejectedPixel& rejected : outcome.rejected) {
        line_->rejections.push_back({now,
                                     targets_[static_cast<std::size_t>(rejected.target)].name,
                                     std::string(rejected.why_not)});
      }
      if (outcome.verdict.accepted) fixes_.push_back(now);
    }
    while (wheel_ < recording_.odometer.size() && MiddleOf(wheel_) <= now) TakeWheel(wheel_++);
    smoother_.After(filter_);
  }

  void TakeWheel(std::size_t reading) {
    if (!setup_.odometer) return;
    const Timestamp at = MiddleOf(reading);
    if (at < filter_.now()) return Outside(at, FusionUpdate::kOdometer);
    const OdometerReading& from = recording_.odometer[reading - 1];
    const OdometerReading& to = recording_.odometer[reading];
    const double span_s = SecondsBetween(from.sensed_at, to.sensed_at);
    OdometerMounting mounting = setup_.odometer->mounting;
    mounting.sigma_m_s = std::sqrt(2.0) * setup_.odometer->sigma_m / span_s;
    Count(UpdateByOdometer(filter_, mounting, (to.distance_m - from.distance_m) / span_s));
  }

  // Before the first sample or after the last.
  void Outside(Timestamp at, FusionUpdate update) {
    FusionVerdict verdict;
    verdict.update = update;
    verdict.sensed_at = at;
    verdict.why_not = "outside_of_samples";
    Count(verdict);
  }

  void Count(const FusionVerdict& verdict) {
    RailConsistency& kind = line_->consistency[static_cast<std::size_t>(verdict.update)];
    ++kind.given;
    if (!verdict.accepted) {
      line_->rejections.push_back(
          {verdict.sensed_at, std::string(Word(verdict.update)), std::string(verdict.why_not)});
      return;
    }
    ++kind.accepted;
    kind.nis += verdict.nis;
    kind.dof += verdict.dof;
  }

  const RailSetup& setup_;
  const RailRecording& recording_;
  const std::vector<SurveyedTarget>& targets_;
  const std::vector<RestSpan>& rests_;
  const Timestamp begin_;
  FusionFilter filter_;
  FusionSmoother smoother_;
  RailLine* line_ = nullptr;
  bool rests_now_ = false;  // since the last epoch
  double gap_s_ = 0.0;      // that the present sample stands for; 0: it is one like all
  std::size_t tilt_ = 0;
  std::size_t image_ = 0;
  std::size_t wheel_ = 1;
  std::vector<RestSpan> gaps_;
  std::vector<Timestamp> fixes_;
};

// What the line needs of an epoch.
struct Knot {
  Timestamp at;
  FusionState state;
  Eigen::Vector3d sigma_m;
};

std::vector<Knot> KnotsOf(const FusionSmoother& smoother, RailMethod method) {
  std::vector<Knot> knots(smoother.size());
  const auto put = [&](std::size_t i, const FusionEpoch& epoch) {
    knots[i] = {epoch.at,
                epoch.state,
                epoch.covariance.diagonal().segment<3>(FusionLayout::kPosition).cwiseSqrt()};
  };
  if (method == RailMethod::kSmoothed) {
    smoother.Smooth(put);
  } else {
    for (std::size_t i = 0; i < smoother.size(); ++i) put(i, smoother.Filtered(i));
  }
  return knots;
}

// The samples between two epochs, integrated from the one and bent to meet the other: they differ
// by what the measurements did, a few micrometres after the smoother.
void AppendBetween(const RailSetup& setup,
                   const Knot& from,
                   const Knot& to,
                   std::span<const ImuSample> samples,
                   std::vector<RailPoint>* points) {
  const std::size_t first = points->size();
  Motion motion = from.state.motion;
  Strapdown strapdown;
  Timestamp now = from.at;
  const Eigen::Vector3d gravity = GravityInWorld(from.state, setup.gravity_m_s2);
  const auto step = [&](const ImuSample& sample, Timestamp end) {
    const double span_s = SecondsBetween(now, end);
    if (span_s <= 0.0) return;
    motion = Advanced(motion,
                      strapdown.Next(sample.gyro_rad_s - from.state.gyro_bias_rad_s,
                                     sample.accel_m_s2 - from.state.accel_bias_m_s2,
                                     span_s),
                      span_s,
                      gravity);
    now = end;
  };
  for (const ImuSample& sample : samples) {
    step(sample, std::min(sample.ends_at, to.at));
    if (sample.ends_at > to.at) break;
    points->push_back({.at = now,
                       .position_world_m = motion.position_world_m,
                       .world_from_imu = motion.world_from_imu});
  }
  const double whole_s = SecondsBetween(from.at, to.at);
  if (whole_s <= 0.0) return;
  const Eigen::Vector3d off_m = to.state.motion.position_world_m - motion.position_world_m;
  const Eigen::Vector3d turn_rad =
      LogRotation(motion.world_from_imu.conjugate() * to.state.motion.world_from_imu);
  for (std::size_t i = first; i < points->size(); ++i) {
    RailPoint& point = (*points)[i];
    const double part = SecondsBetween(from.at, point.at) / whole_s;
    point.position_world_m += part * off_m;
    point.world_from_imu = (point.world_from_imu * ExpRotation(part * turn_rad)).normalized();
    point.sigma_world_m = (1.0 - part) * from.sigma_m + part * to.sigma_m;
  }
}

// Summing up every sample would add up their noise; so it is measured between epochs, and not at
// all where the trolley stands.
void FillDistance(const std::vector<Knot>& knots, std::vector<RailPoint>* points) {
  double before_m = 0.0;
  std::size_t i = 0;
  for (std::size_t k = 1; k < knots.size(); ++k) {
    const Knot& from = knots[k - 1];
    const Knot& to = knots[k];
    const double span_s = SecondsBetween(from.at, to.at);
    if (span_s <= 0.0) continue;
    const double chord_m =
        (to.state.motion.position_world_m - from.state.motion.position_world_m).norm();
    const double step_m = chord_m > kStill_m_s * span_s ? chord_m : 0.0;
    for (; i < points->size() && (*points)[i].at <= to.at; ++i) {
      (*points)[i].distance_m =
          before_m + step_m * SecondsBetween(from.at, (*points)[i].at) / span_s;
    }
    before_m += step_m;
  }
  for (; i < points->size(); ++i) (*points)[i].distance_m = before_m;
}

void FillStatus(const std::vector<Timestamp>& fixes,
                const std::vector<RestSpan>& gaps,
                RailMethod method,
                std::vector<RailPoint>* points) {
  for (RailPoint& point : *points) {
    const auto after = std::lower_bound(fixes.begin(), fixes.end(), point.at);
    const bool has_after = after != fixes.end() && method == RailMethod::kSmoothed;
    const bool has_before = after != fixes.begin() || (after != fixes.end() && *after == point.at);
    const Timestamp before =
        has_before ? (after != fixes.end() && *after == point.at ? *after : *(after - 1))
                   : point.at;
    const bool near_before = has_before && SecondsBetween(before, point.at) <= kHeld_s;
    const bool near_after = has_after && SecondsBetween(point.at, *after) <= kHeld_s;
    if (near_before && (near_after || method == RailMethod::kFilter)) {
      point.status = RailStatus::kFixed;
    } else if (has_before && has_after) {
      point.status = RailStatus::kBridged;
    } else {
      point.status = RailStatus::kOpen;
    }
    for (const RestSpan& gap : gaps) {
      if (gap.begins_at < point.at && point.at <= gap.ends_at) point.status = RailStatus::kGap;
    }
  }
}

void FillEstimates(const FusionEpoch& last, const Prior& prior, RailLine* line) {
  const auto add = [&](std::string what, int row, double value, std::string_view motion) {
    const double sigma = std::sqrt(last.covariance(row, row));
    const double sigma_before = std::sqrt(prior.covariance(row, row));
    const bool is_told = sigma < kToldNothing * sigma_before;
    line->estimates.push_back(
        {std::move(what), value, sigma, sigma_before, is_told ? "" : std::string(motion)});
  };
  constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};
  const FusionState& state = last.state;
  for (int i = 0; i < 3; ++i) {
    add(std::string("gyro_bias_") + kAxes[static_cast<std::size_t>(i)] + "_rad_s",
        FusionLayout::kGyroBias + i,
        state.gyro_bias_rad_s[i],
        "rest of some seconds");
  }
  for (int i = 0; i < 3; ++i) {
    add(std::string("accel_bias_") + kAxes[static_cast<std::size_t>(i)] + "_m_s2",
        FusionLayout::kAccelBias + i,
        state.accel_bias_m_s2[i],
        "rest, or targets, at two cants or gradients");
  }
  const FusionLayout& layout = prior.layout;
  if (layout.Has(FusionOption::kTimeOffset)) {
    add("camera_time_offset_s",
        layout.At(FusionOption::kTimeOffset),
        state.time_offset_s,
        "motion while targets are seen");
  }
  if (layout.Has(FusionOption::kCameraRotation)) {
    const Eigen::Vector3d turn_rad =
        LogRotation(state.camera_from_imu * prior.state.camera_from_imu.conjugate());
    for (int i = 0; i < 3; ++i) {
      add(std::string("camera_rotation_") + kAxes[static_cast<std::size_t>(i)] + "_rad",
          layout.At(FusionOption::kCameraRotation) + i,
          turn_rad[i],
          "motion along the axis of view, with targets in depth");
    }
  }
  if (layout.Has(FusionOption::kCameraPosition)) {
    for (int i = 0; i < 3; ++i) {
      add(std::string("camera_position_") + kAxes[static_cast<std::size_t>(i)] + "_m",
          layout.At(FusionOption::kCameraPosition) + i,
          state.camera_in_imu_m[i],
          "turning about two axes while targets are seen");
    }
  }
  if (layout.Has(FusionOption::kOdometerScale)) {
    add("odometer_scale",
        layout.At(FusionOption::kOdometerScale),
        state.odometer_scale,
        "a stretch between targets, or between places that are known");
  }
}

std::vector<TargetView> ViewsOf(const std::vector<Knot>& knots, const RailRecording& recording) {
  std::vector<TargetView> views;
  for (const TargetImage& image : recording.images) {
    const auto knot = std::lower_bound(
        knots.begin(), knots.end(), image.stamped_at, [](const Knot& k, Timestamp at) {
          return k.at < at;
        });
    if (knot == knots.end() || knot->at != image.stamped_at) continue;
    const FusionState& state = knot->state;
    const Rigid3 world_from_imu{state.motion.world_from_imu, state.motion.position_world_m};
    const Rigid3 camera_from_imu{state.camera_from_imu,
                                 state.camera_from_imu * -state.camera_in_imu_m};
    TargetView view{camera_from_imu * Inverse(world_from_imu), {}};
    for (const TargetPixel& pixel : image.pixels) view.targets.push_back(pixel.target);
    views.push_back(std::move(view));
  }
  return views;
}

}  // namespace

std::string_view Word(RailStatus status) {
  switch (status) {
    case RailStatus::kFixed:
      return "fixed";
    case RailStatus::kBridged:
      return "bridged";
    case RailStatus::kOpen:
      return "open";
    case RailStatus::kGap:
      return "gap";
  }
  return "";
}

Result<RailLine, RailStartFailure> SolveRailLine(const RailSetup& setup,
                                                 const RailRecording& recording,
                                                 RailMethod method) {
  const auto rest = FindRestSignature(setup, recording);
  if (!rest) return Failure{rest.error()};
  const auto attitude = FindStartAttitude(setup, recording, *rest);
  if (!attitude) return Failure{attitude.error()};
  const std::vector<RestSpan> rests = FindQuietSpans(setup, recording, *rest);

  std::vector<SurveyedTarget> targets = recording.targets;
  TargetModes modes;
  if (setup.camera && !recording.images.empty()) {
    RailLine ignored;
    Run first(setup, recording, targets, rests, MakePrior(setup, *attitude, 0));
    first.Go(&ignored);
    const auto views = ViewsOf(KnotsOf(first.smoother(), RailMethod::kSmoothed), recording);
    modes = FindTargetModes(
        views, setup.camera->model, setup.camera->residual_px, FusionLayout::kMostModes, &targets);
  }
  RailLine line;
  line.target_modes = static_cast<std::size_t>(modes.count);
  line.target_modes_left_out_m = modes.left_out_m;
  const Prior prior = MakePrior(setup, *attitude, modes.count);
  Run run(setup, recording, targets, rests, prior);
  run.Go(&line);
  const std::vector<Knot> knots = KnotsOf(run.smoother(), method);

  line.points.reserve(recording.imu.size());
  std::size_t at = 0;
  for (std::size_t k = 1; k < knots.size(); ++k) {
    const std::size_t begin = at;
    while (at < recording.imu.size() && recording.imu[at].ends_at <= knots[k].at) ++at;
    const std::size_t end = std::min(at + 1, recording.imu.size());
    AppendBetween(setup,
                  knots[k - 1],
                  knots[k],
                  std::span(recording.imu).subspan(begin, end - begin),
                  &line.points);
  }
  // What the states do not hold of the survey's errors is the same all along the line.
  for (RailPoint& point : line.points) {
    point.sigma_world_m =
        (point.sigma_world_m.cwiseAbs2().array() + modes.left_out_m * modes.left_out_m)
            .sqrt()
            .matrix();
  }
  FillDistance(knots, &line.points);
  FillStatus(run.fixes(), run.gaps(), method, &line.points);
  FillEstimates(run.smoother().Filtered(run.smoother().size() - 1), prior, &line);
  return line;
}

}  // namespace tbm
