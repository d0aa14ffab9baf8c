#pragma once

#include <memory>

#include "devices/inclinometer/inclinometer_life.h"
#include "devices/inclinometer/sample_gate.h"
#include "devices/inclinometer/tilt_bus.h"

namespace tbm {

// An inclinometer that answers when asked, perhaps beside another one on the same wire.
class PolledInclinometer final : public Inclinometer {
 public:
  // `is_wire_shared`: after three failures in a row this one is asked only once a second, because
  // each unanswered question keeps the wire from the other instrument for time-out and silence.
  PolledInclinometer(InclinometerConfig config,
                     std::shared_ptr<TiltBus> bus,
                     const Clock& clock,
                     bool is_wire_shared);

  Result<TiltSample, InclinometerFailure> Read(
      std::chrono::steady_clock::time_point deadline) override;
  InclinometerHealth Health() const override { return life_.At(clock_.Steady()); }

 private:
  TiltSample Stamp(const TiltBus::Turn& turn) const;
  void ScheduleNext(std::chrono::steady_clock::time_point now);

  const InclinometerConfig config_;
  const std::shared_ptr<TiltBus> bus_;
  const Clock& clock_;
  const bool is_wire_shared_;
  InclinometerLife life_;
  SampleGate gate_;
  int openings_seen_ = 0;
  int failures_in_a_row_ = 0;
  std::chrono::steady_clock::time_point due_{};
};

}  // namespace tbm
