#pragma once

#include <atomic>
#include <vector>

#include "devices/bus/byte_link.h"
#include "devices/bus/pty_server.h"
#include "devices/inclinometer/bcd_frame_protocol.h"
#include "devices/inclinometer/emulator_fault.h"
#include "devices/inclinometer/sim_inclinometer.h"
#include "pose/base/clock.h"

namespace tbm {

struct EmulatedFrameTilt {
  std::uint8_t address = 0;
  FrameLayout layout = FrameLayout::kFourByteTemperature;
  TiltTruth truth;  // beta goes out as X, gamma as Y
  double third = 21.0;
};

// RION or BEWIS inclinometers on one pseudo-terminal. They answer "read angles"; "set output" makes
// one send by itself at `automatic_period`, whatever the rate code, until it is told 0.
class BcdFrameEmulator final : private PtyInstrument {
 public:
  // `line.path` becomes a symbolic link to the terminal. `think_time` passes between the request's
  // last bit and the reply's first; the plate is sensed at its beginning.
  BcdFrameEmulator(SerialSettings line,
                   FrameFamily family,
                   std::vector<EmulatedFrameTilt> tilts,
                   std::chrono::nanoseconds think_time,
                   std::chrono::nanoseconds automatic_period,
                   const Clock& clock);

  bool IsUp() const { return server_.IsUp(); }
  void Unplug() { server_.Unplug(); }
  // The instrument has lost power too: it waits for questions again.
  void Replug() { server_.Replug(); }
  FaultQueue& faults() { return faults_; }
  int requests_seen() const { return requests_seen_; }

 private:
  struct Unit {
    EmulatedFrameTilt tilt;
    Inclination last;
    std::optional<SteadyTime> next_automatic;
  };

  static std::vector<Unit> MakeUnits(std::vector<EmulatedFrameTilt> tilts);
  void OnPlug() override;
  void OnBytes(std::span<const std::uint8_t> bytes, SteadyTime now, PtyOutbox& outbox) override;
  std::optional<SteadyTime> OnTurn(SteadyTime now, PtyOutbox& outbox) override;
  void OnFrame(const BcdFrame& frame, SteadyTime now, PtyOutbox& outbox);
  void SendAngles(Unit& unit, SteadyTime sensed, SteadyTime now, PtyOutbox& outbox);

  const SerialSettings line_;
  const FrameFamily family_;
  std::vector<Unit> units_;
  const std::chrono::nanoseconds think_time_;
  const std::chrono::nanoseconds automatic_period_;
  const Clock& clock_;
  FaultQueue faults_;
  std::atomic<int> requests_seen_ = 0;
  BcdFrameDecoder decoder_;
  PtyServer server_;  // last: its thread uses all of the above
};

}  // namespace tbm
