#pragma once

#include <chrono>
#include <mutex>
#include <optional>

#include "devices/imu/inertial_unit.h"

namespace tbm {

// State and counters of one inertial unit, by what happened and when. Read from any thread.
class InertialUnitLife {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  explicit InertialUnitLife(Duration silent_after) : silent_after_(silent_after) {}

  void OnPortOpen(SteadyTime now);
  void OnPortClosed();
  void OnDatagram(SteadyTime now);
  void OnGood(Timestamp ends_at, SteadyTime now);
  // kNotDue changes nothing. A port failure closes; the others leave the state to the clock.
  void OnFailure(InertialFailure failure);
  // What the decoder and the clock have counted, as differences.
  void OnWire(std::uint64_t lost, std::uint64_t skipped_bytes, std::uint64_t clock_restarts);

  InertialHealth At(SteadyTime now) const;

 private:
  const Duration silent_after_;
  mutable std::mutex mutex_;
  InertialHealth health_;
  bool is_open_ = false;
  bool was_open_ = false;
  SteadyTime heard_at_{};              // last datagram, or when the port was opened
  std::optional<SteadyTime> good_at_;  // last sample since the port was opened
};

}  // namespace tbm
