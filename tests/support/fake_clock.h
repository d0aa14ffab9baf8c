#pragma once

#include <chrono>

#include "pose/base/clock.h"

namespace tbm::test {

// Both clocks of a process, moving only when told. The civil one can be stepped by itself.
class FakeClock final : public Clock {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  Timestamp Now() const override { return now_; }
  SteadyTime Steady() const override { return steady_; }

  void Advance(Duration span) {
    now_ = now_ + span;
    steady_ += span;
  }
  // For whatever waits: time passes until then, never back.
  void AdvanceTo(SteadyTime wake) {
    if (wake > steady_) Advance(wake - steady_);
  }
  void StepCivilTime(Duration span) { now_ = now_ + span; }

 private:
  Timestamp now_{1'790'000'000'000'000'000};
  SteadyTime steady_{std::chrono::hours(1)};
};

}  // namespace tbm::test
