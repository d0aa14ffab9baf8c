#pragma once

#include <chrono>

#include "pose/base/time.h"

namespace tbm {

// The two clocks of a process, as one object that only the edges (app, devices, idl) hold.
// Computing code receives instants as arguments. Tests hand in a fake that moves only when told.
class Clock {
 public:
  virtual ~Clock() = default;

  // Civil time for stamps. May be stepped by whoever sets the machine's clock.
  virtual Timestamp Now() const = 0;

  // For waiting and ages. Never steps.
  virtual std::chrono::steady_clock::time_point Steady() const = 0;
};

class SystemClock final : public Clock {
 public:
  Timestamp Now() const override {
    return {
        std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch())
            .count()};
  }
  std::chrono::steady_clock::time_point Steady() const override {
    return std::chrono::steady_clock::now();
  }
};

// How far the civil clock is ahead of the steady one, both read at one moment: of a few attempts
// the one that was interrupted least. Changes when somebody sets the clock, and only then.
inline Duration CivilMinusSteady(const Clock& clock) {
  Duration smallest_gap = Duration::max();
  Duration ahead{};
  for (int attempt = 0; attempt < 3; ++attempt) {
    const auto before = clock.Steady();
    const Timestamp civil = clock.Now();
    const Duration gap = clock.Steady() - before;
    if (gap >= smallest_gap) continue;
    smallest_gap = gap;
    ahead = Duration(civil.ns) -
            std::chrono::duration_cast<Duration>((before + gap / 2).time_since_epoch());
    if (gap < std::chrono::microseconds(5)) break;
  }
  return ahead;
}

}  // namespace tbm
