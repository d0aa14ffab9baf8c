#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "pose/base/result.h"
#include "pose/geometry/tilt.h"

namespace tbm {

enum class RegisterFormat {
  kInt16,
  kUint16,   // with offset_lsb for instruments that count from a shifted zero
  kInt32,    // two registers
  kFloat32,  // two registers, IEEE 754
};
enum class WordOrder {
  kHighFirst,  // the Modbus habit
  kLowFirst,
};

// Where an instrument keeps its angles. Register numbers are protocol addresses (counted from 0, no
// 30001/40001 offset). All are read in one request, so both angles are of one instant.
struct ModbusRegisterMap {
  int function = 4;  // 3 holding registers, 4 input registers
  RegisterFormat format = RegisterFormat::kInt16;
  WordOrder word_order = WordOrder::kHighFirst;
  int beta_register = 0;
  int gamma_register = 1;
  double rad_per_lsb = 0.0;                 // what one count (kFloat32: what 1.0) means
  int offset_lsb = 0;                       // count at zero degrees
  std::optional<int> temperature_register;  // always int16
  double celsius_per_lsb = 0.1;

  int WordsPerAngle() const {
    return format == RegisterFormat::kInt16 || format == RegisterFormat::kUint16 ? 1 : 2;
  }
  int First() const;
  int Count() const;
};

inline constexpr int kMaxRegisterSpan = 32;  // a wider map is a mistake in the config

struct RegisterReading {
  Inclination angles;
  std::optional<double> temperature_celsius;
};

// `registers` are Count() registers from First(). A float may come out NaN: judging is
// SampleGate's.
RegisterReading DecodeRegisters(const ModbusRegisterMap& map,
                                std::span<const std::uint16_t> registers);

// The instrument's side. Counts are rounded and clamped to what the format can say.
std::vector<std::uint16_t> EncodeRegisters(const ModbusRegisterMap& map,
                                           const RegisterReading& reading);

// CRC-16/MODBUS, as sent: low byte first.
std::uint16_t ModbusCrc(std::span<const std::uint8_t> bytes);

// A master's request to read registers.
struct ModbusReadRequest {
  int slave_id = 0;
  int function = 0;
  int first_register = 0;
  int count = 0;
};
inline constexpr std::size_t kModbusReadRequestSize = 8;

// Bytes of the reply to a request for `count` registers.
inline constexpr std::size_t ModbusReadReplySize(int count) {
  return 5 + 2 * static_cast<std::size_t>(count);
}

// Empty unless these are the 8 bytes of a request with a right CRC.
std::optional<ModbusReadRequest> ParseModbusRequest(std::span<const std::uint8_t> bytes);

std::vector<std::uint8_t> EncodeModbusReply(const ModbusReadRequest& request,
                                            std::span<const std::uint16_t> registers);
std::vector<std::uint8_t> EncodeModbusException(const ModbusReadRequest& request,
                                                std::uint8_t code);

}  // namespace tbm
