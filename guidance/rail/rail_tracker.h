#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "guidance/rail/quiet_watch.h"
#include "guidance/rail/rail_filter.h"
#include "guidance/rail/rail_recording.h"
#include "guidance/rail/rail_start.h"

namespace tbm {

struct RailTrackerSettings {
  // How far the filter stays behind the newest sample. What is older when it arrives is lost, so it
  // covers how long a camera takes to find its targets. Below 0.5 s rests on the way are not
  // noticed in time: that is how long it takes to be sure of one.
  double lag_s = 0.6;  // >= 0
};

enum class RailTrackerPhase {
  kNoRun,           // nothing has come yet
  kWaitingForRest,  // the rest at the start is not over
  kStartFailed,     // and it was none, or does not tell how the unit stands: start_failure()
  kTracks,
};

enum class TrolleyHold {
  kFixed,  // targets, or rest, within the last second
  kOpen,   // by the unit alone: sigma grows
  kGap,    // samples were missing since it was last held
};

// Where the trolley is at the newest sample.
struct TrolleyPlace {
  Timestamp at;
  TrolleyHold hold = TrolleyHold::kOpen;
  Motion motion;
  // With what the survey of the targets seen last may be wrong; velocity and attitude are without.
  Eigen::Vector3d sigma_position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma_velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma_attitude_rad = Eigen::Vector3d::Zero();  // axes of the unit
  Eigen::Vector3d gyro_bias_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma_gyro_bias_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias_m_s2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma_accel_bias_m_s2 = Eigen::Vector3d::Zero();
  double distance_m = 0.0;  // run since the start, along the line
  std::optional<double> target_age_s;
  std::optional<double> tilt_age_s;
  std::optional<double> rest_age_s;
};

// Follows a trolley while it runs. Measurements come later than the samples of the unit, so it
// filters a fixed lag behind and takes everything by its stamp, in whatever order it came; from
// there it goes on to the newest sample by the unit alone. Pure: time is what the stamps say, and
// the same inputs give the same numbers however they were delayed within the lag. Stays where it
// is.
class RailTracker {
 public:
  RailTracker(RailSetup setup,
              std::vector<SurveyedTarget> targets,
              const RailTrackerSettings& settings);

  RailTracker(const RailTracker&) = delete;
  RailTracker& operator=(const RailTracker&) = delete;

  void Add(const ImuSample& sample);  // in the order of time
  void Add(const TrolleyTilt& tilt);
  void Add(const TargetImage& image);
  void Add(const OdometerReading& reading);  // in the order of time

  RailTrackerPhase phase() const { return phase_; }
  const std::optional<RailStartFailure>& start_failure() const { return start_failure_; }
  // Empty unless it tracks.
  std::optional<TrolleyPlace> Place() const;

  std::uint64_t came_too_late() const { return came_too_late_; }  // of any kind
  std::uint64_t gaps() const { return filter_ ? filter_->gaps().size() : 0; }
  std::uint64_t rejections() const { return rejections_; }

 private:
  template <class Input>
  using Kept = std::multimap<Timestamp, Input>;  // by its stamp

  template <class Input>
  void Keep(Timestamp at, const Input& input, Kept<Input>* kept);
  template <class Input>
  void Pass(Timestamp up_to, Kept<Input>* kept);
  void Start();
  void Step();
  void Follow(const ImuSample& sample);
  void AddDistance();
  void WeighSurvey();
  TrolleyHold HoldAt(Timestamp at) const;

  const RailSetup setup_;
  const std::vector<SurveyedTarget> targets_;
  const Duration lag_;
  RailTrackerPhase phase_ = RailTrackerPhase::kNoRun;
  std::optional<RailStartFailure> start_failure_;

  // What the filter has not reached.
  std::deque<ImuSample> samples_;
  Kept<TrolleyTilt> tilts_;
  Kept<TargetImage> images_;
  Kept<OdometerSpan> wheels_;
  std::optional<OdometerReading> last_reading_;
  Timestamp newest_;  // of the samples
  Timestamp rest_ends_at_;

  std::optional<QuietWatch> quiet_;
  std::optional<RailFilter> filter_;
  std::optional<Timestamp> last_epoch_;
  Eigen::Vector3d at_last_epoch_m_ = Eigen::Vector3d::Zero();
  double distance_m_ = 0.0;
  std::optional<TargetImage> newest_image_;  // that the filter was given
  Eigen::Vector3d survey_sigma_m_ = Eigen::Vector3d::Zero();
  std::uint64_t came_too_late_ = 0;
  std::uint64_t rejections_ = 0;
};

}  // namespace tbm
