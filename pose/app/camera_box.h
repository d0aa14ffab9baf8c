#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "devices/camera/camera.h"
#include "devices/camera/exposure_control.h"
#include "devices/inclinometer/inclinometer.h"
#include "idl/cpp/alarm.h"
#include "pose/app/box_config.h"
#include "pose/app/box_messages.h"
#include "pose/app/frame_mailbox.h"
#include "pose/app/health_watch.h"
#include "pose/app/loop_beats.h"
#include "pose/app/recorder.h"
#include "pose/app/tilt_inbox.h"
#include "pose/base/clock.h"
#include "pose/frame/frame_solver.h"

namespace tbm {

// What the box is made of. Constructed by main (or by a test, with devices of its own).
struct BoxParts {
  std::unique_ptr<Camera> camera;                     // none with camera.driver replay
  std::unique_ptr<Inclinometer> target_inclinometer;  // none with camera.driver replay
  std::unique_ptr<Inclinometer> camera_inclinometer;
  std::unique_ptr<Recorder> recorder;  // none: nothing is recorded
};

// The camera box: grabs, finds, assigns, solves, publishes, records.
//
// Threads: grabber (camera), one per inclinometer, solver, health; the recorder has its own.
// Between them are bounded queues in which the newest wins and drops are counted. The solver's path
// touches no heap after warm-up.
class CameraBox {
 public:
  // Clock and sink outlive the box. `on_result` (may be empty) sees each result in the solver's
  // thread.
  CameraBox(const BoxConfig& config,
            const Rig& rig,
            std::string rig_hash,
            BoxParts parts,
            const Clock& clock,
            MessageSink& sink,
            std::function<void(const FrameResult&)> on_result = {});

  // Runs until `stop` is asked for, or a replay has ended. Ends clean: threads joined, recording
  // closed. `on_alive` (may be empty) is called about ten times a second by the health thread, as
  // long as no loop of the box hangs.
  void Run(std::stop_token stop, const std::function<void()>& on_alive = {});

  // Any thread; of devices that the box has.
  CameraHealth camera_health() const { return parts_.camera->Health(); }
  InclinometerHealth inclinometer_health(TiltSensor sensor) const {
    return (sensor == TiltSensor::kTarget ? parts_.target_inclinometer : parts_.camera_inclinometer)
        ->Health();
  }

  // From DDS threads: goes out as an event by the health thread.
  void Report(const dds::Alarm& alarm);

 private:
  void Grab(const std::stop_token& stop);
  void ReadTilts(TiltSensor sensor, Inclinometer& inclinometer, const std::stop_token& stop);
  void SolveLive(const std::stop_token& stop);
  void SolveReplay(const std::stop_token& stop);
  void WatchHealth(const std::stop_token& stop, const std::function<void()>& on_alive);
  void WatchClock();

  void SolveFrame(const OwnedFrame& frame, PoseReason image_fault);
  void BeginRecordingIfDue();
  void PublishTilt(TiltSensor sensor, const Result<TiltSample, InclinometerFailure>& sample);
  void ReportMounting(const FrameResult& result);
  void PublishResult(const OwnedFrame& frame, const FrameResult& result);
  void ControlExposure(const OwnedFrame& frame, const FrameResult& result);
  FrameCounts Counts() const;

  const BoxConfig config_;
  const std::string rig_hash_;
  BoxParts parts_;
  const Clock& clock_;
  MessageSink& sink_;
  const std::function<void(const FrameResult&)> on_result_;

  FrameMailbox mailbox_;
  TiltInbox tilt_inbox_;
  HealthWatch health_;
  LoopBeats beats_;
  Duration civil_ahead_{};  // the health thread's, see WatchClock

  // The solver thread's.
  FrameSolver solver_;
  TiltInbox::Readings readings_;
  ExposureControl exposure_control_;
  std::uint64_t pose_number_ = 0;
  bool mounting_alarm_ = false;

  std::array<std::uint64_t, 2> tilt_number_{};  // each inclinometer thread's own
  std::mutex tilt_publish_mutex_;               // one type, one writer at a time
};

}  // namespace tbm
