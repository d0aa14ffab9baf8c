#include "pose/app/camera_box.h"

#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include "devices/replay/run_reader.h"
#include "pose/base/angle.h"

namespace tbm {
namespace {

using std::chrono::milliseconds;

// How long a thread may sleep before it looks whether it should end.
constexpr milliseconds kLook(100);
// Longer than any loop may take: opening a camera waits for 3 s at worst.
constexpr milliseconds kHangs(10'000);
// What the clock has to move against the steady one before it is said. A time server steers more
// gently.
constexpr milliseconds kClockStep(20);

PoseReason ReasonOf(FrameFault fault) {
  switch (fault) {
    case FrameFault::kNone:
      return PoseReason::kNone;
    case FrameFault::kMissingPackets:
      return PoseReason::kFrameUnreadable;
    case FrameFault::kFileMissing:
      return PoseReason::kFrameMissing;
    case FrameFault::kFileUnreadable:
      return PoseReason::kFrameUnreadable;
    case FrameFault::kFileSize:
      return PoseReason::kFrameSize;
  }
  return PoseReason::kFrameUnreadable;
}

// Angles enter the box in whole 1e-7 degree, far below any instrument's last digit: a recording in
// degrees then gives back the very same bits.
double AsRecorded(double angle_rad) {
  return DegToRad(std::round(1e7 * RadToDeg(angle_rad)) / 1e7);
}

std::string_view WordOf(TiltSensor sensor) {
  return sensor == TiltSensor::kTarget ? "target" : "camera";
}

}  // namespace

CameraBox::CameraBox(const BoxConfig& config,
                     const Rig& rig,
                     std::string rig_hash,
                     BoxParts parts,
                     const Clock& clock,
                     MessageSink& sink,
                     std::function<void(const FrameResult&)> on_result)
    : config_(config),
      rig_hash_(std::move(rig_hash)),
      parts_(std::move(parts)),
      clock_(clock),
      sink_(sink),
      on_result_(std::move(on_result)),
      health_(config.machine_id, clock, sink),
      solver_(rig, config.solver),
      exposure_control_({config.camera.exposure_min_us, config.camera.exposure_max_us}) {}

void CameraBox::Run(std::stop_token stop, const std::function<void()>& on_alive) {
  std::stop_source health_stop;
  const std::stop_callback on_stop(stop, [&] { health_stop.request_stop(); });
  std::jthread health(
      [this, &on_alive, token = health_stop.get_token()] { WatchHealth(token, on_alive); });
  if (config_.camera.driver == CameraDriver::kReplay) {
    SolveReplay(stop);
  } else {
    std::jthread target([&] { ReadTilts(TiltSensor::kTarget, *parts_.target_inclinometer, stop); });
    std::jthread camera([&] { ReadTilts(TiltSensor::kCamera, *parts_.camera_inclinometer, stop); });
    std::jthread grabber([&] { Grab(stop); });
    SolveLive(stop);
  }
  health_stop.request_stop();
  health.join();
  parts_.recorder.reset();
}

void CameraBox::Report(const dds::Alarm& alarm) {
  if (!alarm.ChangesKind()) return;
  health_.Raise("dds",
                dds::AlarmCode(alarm.kind),
                dds::Severity::kAlarm,
                alarm.active,
                alarm.topic.empty() ? alarm.text : alarm.topic + ": " + alarm.text);
}

void CameraBox::Grab(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    beats_.Beat(LoopBeats::kGrabber, clock_.Steady());
    const auto frame = parts_.camera->WaitFrame(kLook);
    if (frame) {
      mailbox_.Put(*frame);
    } else if (frame.error() == CameraFailure::kEndOfRun ||
               frame.error() == CameraFailure::kBadRun) {
      break;
    }
  }
  beats_.End(LoopBeats::kGrabber);
  parts_.camera->Close();
}

void CameraBox::ReadTilts(TiltSensor sensor,
                          Inclinometer& inclinometer,
                          const std::stop_token& stop) {
  const auto loop = sensor == TiltSensor::kTarget ? LoopBeats::kTargetTilt : LoopBeats::kCameraTilt;
  while (!stop.stop_requested()) {
    beats_.Beat(loop, clock_.Steady());
    const auto sample = inclinometer.Read(clock_.Steady() + kLook);
    if (sample) {
      tilt_inbox_.Put({sample->sensed_at,
                       sensor,
                       {AsRecorded(sample->raw.beta_rad), AsRecorded(sample->raw.gamma_rad)}});
    } else if (sample.error() == InclinometerFailure::kNotFinite) {
      // A dead channel has its own reason in the pose, other than a tilt that merely gets old.
      tilt_inbox_.Put({clock_.Now(), sensor, {std::nan(""), std::nan("")}});
    }
    PublishTilt(sensor, sample);
  }
  beats_.End(loop);
}

void CameraBox::SolveLive(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    beats_.Beat(LoopBeats::kSolver, clock_.Steady());
    const OwnedFrame* frame = mailbox_.Take(kLook);
    BeginRecordingIfDue();
    // Without a frame the readings still have to be taken, or the inbox runs over.
    const Timestamp wanted = frame != nullptr ? frame->frame.sensed_at : Timestamp{};
    tilt_inbox_.TakeAll(wanted, config_.tilt_wait, &readings_);
    for (const TiltReading& reading : readings_) {
      solver_.AddTilt(reading);
      if (parts_.recorder) parts_.recorder->Add(reading);
    }
    if (frame != nullptr) SolveFrame(*frame, ReasonOf(frame->frame.fault));
  }
  beats_.End(LoopBeats::kSolver);
}

