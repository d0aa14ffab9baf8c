#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>

#include "pose/base/fixed_vector.h"
#include "pose/frame/tilt_history.h"

namespace tbm {

// Readings of both inclinometers on their way to the solver. Bounded: the oldest gives way and is
// counted.
class TiltInbox {
 public:
  static constexpr std::size_t kCapacity = 256;
  using Readings = FixedVector<TiltReading, kCapacity>;

  void Put(const TiltReading& reading) {
    const std::lock_guard lock(mutex_);
    if (readings_.full()) {
      readings_.erase(0);
      ++dropped_;
    }
    readings_.push_back(reading);
    // The latest, not the greatest: somebody may have set the clock back.
    newest_[static_cast<std::size_t>(reading.sensor)] = reading.sensed_at;
    news_.notify_one();
  }

  // Moves all readings into `into`. Waits first, at the most for `patience`, until both
  // inclinometers have said something at or after `at`: then a tilt can be interpolated instead of
  // held.
  void TakeAll(Timestamp at, std::chrono::milliseconds patience, Readings* into) {
    std::unique_lock lock(mutex_);
    news_.wait_for(lock, patience, [this, at] { return newest_[0] >= at && newest_[1] >= at; });
    *into = readings_;
    readings_.clear();
  }

  std::uint64_t dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable news_;
  Readings readings_;
  std::array<Timestamp, 2> newest_{};
  std::uint64_t dropped_ = 0;
};

}  // namespace tbm
