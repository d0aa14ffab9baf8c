#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "idl/cpp/participant.h"

namespace tbm::dds::test {

using namespace std::chrono_literals;

// Waits until the condition holds; false when it does not within the time.
inline bool Eventually(const std::function<bool()>& condition,
                       std::chrono::milliseconds within = 5s) {
  const auto until = std::chrono::steady_clock::now() + within;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > until) return false;
    std::this_thread::sleep_for(2ms);
  }
  return true;
}

// Keeps the alarms of a participant for a test to look at.
class AlarmLog {
 public:
  AlarmHandler Handler() {
    return [this](const Alarm& alarm) {
      const std::lock_guard lock(mutex_);
      alarms_.push_back(alarm);
    };
  }
  int Count(AlarmKind kind, bool active = true) const {
    const std::lock_guard lock(mutex_);
    int count = 0;
    for (const Alarm& alarm : alarms_) count += alarm.kind == kind && alarm.active == active;
    return count;
  }
  std::string Text(AlarmKind kind) const {
    const std::lock_guard lock(mutex_);
    for (const Alarm& alarm : alarms_) {
      if (alarm.kind == kind) return alarm.text;
    }
    return "";
  }
  std::string All() const {
    const std::lock_guard lock(mutex_);
    std::string all;
    for (const Alarm& alarm : alarms_) {
      all += std::string(AlarmCode(alarm.kind)) + (alarm.active ? " + " : " - ") + alarm.topic +
             ": " + alarm.text + "\n";
    }
    return all;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<Alarm> alarms_;
};

inline ParticipantConfig OnLoopback(int domain_id, const std::string& name) {
  ParticipantConfig config;
  config.domain_id = domain_id;
  config.name = name;
  return config;
}

}  // namespace tbm::dds::test
