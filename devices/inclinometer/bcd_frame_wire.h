#pragma once

#include <memory>

#include "devices/inclinometer/bcd_frame_protocol.h"
#include "devices/inclinometer/tilt_wire.h"
#include "pose/base/clock.h"

namespace tbm {

// Both angles and what else a frame tells, in SI.
Result<WireReading, AngleFailure> ReadingFromFrame(FrameFamily family,
                                                   const BcdFrame& frame,
                                                   bool swap_axes);

// Questions and answers in RION or BEWIS frames.
class BcdFrameWire final : public TiltWire {
 public:
  BcdFrameWire(FrameFamily family, std::unique_ptr<ByteLink> link, const Clock& clock)
      : family_(family), link_(std::move(link)), clock_(clock) {}

  std::optional<InclinometerFailure> Open() override;
  void Close() override { link_->Close(); }
  bool IsOpen() const override { return link_->IsOpen(); }
  std::size_t Discard() override { return link_->Discard(); }
  // Noise around a good reply does no harm; frames of other addresses are passed over.
  Result<WireReading, InclinometerFailure> Ask(const InclinometerConfig& instrument) override;

 private:
  FrameFamily family_;
  std::unique_ptr<ByteLink> link_;
  const Clock& clock_;
};

}  // namespace tbm
