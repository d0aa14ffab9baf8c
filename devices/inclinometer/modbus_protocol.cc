#include "devices/inclinometer/modbus_protocol.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "pose/base/check.h"

namespace tbm {
namespace {

std::uint32_t JoinWords(const ModbusRegisterMap& map, std::uint16_t first, std::uint16_t second) {
  const bool high_first = map.word_order == WordOrder::kHighFirst;
  const std::uint32_t high = high_first ? first : second;
  const std::uint32_t low = high_first ? second : first;
  return (high << 16u) | low;
}

double DecodeAngle(const ModbusRegisterMap& map,
                   std::span<const std::uint16_t> registers,
                   std::size_t at) {
  double count = 0.0;
  switch (map.format) {
    case RegisterFormat::kInt16:
      count = std::bit_cast<std::int16_t>(registers[at]);
      break;
    case RegisterFormat::kUint16:
      count = registers[at];
      break;
    case RegisterFormat::kInt32:
      count = std::bit_cast<std::int32_t>(JoinWords(map, registers[at], registers[at + 1]));
      break;
    case RegisterFormat::kFloat32:
      count = static_cast<double>(
          std::bit_cast<float>(JoinWords(map, registers[at], registers[at + 1])));
      break;
  }
  return (count - map.offset_lsb) * map.rad_per_lsb;
}

template <class Integer>
Integer ClampedCount(double count) {
  const double low = static_cast<double>(std::numeric_limits<Integer>::min());
  const double high = static_cast<double>(std::numeric_limits<Integer>::max());
  return static_cast<Integer>(std::clamp(std::round(count), low, high));
}

void EncodeAngle(const ModbusRegisterMap& map,
                 double angle_rad,
                 std::span<std::uint16_t> registers,
                 std::size_t at) {
  const double count = angle_rad / map.rad_per_lsb + map.offset_lsb;
  std::uint32_t joined = 0;
  switch (map.format) {
    case RegisterFormat::kInt16:
      registers[at] = std::bit_cast<std::uint16_t>(ClampedCount<std::int16_t>(count));
      return;
    case RegisterFormat::kUint16:
      registers[at] = ClampedCount<std::uint16_t>(count);
      return;
    case RegisterFormat::kInt32:
      joined = std::bit_cast<std::uint32_t>(ClampedCount<std::int32_t>(count));
      break;
    case RegisterFormat::kFloat32:
      joined = std::bit_cast<std::uint32_t>(static_cast<float>(count));
      break;
  }
  const auto high = static_cast<std::uint16_t>(joined >> 16u);
  const auto low = static_cast<std::uint16_t>(joined & 0xFFFFu);
  const bool high_first = map.word_order == WordOrder::kHighFirst;
  registers[at] = high_first ? high : low;
  registers[at + 1] = high_first ? low : high;
}

int ReadBig16(std::span<const std::uint8_t> bytes, std::size_t at) {
  return (bytes[at] << 8) | bytes[at + 1];
}

void AppendCrc(std::vector<std::uint8_t>* bytes) {
  const std::uint16_t crc = ModbusCrc(*bytes);
  bytes->push_back(static_cast<std::uint8_t>(crc & 0xFFu));
  bytes->push_back(static_cast<std::uint8_t>(crc >> 8u));
}

}  // namespace

int ModbusRegisterMap::First() const {
  const int first = std::min(beta_register, gamma_register);
  return temperature_register ? std::min(first, *temperature_register) : first;
}

int ModbusRegisterMap::Count() const {
  int end = std::max(beta_register, gamma_register) + WordsPerAngle();
  if (temperature_register) end = std::max(end, *temperature_register + 1);
  return end - First();
}

RegisterReading DecodeRegisters(const ModbusRegisterMap& map,
                                std::span<const std::uint16_t> registers) {
  TBM_CHECK(registers.size() == static_cast<std::size_t>(map.Count()));
  const auto index = [&](int number) { return static_cast<std::size_t>(number - map.First()); };
  RegisterReading reading;
  reading.angles.beta_rad = DecodeAngle(map, registers, index(map.beta_register));
  reading.angles.gamma_rad = DecodeAngle(map, registers, index(map.gamma_register));
  if (map.temperature_register) {
    const auto count = std::bit_cast<std::int16_t>(registers[index(*map.temperature_register)]);
    reading.temperature_celsius = count * map.celsius_per_lsb;
  }
  return reading;
}

std::vector<std::uint16_t> EncodeRegisters(const ModbusRegisterMap& map,
                                           const RegisterReading& reading) {
  const auto index = [&](int number) { return static_cast<std::size_t>(number - map.First()); };
  std::vector<std::uint16_t> registers(static_cast<std::size_t>(map.Count()));
  EncodeAngle(map, reading.angles.beta_rad, registers, index(map.beta_register));
  EncodeAngle(map, reading.angles.gamma_rad, registers, index(map.gamma_register));
  if (map.temperature_register) {
    const double count = reading.temperature_celsius.value_or(0.0) / map.celsius_per_lsb;
    registers[index(*map.temperature_register)] =
        std::bit_cast<std::uint16_t>(ClampedCount<std::int16_t>(count));
  }
  return registers;
}

std::uint16_t ModbusCrc(std::span<const std::uint8_t> bytes) {
  unsigned crc = 0xFFFFu;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1u) != 0 ? (crc >> 1u) ^ 0xA001u : crc >> 1u;
  }
  return static_cast<std::uint16_t>(crc);
}

std::optional<ModbusReadRequest> ParseModbusRequest(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != kModbusReadRequestSize) return std::nullopt;
  const std::uint16_t crc = ModbusCrc(bytes.first(6));
  if (bytes[6] != (crc & 0xFFu) || bytes[7] != crc >> 8u) return std::nullopt;
  return ModbusReadRequest{bytes[0], bytes[1], ReadBig16(bytes, 2), ReadBig16(bytes, 4)};
}

std::vector<std::uint8_t> EncodeModbusReply(const ModbusReadRequest& request,
                                            std::span<const std::uint16_t> registers) {
  TBM_CHECK(registers.size() <= 125);
  std::vector<std::uint8_t> bytes = {static_cast<std::uint8_t>(request.slave_id),
                                     static_cast<std::uint8_t>(request.function),
                                     static_cast<std::uint8_t>(2 * registers.size())};
  for (const std::uint16_t value : registers) {
    bytes.push_back(static_cast<std::uint8_t>(value >> 8u));
    bytes.push_back(static_cast<std::uint8_t>(value & 0xFFu));
  }
  AppendCrc(&bytes);
  return bytes;
}

std::vector<std::uint8_t> EncodeModbusException(const ModbusReadRequest& request,
                                                std::uint8_t code) {
  std::vector<std::uint8_t> bytes = {static_cast<std::uint8_t>(request.slave_id),
                                     static_cast<std::uint8_t>(request.function | 0x80),
                                     code};
  AppendCrc(&bytes);
  return bytes;
}

}  // namespace tbm
