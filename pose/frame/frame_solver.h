#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "pose/base/pose_reason.h"
#include "pose/base/time.h"
#include "pose/centres/assign_leds.h"
#include "pose/centres/find_centres.h"
#include "pose/centres/image_view.h"
#include "pose/frame/tilt_history.h"
#include "pose/rig/rig.h"
#include "pose/solve/integrity.h"
#include "pose/solve/problem.h"
#include "pose/solve/tilt_monitor.h"

namespace tbm {

// One exposure as it reaches the solver: an image, or the reason why there is none.
struct FrameInput {
  Timestamp sensed_at;  // middle of the exposure
  ImageView image;
  PoseReason image_fault = PoseReason::kNone;  // kFrameMissing, kFrameUnreadable, kFrameSize
};

// What the inclinometers gave for a frame: a tilt, or why not.
struct FrameTilt {
  std::optional<TiltObservation> observation;
  PoseReason fault = PoseReason::kNone;
};

// All that was concluded from one exposure, also "no pose because". Sinks (CSV, DDS, console) only
// translate it.
struct FrameResult {
  Timestamp sensed_at;
  PoseStatus status = PoseStatus::kNone;
  PoseReason reason = PoseReason::kNone;
  ImageLevels levels;
  Centres centres;                                       // brightest first; empty without an image
  std::array<std::int8_t, kMaxCentres> led_of_centre{};  // rig LED index, -1: belongs to none
  FrameTilt target_tilt;
  FrameTilt camera_tilt;
  std::optional<TiltSensor> tilt_suspect;  // with kTiltDisagrees: whose reading jumped
  std::optional<CheckedPose> pose;         // present unless status is none
  PointResults points;                     // rig points in the rig's order; empty without a pose
  TiltMonitorReport mounting;              // image against inclinometers over many frames
};

struct FrameSolverOptions {
  PoseMethod method = PoseMethod::kFused;
  // How fast the front shield may move against the rear one, one sigma. Far above any TBM's advance
  // (2 mm/s), because a prior that is too sure is worse than none.
  double motion_sigma_m_per_s = 0.4;
  double motion_sigma_rad_per_s = 0.05;
  // An accepted pose older than this no longer helps.
  Duration prior_max_age = std::chrono::seconds(5);
  AssignOptions assign;
  SolveOptions solve;
  IntegrityOptions integrity;
  TiltHistoryOptions tilt;
  TiltMonitorOptions monitor;
};

// From exposures and tilt readings to poses, one frame at a time: find, assign, solve, check. Holds
// the work space and the last accepted pose; no allocation after the first frame. The same inputs
// in the same order give the same bits. One object per thread.
class FrameSolver {
 public:
  // Eq. 18 needs Ceres, which the camera box does not carry; who wants PoseMethod::kPublished hands
  // in SolvePublished of pose/solve/penalty_pose.h.
  using PublishedSolver = PoseResult (*)(const PoseProblem&,
                                         const std::optional<Rigid3>& start,
                                         const SolveOptions&);

  explicit FrameSolver(const Rig& rig,
                       const FrameSolverOptions& options = {},
                       PublishedSolver published = nullptr);

  // Every reading that is known before a frame is solved comes first.
  void AddTilt(const TiltReading& reading);

  // The result stays valid until the next call.
  const FrameResult& Solve(const FrameInput& frame);

  // Makes this the point where a recording begins: gives what later frames depend on as text that
  // survives a file without losing a bit, and forgets what is not in it (the mounting monitor's
  // window, not its baseline). A solver that restores the text and gets the readings of both
  // histories and all that comes later gives the same bits.
  std::string BeginRecord();
  // False (and nothing changed) when `state` was not written by BeginRecord.
  bool RestoreState(const std::string& state);

  const Rig& rig() const { return rig_; }
  const TiltHistory& tilt_history(TiltSensor sensor) const {
    return sensor == TiltSensor::kTarget ? target_history_ : camera_history_;
  }

 private:
  struct AcceptedPose {
    Timestamp sensed_at;
    Rigid3 camera_from_target;
    PoseCovariance covariance = PoseCovariance::Zero();
    Inclination target_tilt;  // of the latest pose that used the tilts
    Inclination camera_tilt;
  };

  void SolveInto(const FrameInput& frame, FrameResult& result);
  Result<Assignment, AssignFailure> Assign(const FrameResult& result,
                                           const std::optional<PosePrior>& prior) const;
  void SolveAssigned(const Assignment& assignment,
                     const std::optional<PosePrior>& prior,
                     FrameResult& result);
  Result<CheckedPose, PoseReason> PublishedInstead(const PoseProblem& problem,
                                                   const CheckedPose& checked) const;
  void NameTiltFault(FrameResult& result) const;
  void WatchMountings(const PoseProblem& problem, FrameResult& result);
  void Accept(const FrameResult& result);
  std::optional<PosePrior> PriorAt(Timestamp at) const;
  std::optional<TiltSensor> SuspectTilt(const FrameResult& result) const;
  FrameTilt TiltAt(const TiltHistory& history, const TiltMount& mount, Timestamp at) const;

  const Rig rig_;
  FrameSolverOptions options_;
  PublishedSolver published_;
  CentreFinder finder_;
  TiltHistory target_history_;
  TiltHistory camera_history_;
  std::optional<Timestamp> last_sensed_at_;
  std::optional<AcceptedPose> accepted_;
  TiltMonitor monitor_;
  bool mounting_moved_ = false;
  FrameResult result_;
};

}  // namespace tbm
