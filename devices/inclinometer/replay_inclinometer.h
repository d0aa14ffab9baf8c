#pragma once

#include <vector>

#include "devices/bus/sleeper.h"
#include "devices/inclinometer/inclinometer_life.h"
#include "pose/base/clock.h"

namespace tbm {

// Gives back the samples of a recording, bit for bit and with their own stamps.
class ReplayInclinometer final : public Inclinometer {
 public:
  // `samples` in order of time. `speed` 1 keeps the recording's pace, counted from the first Read
  // against `start` (the recording's first stamp of any sensor, so that several devices stay in
  // step); 0 gives every sample at once.
  ReplayInclinometer(std::vector<TiltSample> samples,
                     Timestamp start,
                     double speed,
                     const Clock& clock,
                     Sleeper& sleeper);

  // kEnded when the recording is over; then it waits for the deadline like a closed port.
  Result<TiltSample, InclinometerFailure> Read(
      std::chrono::steady_clock::time_point deadline) override;
  InclinometerHealth Health() const override { return life_.At(clock_.Steady()); }

 private:
  const std::vector<TiltSample> samples_;
  const Timestamp start_;
  const double speed_;
  const Clock& clock_;
  Sleeper& sleeper_;
  InclinometerLife life_;
  std::size_t next_ = 0;
  std::optional<std::chrono::steady_clock::time_point> began_;
};

}  // namespace tbm
