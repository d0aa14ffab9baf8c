#pragma once

#include "devices/bus/byte_link.h"
#include "devices/bus/pty_server.h"
#include "devices/bus/sleeper.h"
#include "pose/base/clock.h"

namespace tbm {

// A wire without a wire: the client's end of an emulated instrument in the same thread. Time passes
// by the sleeper, so a test's clock decides how long anything takes.
class EmulatorLink final : public ByteLink {
 public:
  // All three must outlive the link.
  EmulatorLink(PtyInstrument& instrument, const Clock& clock, Sleeper& sleeper)
      : instrument_(instrument), clock_(clock), sleeper_(sleeper) {}

  std::optional<LinkFailure> Open() override;
  void Close() override;
  bool IsOpen() const override { return is_open_; }
  std::optional<LinkFailure> Write(std::span<const std::uint8_t> bytes) override;
  Result<std::size_t, LinkFailure> Read(std::span<std::uint8_t> into, SteadyTime until) override;
  std::size_t Discard() override;

  // What the next openings fail with; empty for none.
  void FailOpening(std::optional<LinkFailure> failure) { opening_failure_ = failure; }
  int openings() const { return openings_; }

 private:
  // Lets the instrument say what is due, into arrived_. When it wants to be called again.
  std::optional<SteadyTime> Turn();

  PtyInstrument& instrument_;
  const Clock& clock_;
  Sleeper& sleeper_;
  PtyOutbox outbox_;
  std::vector<std::uint8_t> arrived_;
  bool is_open_ = false;
  int openings_ = 0;
  std::optional<LinkFailure> opening_failure_;
};

}  // namespace tbm
