#include "devices/inclinometer/modbus_wire.h"

#include <array>
#include <cerrno>

#include <modbus/modbus.h>

#include "devices/bus/serial_port.h"
#include "devices/inclinometer/link_failure.h"

namespace tbm {
namespace {

char ParityLetter(Parity parity) {
  switch (parity) {
    case Parity::kNone:
      return 'N';
    case Parity::kEven:
      return 'E';
    case Parity::kOdd:
      return 'O';
  }
  return 'N';
}

InclinometerFailure FailureFromModbus(int error) {
  switch (error) {
    case ETIMEDOUT:
      return InclinometerFailure::kNoReply;
    case EMBBADCRC:
    case EMBBADDATA:
    case EMBMDATA:
    case EMBUNKEXC:
    case EMBBADEXC:
      return InclinometerFailure::kGarbled;
    case EMBBADSLAVE:
      return InclinometerFailure::kOtherInstrument;
    default:
      break;
  }
  const bool is_exception = error > MODBUS_ENOBASE && error <= EMBXGTAR;
  return is_exception ? InclinometerFailure::kException : InclinometerFailure::kHungUp;
}

struct Split {
  std::uint32_t seconds;
  std::uint32_t microseconds;
};
Split SplitTime(std::chrono::nanoseconds span) {
  const auto microseconds = std::chrono::duration_cast<std::chrono::microseconds>(span).count();
  return {static_cast<std::uint32_t>(microseconds / 1000000),
          static_cast<std::uint32_t>(microseconds % 1000000)};
}

}  // namespace

std::optional<InclinometerFailure> ModbusWire::Open() {
  Close();
  context_ = modbus_new_rtu(settings_.path.c_str(),
                            settings_.baud,
                            ParityLetter(settings_.parity),
                            8,
                            settings_.stop_bits);
  if (context_ == nullptr) return InclinometerFailure::kPortRefused;
  modbus_set_error_recovery(context_, MODBUS_ERROR_RECOVERY_NONE);
  if (modbus_connect(context_) != 0) {
    const LinkFailure failure = LinkFailureFromErrno(errno);
    Close();
    return FailureFromLink(failure);
  }
  if (!LockPort(modbus_get_socket(context_))) {
    Close();
    return InclinometerFailure::kPortRefused;
  }
  modbus_flush(context_);
  return std::nullopt;
}

void ModbusWire::Close() {
  if (context_ == nullptr) return;
  modbus_close(context_);
  modbus_free(context_);
  context_ = nullptr;
}

std::size_t ModbusWire::Discard() {
  if (context_ == nullptr) return 0;
  const std::size_t waiting = BytesWaiting(modbus_get_socket(context_));
  modbus_flush(context_);
  return waiting;
}

Result<WireReading, InclinometerFailure> ModbusWire::Ask(const InclinometerConfig& instrument) {
  if (context_ == nullptr) return Failure{InclinometerFailure::kHungUp};
  const ModbusRegisterMap& map = instrument.registers;
  const int count = map.Count();
  const Split response = SplitTime(instrument.response_timeout);
  const Split byte = SplitTime(instrument.byte_timeout);
  modbus_set_slave(context_, instrument.address);
  modbus_set_response_timeout(context_, response.seconds, response.microseconds);
  modbus_set_byte_timeout(context_, byte.seconds, byte.microseconds);

  std::array<std::uint16_t, kMaxRegisterSpan> registers{};
  errno = 0;
  const int received =
      map.function == 3
          ? modbus_read_registers(context_, map.First(), count, registers.data())
          : modbus_read_input_registers(context_, map.First(), count, registers.data());
  if (received == -1) return Failure{FailureFromModbus(errno)};
  if (received != count) return Failure{InclinometerFailure::kGarbled};

  const RegisterReading reading =
      DecodeRegisters(map, std::span(registers.data(), static_cast<std::size_t>(count)));
  return WireReading{reading.angles,
                     reading.temperature_celsius,
                     kModbusReadRequestSize,
                     ModbusReadReplySize(count)};
}

}  // namespace tbm
