#include "guidance/rail_vision/target_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

// Images of the rest that may tell the heading: more would not tell more.
constexpr std::size_t kStartFrames = 5;
constexpr double kGapPeriods = 1.5;

class TargetSearch {
 public:
  TargetSearch(const RailSetup& setup,
               const RailRecording& recording,
               const std::vector<std::optional<TargetMark>>& marks,
               const RailFrames& frames)
      : setup_(setup), recording_(recording), frames_(frames) {
    for (std::size_t i = 0; i < marks.size(); ++i) {
      if (!marks[i]) continue;
      looked_for_.push_back(static_cast<int>(i));
      sought_.push_back({*marks[i], recording.targets[i].in_world_m, recording.targets[i].sigma_m});
      surveyed_.push_back(recording.targets[i]);
    }
  }

  Result<std::vector<FrameOutcome>, SearchFailure> Go(
      const std::function<void(const FrameOutcome&)>& on_frame) {
    const auto rest = FindRestSignature(setup_, recording_);
    if (!rest) return Failure{SearchFailure{SearchFault::kStart, rest.error()}};
    RailRecording start = recording_;
    start.images.clear();
    if (!setup_.start.heading_rad) {
      start.images = FindWithoutExpectation(*rest);
      if (start.images.empty()) return Failure{SearchFailure{SearchFault::kNoHeading, {}}};
    }
    const auto attitude = FindStartAttitude(setup_, start, *rest);
    if (!attitude) return Failure{SearchFailure{SearchFault::kStart, attitude.error()}};
    return Follow(*attitude, FindQuietSpans(setup_, recording_, *rest), on_frame);
  }

 private:
  ImageView Load(std::size_t frame) const {
    const ImageView image = frames_.load(frame);
    const CameraModel& camera = setup_.camera->model;
    const bool is_right = image.pixels != nullptr && image.width_px == camera.image_width_px &&
                          image.height_px == camera.image_height_px;
    return is_right ? image : ImageView{};
  }

  TargetImage ImageOf(Timestamp stamped_at, const TargetsInImage& found) const {
    TargetImage image{stamped_at, {}};
    for (const TargetSeen& one : found.seen) {
      image.pixels.push_back({looked_for_[one.target], one.pixel_px, one.sigma_px});
    }
    return image;
  }

  // While it rests: only level is known, by which a board's upper side is.
  std::vector<TargetImage> FindWithoutExpectation(const RestSignature& rest) {
    const Timestamp begin = BeginOfRun(recording_.imu.front());
    const Eigen::Vector3d up_in_camera =
        setup_.camera->camera_from_imu * rest.mean_accel_m_s2.normalized();
    std::vector<TargetImage> images;
    for (std::size_t i = 0; i < frames_.stamped_at.size() && images.size() < kStartFrames; ++i) {
      const double at_s = SecondsBetween(begin, frames_.stamped_at[i]);
      if (at_s < 0.0 || at_s > setup_.start.at_rest_s) continue;
      const TargetsInImage found =
          finder_.Find(Load(i), setup_.camera->model, sought_, {{}, up_in_camera});
      if (!found.seen.empty()) images.push_back(ImageOf(frames_.stamped_at[i], found));
    }
    return images;
  }

