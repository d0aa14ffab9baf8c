#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>

namespace tbm {

// The loops of the box each say that they go round. One that has not for too long hangs, and
// nothing inside the process can help it.
class LoopBeats {
 public:
  enum Loop : std::size_t { kGrabber, kTargetTilt, kCameraTilt, kSolver, kCount };
  using SteadyTime = std::chrono::steady_clock::time_point;

  // Any thread. A loop counts from its first beat on.
  void Beat(Loop loop, SteadyTime now) { beats_[loop] = now.time_since_epoch().count(); }
  // A loop that has ended on purpose hangs no more.
  void End(Loop loop) { beats_[loop] = kNone; }

  // Whether every loop that has begun has beaten within `limit`.
  bool AllWithin(std::chrono::steady_clock::duration limit, SteadyTime now) const {
    for (const auto& beat : beats_) {
      const auto at = beat.load();
      if (at != kNone && now.time_since_epoch().count() - at > limit.count()) return false;
    }
    return true;
  }

 private:
  using Count = std::chrono::steady_clock::rep;
  static constexpr Count kNone = 0;
  std::array<std::atomic<Count>, kCount> beats_{};
};

}  // namespace tbm