void CameraBox::SolveReplay(const std::stop_token& stop) {
  const auto run = ReadRun(config_.camera.run_folder);
  if (!run) {
    for (const auto& fault : run.error()) {
      health_.Raise("camera", "bad_run", dds::Severity::kAlarm, true, fault.Text());
    }
    return;
  }
  if (!run->solver_state.empty() && !solver_.RestoreState(run->solver_state)) {
    health_.Raise("camera",
                  "bad_run",
                  dds::Severity::kAlarm,
                  true,
                  "solver state of the recording is damaged; its first poses may differ");
  }
  TiltFeed tilts(*run);
  OwnedFrame owned;
  std::optional<Timestamp> begins_at;
  const auto began = clock_.Steady();
  for (std::size_t i = 0; i < run->frames.size() && !stop.stop_requested(); ++i) {
    const RecordedFrame& recorded = run->frames[i];
    if (!begins_at) begins_at = recorded.sensed_at;
    if (config_.camera.real_time) {
      const auto due = began + (recorded.sensed_at - *begins_at);
      while (clock_.Steady() < due && !stop.stop_requested()) {
        std::this_thread::sleep_for(std::min<Duration>(kLook, due - clock_.Steady()));
      }
    }
    for (const TiltReading& reading : tilts.Before(i)) solver_.AddTilt(reading);
    const ImageResult image = ReadFrame(*run, i);
    Frame frame;
    frame.sensed_at = recorded.sensed_at;
    frame.frame_number = i;
    frame.exposure_us = std::nan("");
    if (image) frame.image = image->View();
    owned.CopyFrom(frame);
    SolveFrame(owned, image ? PoseReason::kNone : ReasonOf(image.error().failure));
  }
}

void CameraBox::BeginRecordingIfDue() {
  if (!parts_.recorder || !parts_.recorder->WantsNewRun()) return;
  parts_.recorder->Begin(clock_.Now(), solver_.BeginRecord());
  for (const TiltSensor sensor : {TiltSensor::kTarget, TiltSensor::kCamera}) {
    for (const TiltHistory::Entry& entry : solver_.tilt_history(sensor).entries()) {
      parts_.recorder->Add({entry.sensed_at, sensor, entry.inclination});
    }
  }
}

void CameraBox::SolveFrame(const OwnedFrame& frame, PoseReason image_fault) {
  FrameInput input;
  input.sensed_at = frame.frame.sensed_at;
  input.image_fault = image_fault;
  if (input.image_fault == PoseReason::kNone) input.image = frame.frame.image;
  const FrameResult& result = solver_.Solve(input);
  health_.NotePose(result.status, result.reason);
  ReportMounting(result);
  PublishResult(frame, result);
  ControlExposure(frame, result);
  if (parts_.recorder) parts_.recorder->Add(frame, image_fault);
  if (on_result_) on_result_(result);
}

// Once when it is found, once when a full window says it is gone.
void CameraBox::ReportMounting(const FrameResult& result) {
  const bool moved = result.mounting.moved();
  if (moved == mounting_alarm_ || (!moved && !result.mounting.absolute)) return;
  mounting_alarm_ = moved;
  const auto& change = result.mounting.change;
  const auto& offset = change && change->moved ? change : result.mounting.absolute;
  health_.Raise("camera_box",
                "mounting_moved",
                dds::Severity::kAlarm,
                moved,
                fmt::format("an inclinometer's mounting {}: image and tilts differ by pitch {:.3f} "
                            "and roll {:.3f} degree",
                            moved ? "has moved" : "agrees again",
                            RadToDeg(offset->pitch_rad),
                            RadToDeg(offset->roll_rad)));
}

