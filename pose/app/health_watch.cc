#include "pose/app/health_watch.h"

#include <fmt/format.h>

namespace tbm {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kHeartbeat(1000);
constexpr milliseconds kPoseMissed(1000);
constexpr std::size_t kMaxQueuedEvents = 256;

}  // namespace

void HealthWatch::Update(std::string_view device_id, dds::DeviceHealth health) {
  const auto now = clock_.Steady();
  health.machine_id = std::string_view(machine_id_);
  health.device_id = device_id;
  health.published_at = clock_.Now();
  health.state_since = health.published_at;

  const auto place = known_.find(device_id);
  const bool is_new = place == known_.end();
  const bool changed = is_new || place->second.health.state != health.state;
  if (!changed) {
    health.state_since = place->second.health.state_since;
    const bool same_detail = place->second.health.detail == health.detail;
    if (same_detail && now - place->second.sent_at < kHeartbeat) return;
  }
  bool has_streamed = !is_new && place->second.has_streamed;
  if (changed) {
    const bool is_well = health.state == dds::DeviceState::kStreaming;
    // Until a device has streamed once it is being waited for; that there is no pose is said
    // anyway.
    has_streamed = has_streamed || is_well;
    const bool is_starting = !has_streamed && (health.state == dds::DeviceState::kClosed ||
                                               health.state == dds::DeviceState::kOpening);
    Raise(device_id,
          "device_state",
          is_well || is_starting ? dds::Severity::kInfo : dds::Severity::kAlarm,
          !is_well,
          fmt::format("{} is {}{}{}",
                      device_id,
                      dds::StateCode(health.state),
                      health.detail.empty() ? "" : ": ",
                      health.detail.view()));
  }
  known_.insert_or_assign(std::string(device_id), Known{health, now, has_streamed});
  sink_.Publish(health);
}

void HealthWatch::NotePose(PoseStatus status, PoseReason reason) {
  const std::lock_guard lock(mutex_);
  pose_status_ = status;
  pose_reason_ = reason;
  if (status != PoseStatus::kNone) last_pose_at_ = clock_.Steady();
}

void HealthWatch::UpdatePose() {
  bool is_missed = false;
  PoseReason reason = PoseReason::kNone;
  {
    const std::lock_guard lock(mutex_);
    is_missed = clock_.Steady() - last_pose_at_ > kPoseMissed;
    reason = pose_status_ == PoseStatus::kNone ? pose_reason_ : PoseReason::kNone;
  }
  if (is_missed == pose_alarm_) return;
  pose_alarm_ = is_missed;
  const std::string_view code = ReasonCode(reason);
  Raise("camera_box",
        "no_pose",
        dds::Severity::kAlarm,
        is_missed,
        is_missed ? fmt::format("no pose for a second: {}", code.empty() ? "no frames" : code)
                  : std::string("poses come again"));
}

void HealthWatch::Raise(std::string_view source,
                        std::string_view code,
                        dds::Severity severity,
                        bool active,
                        std::string_view text) {
  dds::Event event;
  event.machine_id = std::string_view(machine_id_);
  event.source = source;
  event.code = code;
  event.at = clock_.Now();
  event.severity = severity;
  event.active = active;
  event.text = text;
  const std::lock_guard lock(mutex_);
  if (events_.size() >= kMaxQueuedEvents) {
    ++events_dropped_;
    return;
  }
  events_.push_back(event);
}

void HealthWatch::SendEvents() {
  std::vector<dds::Event> events;
  std::uint64_t dropped = 0;
  {
    const std::lock_guard lock(mutex_);
    events.swap(events_);
    std::swap(dropped, events_dropped_);
  }
  for (dds::Event& event : events) {
    event.sample_number = ++event_numbers_[std::string(event.source.view())];
    sink_.Publish(event);
  }
  if (dropped > 0) {
    Raise("camera_box",
          "events_dropped",
          dds::Severity::kWarning,
          false,
          fmt::format("{} events came too fast to be told", dropped));
  }
}

}  // namespace tbm
