#pragma once

#include <algorithm>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "idl/cpp/subscriber.h"

namespace tbm::test {

// What a reader on DDS has seen of a camera box.
class MachineWatcher {
 public:
  explicit MachineWatcher(int domain_id)
      : participant_(Config(domain_id)),
        poses_(participant_,
               [this](const dds::RelativePose& pose, const dds::SampleFacts&) {
                 const std::lock_guard lock(mutex_);
                 all_.push_back(pose);
               }),
        health_(participant_, [this](const dds::DeviceHealth& health, const dds::SampleFacts&) {
          const std::lock_guard lock(mutex_);
          states_[std::string(health.device_id.view())] = health.state;
        }) {}

  std::vector<dds::RelativePose> Poses() const {
    const std::lock_guard lock(mutex_);
    return all_;
  }
  std::size_t OkCount() const { return Count(PoseStatus::kOk); }
  std::size_t Count(PoseStatus status) const {
    const std::lock_guard lock(mutex_);
    return static_cast<std::size_t>(std::count_if(
        all_.begin(), all_.end(), [&](const auto& pose) { return pose.status == status; }));
  }
  std::size_t Count(PoseStatus status, PoseReason reason) const {
    const std::lock_guard lock(mutex_);
    return static_cast<std::size_t>(std::count_if(all_.begin(), all_.end(), [&](const auto& pose) {
      return pose.status == status && pose.reason == reason;
    }));
  }
  bool IsIn(const std::string& device, dds::DeviceState state) const {
    const std::lock_guard lock(mutex_);
    const auto known = states_.find(device);
    return known != states_.end() && known->second == state;
  }

 private:
  static dds::ParticipantConfig Config(int domain_id) {
    dds::ParticipantConfig config;
    config.domain_id = domain_id;
    config.name = "machine_watcher";
    return config;
  }
  mutable std::mutex mutex_;
  std::vector<dds::RelativePose> all_;
  std::map<std::string, dds::DeviceState> states_;
  dds::Participant participant_;
  dds::Subscriber<dds::RelativePose> poses_;
  dds::Subscriber<dds::DeviceHealth> health_;
};

}  // namespace tbm::test
