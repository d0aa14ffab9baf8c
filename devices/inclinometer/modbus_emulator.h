#pragma once

#include <atomic>
#include <span>
#include <string>
#include <vector>

#include "devices/bus/byte_link.h"
#include "devices/bus/pty_server.h"
#include "devices/inclinometer/emulator_fault.h"
#include "devices/inclinometer/modbus_protocol.h"
#include "devices/inclinometer/sim_inclinometer.h"
#include "pose/base/clock.h"

namespace tbm {

struct EmulatedModbusTilt {
  int slave_id = 1;
  ModbusRegisterMap registers;
  TiltTruth truth;
  double temperature_celsius = 21.0;
};

// Up to a bus full of Modbus RTU inclinometers on one pseudo-terminal. Bytes are framed, checked
// and answered here and not by libmodbus, so that driver and emulator do not share a mistake.
class ModbusEmulator final : private PtyInstrument {
 public:
  // `line.path` becomes a symbolic link to the terminal. `think_time` passes between the request's
  // last bit and the reply's first; the plate is sensed at its beginning.
  ModbusEmulator(SerialSettings line,
                 std::vector<EmulatedModbusTilt> tilts,
                 std::chrono::nanoseconds think_time,
                 const Clock& clock);

  bool IsUp() const { return server_.IsUp(); }
  void Unplug() { server_.Unplug(); }
  void Replug() { server_.Replug(); }
  FaultQueue& faults() { return faults_; }
  int requests_seen() const { return requests_seen_; }

 private:
  void OnPlug() override { held_.clear(); }
  void OnBytes(std::span<const std::uint8_t> bytes, SteadyTime now, PtyOutbox& outbox) override;
  std::optional<SteadyTime> OnTurn(SteadyTime, PtyOutbox&) override { return std::nullopt; }
  void Answer(const ModbusReadRequest& request, SteadyTime now, PtyOutbox& outbox);
  std::vector<std::uint8_t> ReplyTo(const ModbusReadRequest& request,
                                    EmulatedModbusTilt& tilt,
                                    Inclination* last,
                                    const std::optional<EmulatorFault>& fault,
                                    Timestamp sensed_at) const;

  const SerialSettings line_;
  std::vector<EmulatedModbusTilt> tilts_;
  std::vector<Inclination> last_;  // what each one said before, for kFrozen
  const std::chrono::nanoseconds think_time_;
  const Clock& clock_;
  FaultQueue faults_;
  std::atomic<int> requests_seen_ = 0;
  std::vector<std::uint8_t> held_;
  SteadyTime held_since_{};
  PtyServer server_;  // last: its thread uses all of the above
};

}  // namespace tbm