  std::vector<FrameOutcome> Follow(const Eigen::Quaterniond& world_from_imu,
                                   const std::vector<RestSpan>& rests,
                                   const std::function<void(const FrameOutcome&)>& on_frame) {
    const Timestamp begin = BeginOfRun(recording_.imu.front());
    RailFilter filter(setup_,
                      recording_.targets,
                      rests,
                      MakeRailPrior(setup_, world_from_imu, 0),
                      begin,
                      nullptr);
    for (const TrolleyTilt& tilt : recording_.tilts) filter.Add(tilt);
    for (std::size_t i = 1; i < recording_.odometer.size(); ++i) {
      filter.Add(OdometerSpan{recording_.odometer[i - 1], recording_.odometer[i]});
    }
    std::vector<FrameOutcome> outcomes;
    const auto tell = [&](FrameOutcome outcome) {
      outcomes.push_back(std::move(outcome));
      if (on_frame) on_frame(outcomes.back());
    };
    std::size_t frame = 0;
    Timestamp now = begin;
    for (; frame < frames_.stamped_at.size() && frames_.stamped_at[frame] < begin; ++frame) {
      tell({frames_.stamped_at[frame], false, false, {}});
    }
    for (const ImuSample& sample : recording_.imu) {
      for (; frame < frames_.stamped_at.size() && frames_.stamped_at[frame] <= sample.ends_at;
           ++frame) {
        const Timestamp at = frames_.stamped_at[frame];
        if (IsGap(now, sample)) {
          tell({at, false, false, {}});
          continue;
        }
        // The part of the sample before the image; the filter takes the rest of it later.
        if (at > now) filter.Feed(Part(sample, now, at));
        now = at;
        tell(Look(frame, &filter));
      }
      if (sample.ends_at > now) filter.Feed(Part(sample, now, sample.ends_at));
      now = sample.ends_at;
    }
    for (; frame < frames_.stamped_at.size(); ++frame) {
      tell({frames_.stamped_at[frame], false, false, {}});
    }
    return outcomes;
  }

  // Samples are missing: where the trolley was meanwhile nobody knows.
  bool IsGap(Timestamp now, const ImuSample& sample) const {
    return SecondsBetween(now, sample.ends_at) > kGapPeriods / setup_.imu.rate_hz;
  }

  static ImuSample Part(const ImuSample& sample, Timestamp from, Timestamp to) {
    ImuSample part = sample;
    part.interval_s = SecondsBetween(from, to);
    part.ends_at = to;
    return part;
  }

  FrameOutcome Look(std::size_t frame, RailFilter* filter) {
    FrameOutcome outcome{frames_.stamped_at[frame], false, true, {}};
    const ImageView image = Load(frame);
    outcome.is_readable = image.pixels != nullptr;
    if (!outcome.is_readable) return outcome;
    FusionFilter now = filter->filter();
    now.BringForward();
    TargetsAhead ahead;
    ahead.expected = ExpectImage(now, setup_.camera->model, surveyed_);
    outcome.targets = finder_.Find(image, setup_.camera->model, sought_, ahead);
    filter->Add(ImageOf(outcome.stamped_at, outcome.targets));
    for (TargetSeen& one : outcome.targets.seen) {
      one.target = static_cast<std::size_t>(looked_for_[one.target]);
    }
    for (TargetNotSeen& one : outcome.targets.refused) {
      one.target = static_cast<std::size_t>(looked_for_[one.target]);
    }
    return outcome;
  }

  const RailSetup& setup_;
  const RailRecording& recording_;
  const RailFrames& frames_;
  std::vector<int> looked_for_;  // of the recording's targets
  std::vector<SoughtTarget> sought_;
  std::vector<SurveyedTarget> surveyed_;
  TargetFinder finder_;
};

}  // namespace

ExpectedImage ExpectImage(const FusionFilter& filter,
                          const CameraModel& camera,
                          const std::vector<SurveyedTarget>& targets) {
  ExpectedImage expected;
  expected.covariance = filter.covariance();
  expected.focal_px = camera.fx_px;
  for (const SurveyedTarget& target : targets) {
    const auto seen = PredictPixel(filter, camera, target);
    if (!seen) {
      expected.targets.emplace_back();
      continue;
    }
    ExpectedPixel pixel;
    pixel.pixel_px = seen->pixel_px;
    pixel.by_state = seen->by_error;
    // Across the line of sight both columns of the derivative count, along it none.
    const double px_per_m = seen->by_target_px_per_m.norm() / std::sqrt(2.0);
    pixel.survey_sigma_px = px_per_m * target.sigma_m;
    pixel.px_per_m = px_per_m;
    expected.targets.push_back(std::move(pixel));
  }
  return expected;
}

Result<std::vector<FrameOutcome>, SearchFailure> SearchTargets(
    const RailSetup& setup,
    const RailRecording& recording,
    const std::vector<std::optional<TargetMark>>& marks,
    const RailFrames& frames,
    const std::function<void(const FrameOutcome&)>& on_frame) {
  return TargetSearch(setup, recording, marks, frames).Go(on_frame);
}

}  // namespace tbm
