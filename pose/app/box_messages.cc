#include "pose/app/box_messages.h"

#include <cmath>

#include <fmt/format.h>

namespace tbm {
namespace {

bool IsImageFault(PoseReason reason) {
  return reason == PoseReason::kFrameMissing || reason == PoseReason::kFrameUnreadable ||
         reason == PoseReason::kFrameSize || reason == PoseReason::kFrameDark ||
         reason == PoseReason::kFrameSaturated || reason == PoseReason::kStampNotIncreasing;
}

dds::DeviceState StateOf(CameraState state) {
  switch (state) {
    case CameraState::kClosed:
      return dds::DeviceState::kClosed;
    case CameraState::kOpening:
      return dds::DeviceState::kOpening;
    case CameraState::kStreaming:
      return dds::DeviceState::kStreaming;
    case CameraState::kSilent:
      return dds::DeviceState::kSilent;
  }
  return dds::DeviceState::kFault;
}

dds::DeviceState StateOf(InclinometerState state) {
  switch (state) {
    case InclinometerState::kClosed:
      return dds::DeviceState::kClosed;
    case InclinometerState::kOpening:
      return dds::DeviceState::kOpening;
    case InclinometerState::kStreaming:
      return dds::DeviceState::kStreaming;
    case InclinometerState::kSilent:
      return dds::DeviceState::kSilent;
  }
  return dds::DeviceState::kFault;
}

}  // namespace

dds::FrameFeatures FeaturesOf(std::string_view machine_id,
                              const FrameResult& result,
                              std::uint64_t frame_number,
                              double exposure_us,
                              const FrameCounts& counts) {
  dds::FrameFeatures message;
  message.machine_id = machine_id;
  message.sensed_at = result.sensed_at;
  message.frame_number = frame_number;
  message.exposure_s = 1e-6 * exposure_us;
  message.frames_received = counts.received;
  message.frames_lost = counts.lost;
  message.frames_damaged = counts.damaged;
  message.frames_skipped = counts.skipped;
  if (IsImageFault(result.reason)) {
    message.reason = result.reason;
    return message;
  }
  message.background_dn = result.levels.background_dn;
  message.noise_dn = result.levels.noise_dn;
  message.rejected_spots = static_cast<std::uint32_t>(result.levels.rejected_spots);
  message.dropped_spots = static_cast<std::uint32_t>(result.levels.dropped_spots);
  for (std::size_t i = 0; i < result.centres.size(); ++i) {
    message.spots.push_back({result.centres[i], result.led_of_centre[i]});
  }
  return message;
}

void FillRelativePose(std::string_view machine_id,
                      std::string_view rig_hash,
                      const Rig& rig,
                      const FrameResult& result,
                      dds::RelativePose* message) {
  message->machine_id = machine_id;
  message->rig_hash = rig_hash;
  message->sensed_at = result.sensed_at;
  message->status = result.status;
  message->reason = result.reason;
  if (!result.pose) return;
  const CheckedPose& checked = *result.pose;
  message->camera_from_target = checked.pose.camera_from_target;
  message->covariance = checked.pose.covariance;
  message->leds_used = checked.leds_used;
  message->excluded_led = checked.excluded_led;
  message->tilts_used = checked.tilts_used;
  message->chi2 = checked.pose.chi2;
  message->dof = checked.pose.dof;
  message->rms_px = checked.pose.rms_px;
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    dds::PosePoint point;
    point.name = std::string_view(rig.points[i].name);
    point.p_in_camera = result.points[i].p_in_camera;
    point.sigma_m = result.points[i].sigma_m;
    point.bound_m = result.points[i].bound_m;
    message->points.push_back(point);
  }
}

dds::DeviceHealth HealthOf(const CameraHealth& health) {
  dds::DeviceHealth message;
  message.device_id = "camera";
  message.state = StateOf(health.state);
  message.samples_good = health.frames - health.incomplete;
  message.samples_lost = health.lost;
  message.errors = health.incomplete;
  message.reconnects = health.reconnects;
  std::string detail;
  if (health.failure) detail = fmt::format("{}: {}", FailureCode(*health.failure), health.detail);
  if (detail.empty() && health.socket_buffer_short) {
    detail = fmt::format("socket_buffer_short: {} bytes granted; raise net.core.rmem_max",
                         health.socket_buffer_bytes);
  }
  message.detail = std::string_view(detail);
  return message;
}

dds::DeviceHealth HealthOf(const InclinometerHealth& health) {
  dds::DeviceHealth message;
  message.state = StateOf(health.state);
  message.samples_good = health.counters.good;
  message.samples_lost = health.counters.no_reply;
  message.errors = health.counters.garbled + health.counters.implausible + health.counters.stale;
  message.reconnects = health.counters.reconnects;
  if (health.last_failure && *health.last_failure != InclinometerFailure::kNotDue) {
    message.detail = FailureCode(*health.last_failure);
  }
  return message;
}

dds::DeviceHealth HealthOf(const Recorder::Status& status) {
  dds::DeviceHealth message;
  message.device_id = "recorder";
  message.samples_good = static_cast<std::uint64_t>(status.writer.frames_recorded);
  message.samples_lost =
      static_cast<std::uint64_t>(status.writer.frames_lost) + status.frames_dropped;
  switch (status.writer.state) {
    case RecorderState::kIdle:
      message.state = dds::DeviceState::kOpening;
      break;
    case RecorderState::kRecording:
      message.state = dds::DeviceState::kStreaming;
      break;
    case RecorderState::kDiskFull:
      message.state = dds::DeviceState::kSilent;
      break;
    case RecorderState::kFailed:
      message.state = dds::DeviceState::kFault;
      break;
  }
  message.detail = std::string_view(status.writer.what);
  return message;
}

}  // namespace tbm
