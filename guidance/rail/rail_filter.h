#pragma once

#include <array>
#include <cmath>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "guidance/fusion/fusion_filter.h"
#include "guidance/fusion/fusion_smoother.h"
#include "guidance/rail/quiet_watch.h"
#include "guidance/rail/rail_recording.h"
#include "guidance/rail/rail_start.h"

namespace tbm {

// Targets, or rest, hold the place for so long before and after.
inline constexpr double kHeld_s = 1.0;
// Slower is standing still.
inline constexpr double kStill_m_s = 0.003;

// All measurements of a kind together.
struct RailConsistency {
  std::size_t given = 0;
  std::size_t accepted = 0;
  double nis = 0.0;  // sum over the accepted
  double dof = 0.0;
  std::optional<Timestamp> last_accepted_at;
};

struct RailRejection {
  Timestamp at;
  std::string what;     // target, or kind of the measurement
  std::string why_not;  // code
};

// State and covariance from which a run is filtered.
struct RailPrior {
  FusionLayout layout;
  FusionState state;
  FusionMatrix covariance;
};

// `modes`: of the survey's errors, FindTargetModes.
RailPrior MakeRailPrior(const RailSetup& setup,
                        const Eigen::Quaterniond& world_from_imu,
                        int modes);

// Two readings of a wheel. Between them it has run with its mean speed, as it had it half way.
struct OdometerSpan {
  OdometerReading from;
  OdometerReading to;  // later

  Timestamp Middle() const {
    return from.sensed_at + Duration((to.sensed_at - from.sensed_at).count() / 2);
  }
};

// When the first interval of a run began.
inline Timestamp BeginOfRun(const ImuSample& first) {
  return first.ends_at - Duration(std::llround(first.interval_s * 1e9));
}

// Integrates a sample up to `to` from where the filter stands; where it stands for missing ones,
// with what may have happened in `gap_s`.
void FeedUpTo(
    FusionFilter& filter, const RailSetup& setup, ImuSample sample, Timestamp to, double gap_s);

// Filters a run from its first sample on, as it comes (docs/filter.md). The line of a recording and
// the trolley that is followed live go through this one. Pure; one caller.
class RailFilter {
 public:
  // What is referred to stays where it is. `rests`: spans in which the samples show rest, may be
  // added to on the way. `smoother`: remembers all epochs; null where nobody smooths.
  RailFilter(const RailSetup& setup,
             const std::vector<SurveyedTarget>& targets,
             const std::vector<RestSpan>& rests,
             const RailPrior& prior,
             Timestamp begin,
             FusionSmoother* smoother);

  // Each kind in the order of time, and before the sample in whose interval it was sensed.
  void Add(const TrolleyTilt& tilt) { tilts_.push_back(tilt); }
  void Add(const TargetImage& image) { images_.push_back(image); }
  void Add(const OdometerSpan& span) { wheels_.push_back(span); }
  // Without a camera for them in the set-up they are of no use.
  void Add(const GroundDisplacement& ground) {
    if (setup_.ground) grounds_.push_back(ground);
  }

  // The next sample, in the order of time.
  void Feed(const ImuSample& sample);

  // After the last sample: what is left is of no use.
  void Finish();

  const FusionFilter& filter() const { return *filter_; }
  // Where the covariance was brought to and measurements were taken.
  std::optional<Timestamp> last_epoch() const { return last_epoch_; }
  bool rests() const { return rests_now_; }  // since the last epoch
  // Where the unit had come to at the last epoch, before anything was measured there.
  const Motion& arrived() const { return arrived_; }

  // Spans without samples, in the order of time.
  const std::vector<RestSpan>& gaps() const { return gaps_; }
  // When the position was held by something outside of the unit, in the order of time: by targets,
  // and by rest at a place that was held when the rest began.
  const std::vector<Timestamp>& fixes() const { return fixes_; }
  const std::array<RailConsistency, kFusionUpdates>& consistency() const { return consistency_; }
  // Since they were taken last.
  std::vector<RailRejection> TakeRejections();

 private:
  Timestamp NextStamp() const;
  void Advance(const ImuSample& sample, Timestamp to);
  bool SaysRest(Timestamp at) const;
  bool IsHeld(Timestamp at) const;
  void Hold(ImuSample sample, Timestamp to);
  void IntegrateHeld();
  bool TakeRest();
  void EndEpoch();
  void TakeImage(const TargetImage& image);
  void TakeWheel(const OdometerSpan& span);
  void CorrectGroundFrom();
  void TakeGrounds();
  void Outside(Timestamp at, FusionUpdate update);
  void Count(const FusionVerdict& verdict);

  const RailSetup& setup_;
  const std::vector<SurveyedTarget>& targets_;
  const std::vector<RestSpan>& rests_;
  const Timestamp begin_;
  std::optional<FusionFilter> filter_;  // always there; an optional can be set back
  std::vector<ImuSample> held_;         // since the last epoch, as rest; that may still prove wrong
  std::optional<FusionFilter> before_held_;
  FusionFilter::Held fed_;  // sums of what was integrated since the last epoch
  FusionSmoother* const smoother_;
  std::optional<Timestamp> last_epoch_;
  bool rests_now_ = false;
  Motion arrived_;
  double gap_s_ = 0.0;             // that the present sample stands for; 0: it is one like all
  bool in_gap_ = false;            // the filter stands where no samples told how it came there
  std::deque<TrolleyTilt> tilts_;  // not taken yet
  std::deque<TargetImage> images_;
  std::deque<OdometerSpan> wheels_;
  std::deque<GroundDisplacement> grounds_;
  // Where the first of them began, once that is past, and when.
  std::optional<Motion> ground_from_;
  Timestamp ground_from_at_;
  std::vector<RestSpan> gaps_;
  std::vector<Timestamp> fixes_;
  std::array<RailConsistency, kFusionUpdates> consistency_;
  std::vector<RailRejection> rejections_;
};

}  // namespace tbm
