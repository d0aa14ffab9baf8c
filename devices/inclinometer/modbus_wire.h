#pragma once

#include "devices/inclinometer/tilt_wire.h"

struct _modbus;  // libmodbus' own name. NOLINT(bugprone-reserved-identifier)

namespace tbm {

// Modbus RTU master by libmodbus, without the library's own recovery: that one blocks inside a call
// for as long as a cable is pulled.
class ModbusWire final : public TiltWire {
 public:
  explicit ModbusWire(SerialSettings settings) : settings_(std::move(settings)) {}
  ~ModbusWire() override { Close(); }
  ModbusWire(const ModbusWire&) = delete;
  ModbusWire& operator=(const ModbusWire&) = delete;

  std::optional<InclinometerFailure> Open() override;
  void Close() override;
  bool IsOpen() const override { return context_ != nullptr; }
  std::size_t Discard() override;
  Result<WireReading, InclinometerFailure> Ask(const InclinometerConfig& instrument) override;

 private:
  SerialSettings settings_;
  ::_modbus* context_ = nullptr;
};

}  // namespace tbm
