#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <stop_token>
#include <utility>
#include <vector>

#include "guidance/app/guidance_step.h"
#include "pose/base/time.h"

namespace tbm {

// What DDS threads hand to the one that takes steps, in the order in which it came. Bounded: when
// the step thread does not come for it, the newest are refused and counted, because the order of
// what was taken must stay that of the journal.
class GuidanceInbox {
 public:
  struct Received {
    GuidanceMessage message;
    Timestamp received_at;
  };

  GuidanceInbox() { received_.reserve(kCapacity); }

  void Add(GuidanceMessage message, Timestamp received_at) {
    const bool wakes = std::holds_alternative<dds::RelativePose>(message);
    {
      const std::lock_guard lock(mutex_);
      if (received_.size() == kCapacity) {
        ++dropped_;
        return;
      }
      received_.push_back({std::move(message), received_at});
      has_pose_ = has_pose_ || wakes;
    }
    if (wakes) news_.notify_one();
  }

  // Waits for a relative pose, at most until `until`, and takes all there is. `taken` is emptied
  // first; both lists keep their memory.
  void TakeAll(std::chrono::steady_clock::time_point until,
               const std::stop_token& stop,
               std::vector<Received>* taken) {
    taken->clear();
    std::unique_lock lock(mutex_);
    news_.wait_until(lock, stop, until, [this] { return has_pose_; });
    std::swap(*taken, received_);
    received_.reserve(kCapacity);
    has_pose_ = false;
  }

  std::uint64_t dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }

 private:
  static constexpr std::size_t kCapacity = 512;

  mutable std::mutex mutex_;
  std::condition_variable_any news_;
  std::vector<Received> received_;
  bool has_pose_ = false;
  std::uint64_t dropped_ = 0;
};

}  // namespace tbm
