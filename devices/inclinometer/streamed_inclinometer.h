#pragma once

#include <memory>

#include "devices/bus/sleeper.h"
#include "devices/inclinometer/bcd_frame_protocol.h"
#include "devices/inclinometer/inclinometer_config.h"
#include "devices/inclinometer/inclinometer_life.h"
#include "devices/inclinometer/sample_gate.h"
#include "pose/base/clock.h"

namespace tbm {

// A RION or BEWIS inclinometer that sends by itself. It is told to when the port is opened, and
// again every second while it is silent: after a power cut it may have fallen back to waiting for
// questions.
class StreamedInclinometer final : public Inclinometer {
 public:
  StreamedInclinometer(InclinometerConfig config,
                       FrameFamily family,
                       std::unique_ptr<ByteLink> link,
                       const Clock& clock,
                       Sleeper& sleeper);

  Result<TiltSample, InclinometerFailure> Read(
      std::chrono::steady_clock::time_point deadline) override;
  InclinometerHealth Health() const override { return life_.At(clock_.Steady()); }

 private:
  using SteadyTime = std::chrono::steady_clock::time_point;

  std::optional<InclinometerFailure> OpenWhenDue(SteadyTime deadline);
  std::optional<InclinometerFailure> AskForOutput(SteadyTime now);
  Result<std::optional<TiltSample>, InclinometerFailure> TakeNewest(
      std::span<const std::uint8_t> bytes);
  Result<TiltSample, InclinometerFailure> Fail(InclinometerFailure failure);

  const InclinometerConfig config_;
  const FrameFamily family_;
  const std::unique_ptr<ByteLink> link_;
  const Clock& clock_;
  Sleeper& sleeper_;
  InclinometerLife life_;
  SampleGate gate_;
  BcdFrameDecoder decoder_;
  SteadyTime open_at_{};  // the port is not tried before
  SteadyTime ask_again_at_{};
  SteadyTime alive_at_{};
};

}  // namespace tbm
