#pragma once

#include "pose/base/clock.h"

namespace tbm {

// Civil time that goes on evenly whatever anybody sets the clock to: that of another clock when
// this one was made, carried on by its steady time. What is measured in one run is stamped by it,
// so that it belongs together and no stamp comes twice.
class EvenClock final : public Clock {
 public:
  explicit EvenClock(const Clock& clock)
      : clock_(clock), civil_minus_steady_(CivilMinusSteady(clock)) {}  // `clock` outlives it

  Timestamp Now() const override {
    const auto steady = std::chrono::duration_cast<Duration>(Steady().time_since_epoch());
    return {(steady + civil_minus_steady_).count()};
  }
  std::chrono::steady_clock::time_point Steady() const override { return clock_.Steady(); }

  // How far the other clock has been set since, ahead is positive; good to a millisecond.
  Duration SetSince() const { return CivilMinusSteady(clock_) - civil_minus_steady_; }

 private:
  const Clock& clock_;
  const Duration civil_minus_steady_;
};

}  // namespace tbm