void CameraBox::PublishResult(const OwnedFrame& frame, const FrameResult& result) {
  dds::RelativePose pose;
  FillRelativePose(config_.machine_id, rig_hash_, solver_.rig(), result, &pose);
  pose.sample_number = ++pose_number_;
  pose.published_at = clock_.Now();
  sink_.Publish(pose);

  dds::FrameFeatures features = FeaturesOf(
      config_.machine_id, result, frame.frame.frame_number, frame.frame.exposure_us, Counts());
  features.published_at = clock_.Now();
  sink_.Publish(features);
}

void CameraBox::ControlExposure(const OwnedFrame& frame, const FrameResult& result) {
  if (!config_.exposure_control || !parts_.camera || !std::isfinite(frame.frame.exposure_us))
    return;
  FixedVector<LedLevel, kMaxLeds> levels;
  for (std::size_t i = 0; i < result.centres.size() && !levels.full(); ++i) {
    if (result.led_of_centre[i] < 0) continue;
    const Centre& centre = result.centres[i];
    levels.push_back({centre.peak_dn + centre.background_dn, centre.clipped_pixels > 0});
  }
  ExposureSample sample;
  sample.exposure_us = frame.frame.exposure_us;
  sample.full_scale_dn = frame.frame.image.max_value;
  sample.leds = {levels.data(), levels.size()};
  sample.is_saturated = result.reason == PoseReason::kFrameSaturated;
  if (const auto exposure_us = exposure_control_.Update(sample)) {
    parts_.camera->RequestExposure(*exposure_us);
  }
}

void CameraBox::PublishTilt(TiltSensor sensor,
                            const Result<TiltSample, InclinometerFailure>& sample) {
  if (!sample && sample.error() == InclinometerFailure::kNotDue) return;
  const Rig& rig = solver_.rig();
  const TiltMount& mount = sensor == TiltSensor::kTarget ? rig.target_tilt : rig.camera_tilt;
  dds::TiltReading message;
  message.machine_id = std::string_view(config_.machine_id);
  message.sensor = WordOf(sensor);
  message.published_at = clock_.Now();
  message.sample_number = ++tilt_number_[static_cast<std::size_t>(sensor)];
  if (sample) {
    message.sensed_at = sample->sensed_at;
    message.validity = dds::Validity::kValid;
    message.inclination = {sample->raw.beta_rad * mount.sign[0],
                           sample->raw.gamma_rad * mount.sign[1]};
    message.sigma_rad = mount.sigma_rad;
  } else {
    message.sensed_at = message.published_at;
    message.reason = FailureCode(sample.error());
  }
  const std::lock_guard lock(tilt_publish_mutex_);
  sink_.Publish(message);
}

FrameCounts CameraBox::Counts() const {
  FrameCounts counts;
  counts.skipped = mailbox_.dropped();
  if (!parts_.camera) {
    counts.received = pose_number_;
    return counts;
  }
  const CameraHealth health = parts_.camera->Health();
  counts.received = health.frames;
  counts.lost = health.lost;
  counts.damaged = health.incomplete;
  return counts;
}

// Stamps follow a clock that is set at once, and nothing in the box minds; whoever reads them wants
// to know.
void CameraBox::WatchClock() {
  const Duration ahead = CivilMinusSteady(clock_);
  const Duration step = ahead - civil_ahead_;
  civil_ahead_ = ahead;
  if (std::chrono::abs(step) < kClockStep) return;
  health_.Raise("camera_box",
                "clock_set",
                dds::Severity::kWarning,
                false,
                fmt::format("the clock of this computer was set {} by {:.3f} s",
                            step > Duration::zero() ? "forward" : "back",
                            std::abs(1e-9 * static_cast<double>(step.count()))));
}

void CameraBox::WatchHealth(const std::stop_token& stop, const std::function<void()>& on_alive) {
  civil_ahead_ = CivilMinusSteady(clock_);
  while (!stop.stop_requested()) {
    if (on_alive && beats_.AllWithin(kHangs, clock_.Steady())) on_alive();
    WatchClock();
    if (parts_.camera) health_.Update("camera", HealthOf(parts_.camera->Health()));
    if (parts_.target_inclinometer) {
      health_.Update("inclinometer_target", HealthOf(parts_.target_inclinometer->Health()));
    }
    if (parts_.camera_inclinometer) {
      health_.Update("inclinometer_camera", HealthOf(parts_.camera_inclinometer->Health()));
    }
    if (parts_.recorder) health_.Update("recorder", HealthOf(parts_.recorder->status()));
    health_.UpdatePose();
    health_.SendEvents();
    std::this_thread::sleep_for(kLook);
  }
  // What closes now closes on purpose and is no alarm.
  health_.SendEvents();
}

}  // namespace tbm
