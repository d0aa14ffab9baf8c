#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "idl/cpp/alarm.h"
#include "idl/cpp/messages.h"
#include "pose/app/box_messages.h"
#include "pose/base/clock.h"
#include "pose/base/pose_reason.h"

namespace tbm {

// Turns states into health messages and events: health of each device at every change and once a
// second; one event when a state changes, not each cycle.
class HealthWatch {
 public:
  HealthWatch(std::string machine_id, const Clock& clock, MessageSink& sink)
      : machine_id_(std::move(machine_id)), clock_(clock), sink_(sink) {}

  // The health thread, about ten times a second, once per device.
  void Update(std::string_view device_id, dds::DeviceHealth health);

  // The health thread: the pose alarm goes up when there has been no pose for a second, and comes
  // down with the first one.
  void UpdatePose();

  // Any thread.
  void NotePose(PoseStatus status, PoseReason reason);
  void Raise(std::string_view source,
             std::string_view code,
             dds::Severity severity,
             bool active,
             std::string_view text);

  // The health thread: sends what Raise has queued.
  void SendEvents();

 private:
  struct Known {
    dds::DeviceHealth health;
    std::chrono::steady_clock::time_point sent_at;
    bool has_streamed = false;  // since the process began
  };

  const std::string machine_id_;
  const Clock& clock_;
  MessageSink& sink_;

  std::map<std::string, Known, std::less<>> known_;                  // health thread's
  std::map<std::string, std::uint64_t, std::less<>> event_numbers_;  // health thread's
  bool pose_alarm_ = false;

  std::mutex mutex_;  // guards all below
  std::vector<dds::Event> events_;
  std::uint64_t events_dropped_ = 0;
  std::chrono::steady_clock::time_point last_pose_at_ = clock_.Steady();
  PoseStatus pose_status_ = PoseStatus::kNone;
  PoseReason pose_reason_ = PoseReason::kNone;
};

}  // namespace tbm
