#pragma once

#include <chrono>
#include <mutex>
#include <optional>

#include "devices/inclinometer/inclinometer.h"

namespace tbm {

// State and counters of one inclinometer, by what happened and when. Read from any thread.
class InclinometerLife {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  explicit InclinometerLife(std::chrono::nanoseconds silent_after) : silent_after_(silent_after) {}

  void OnPortOpen(SteadyTime now);
  void OnPortClosed();
  void OnRequest();
  void OnStale();
  void OnGood(Timestamp sensed_at, SteadyTime now);
  // kNotDue changes nothing. A port failure closes; the others leave the state to the clock.
  void OnFailure(InclinometerFailure failure);

  InclinometerHealth At(SteadyTime now) const;

 private:
  const std::chrono::nanoseconds silent_after_;
  mutable std::mutex mutex_;
  InclinometerHealth health_;
  bool is_open_ = false;
  bool was_open_ = false;
  bool has_good_ = false;  // since the port was opened
  SteadyTime alive_at_{};  // last good reading, or when the port was opened
};

}  // namespace tbm
