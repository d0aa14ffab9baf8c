// Arbitrary register contents and register maps, and arbitrary requests to the emulated slave. The
// bytes of a reply are parsed by libmodbus; what it hands over arrives here.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "devices/inclinometer/modbus_protocol.h"
#include "devices/inclinometer/sample_gate.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tbm;
  const std::span<const std::uint8_t> bytes(data, size);
  if (size >= kModbusReadRequestSize) {
    const auto request = ParseModbusRequest(bytes.first(kModbusReadRequestSize));
    if (request && (request->count < 0 || request->count > 65535)) std::abort();
  }
  if (size < 4) return 0;

  ModbusRegisterMap map;
  map.format = static_cast<RegisterFormat>(bytes[0] & 3u);
  map.word_order = (bytes[0] & 4u) != 0 ? WordOrder::kLowFirst : WordOrder::kHighFirst;
  map.beta_register = bytes[1] % 12;
  map.gamma_register = bytes[2] % 12;
  if ((bytes[0] & 8u) != 0) map.temperature_register = bytes[3] % 12;
  map.rad_per_lsb = 1e-5;
  std::vector<std::uint16_t> registers(static_cast<std::size_t>(map.Count()));
  for (std::size_t i = 0; i < 2 * registers.size() && 4 + i < size; ++i) {
    registers[i / 2] = static_cast<std::uint16_t>((registers[i / 2] << 8u) | bytes[4 + i]);
  }
  const RegisterReading reading = DecodeRegisters(map, registers);
  SampleGate gate({0.5, 0.1, std::chrono::seconds(1), std::chrono::seconds(1)});
  const auto refused = gate.Refuses(reading.angles, {});
  const bool is_good =
      std::abs(reading.angles.beta_rad) <= 0.5 && std::abs(reading.angles.gamma_rad) <= 0.5;
  if (is_good == refused.has_value()) std::abort();
  return 0;
}
