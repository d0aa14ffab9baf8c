#include "guidance/rail/rail_line.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "guidance/fusion/fusion_smoother.h"
#include "guidance/fusion/target_modes.h"
#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

// The state is no better for it than it was.
constexpr double kToldNothing = 0.9;
constexpr std::string_view kStretch = "a stretch between targets, or between places that are known";

// Filters a recording once, from its first sample to its last.
class Run {
 public:
  Run(const RailSetup& setup,
      const RailRecording& recording,
      const std::vector<SurveyedTarget>& targets,
      const std::vector<RestSpan>& rests,
      const RailPrior& prior)
      : smoother_(prior.layout),
        filter_(setup, targets, rests, prior, BeginOfRun(recording.imu.front()), &smoother_) {
    for (const TrolleyTilt& tilt : recording.tilts) filter_.Add(tilt);
    for (const TargetImage& image : recording.images) filter_.Add(image);
    for (std::size_t i = 1; i < recording.odometer.size(); ++i) {
      filter_.Add(OdometerSpan{recording.odometer[i - 1], recording.odometer[i]});
    }
    for (const GroundDisplacement& ground : recording.grounds) filter_.Add(ground);
    for (const ImuSample& sample : recording.imu) filter_.Feed(sample);
    filter_.Finish();
  }
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  const FusionSmoother& smoother() const { return smoother_; }
  RailFilter& filter() { return filter_; }

 private:
  FusionSmoother smoother_;
  RailFilter filter_;
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

void FillEstimates(const FusionEpoch& last, const RailPrior& prior, RailLine* line) {
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
  if (layout.Has(FusionOption::kTiltOffset)) {
    constexpr std::array<const char*, 2> kAngles = {"tilt_offset_beta_rad",
                                                    "tilt_offset_gamma_rad"};
    for (int i = 0; i < 2; ++i) {
      add(kAngles[static_cast<std::size_t>(i)],
          layout.At(FusionOption::kTiltOffset) + i,
          state.tilt_offset_rad[i],
          "rest at two cants or gradients, turned end for end");
    }
  }
  if (layout.Has(FusionOption::kOdometerScale)) {
    add("odometer_scale", layout.At(FusionOption::kOdometerScale), state.odometer_scale, kStretch);
    for (int i = 0; i < 2; ++i) {
      add(std::string("odometer_turn_") + kAxes[static_cast<std::size_t>(i + 1)] + "_rad",
          layout.At(FusionOption::kOdometerTurn) + i,
          state.odometer_turn_rad[i],
          kStretch);
    }
  }
  if (layout.Has(FusionOption::kImageScale)) {
    add("ground_height_scale", layout.At(FusionOption::kImageScale), state.image_scale, kStretch);
    add("ground_turn_z_rad", layout.At(FusionOption::kImageTurn), state.image_turn_rad, kStretch);
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
  if (const auto too_fast = FindTurnsTooFast(setup, recording, *rest)) return Failure{*too_fast};
  const std::vector<RestSpan> rests = FindQuietSpans(setup, recording, *rest);

  std::vector<SurveyedTarget> targets = recording.targets;
  TargetModes modes;
  if (setup.camera && !recording.images.empty()) {
    const Run first(setup, recording, targets, rests, MakeRailPrior(setup, *attitude, 0));
    const auto views = ViewsOf(KnotsOf(first.smoother(), RailMethod::kSmoothed), recording);
    modes = FindTargetModes(
        views, setup.camera->model, setup.camera->residual_px, FusionLayout::kMostModes, &targets);
  }
  RailLine line;
  line.target_modes = static_cast<std::size_t>(modes.count);
  line.target_modes_left_out_m = modes.left_out_m.maxCoeff();
  const RailPrior prior = MakeRailPrior(setup, *attitude, modes.count);
  Run run(setup, recording, targets, rests, prior);
  line.consistency = run.filter().consistency();
  line.rejections = run.filter().TakeRejections();
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
        (point.sigma_world_m.cwiseAbs2() + modes.left_out_m.cwiseAbs2()).cwiseSqrt();
  }
  FillDistance(knots, &line.points);
  FillStatus(run.filter().fixes(), run.filter().gaps(), method, &line.points);
  FillEstimates(run.smoother().Filtered(run.smoother().size() - 1), prior, &line);
  return line;
}

}  // namespace tbm
