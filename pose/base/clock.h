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

}  // namespace tbm
