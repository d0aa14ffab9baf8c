#pragma once

#include <chrono>
#include <optional>

#include "devices/inclinometer/inclinometer.h"

namespace tbm {

struct GateLimits {
  double range_rad = 0.0;     // either axis, both signs
  double max_step_rad = 0.0;  // between two readings, either axis; 0 switches the check off
  std::chrono::nanoseconds frozen_after{0};  // 0 switches the check off
  std::chrono::nanoseconds forget_after{0};  // an older reading is no reference for a step
};

// Is a reading with a good checksum plausible? An eight-bit sum lets one damaged frame in 256 pass,
// and Modbus guards the wire but not the instrument. A step is refused once: when the next reading
// agrees with the refused one, the plate has really moved.
class SampleGate {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  explicit SampleGate(GateLimits limits) : limits_(limits) {}

  // Empty when the reading may be believed.
  std::optional<InclinometerFailure> Refuses(const Inclination& reading, SteadyTime now);

 private:
  struct Reading {
    Inclination angles;
    SteadyTime at;
  };
  bool IsNear(const std::optional<Reading>& reference, const Inclination& reading) const;

  GateLimits limits_;
  std::optional<Reading> accepted_;
  std::optional<Reading> refused_step_;
  Inclination last_;
  std::optional<SteadyTime> unchanged_since_;
};

}  // namespace tbm
