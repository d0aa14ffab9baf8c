#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "devices/bus/byte_link.h"
#include "devices/inclinometer/modbus_protocol.h"
#include "pose/base/angle.h"

namespace tbm {

enum class InclinometerDriver {
  kModbus,   // `modbus`: Modbus RTU, registers by map
  kRion68,   // `rion68`: RION serial frames, header 0x68
  kBewis77,  // `bewis77`: BEWIS serial frames, header 0x77
  kSim,      // `sim`: computed from a truth, no port
  kReplay,   // `replay`: samples of a recording
};

std::optional<InclinometerDriver> InclinometerDriverFromWord(std::string_view word);
std::string_view WordOf(InclinometerDriver driver);

// One inclinometer, in SI units. The loader turns keys (poll_period_ms, range_deg, ...) into this.
struct InclinometerConfig {
  std::string name;  // `target` or `camera`; in messages, and for `sim` also the noise's stream
  InclinometerDriver driver = InclinometerDriver::kSim;

  // Instruments with the same port path share one wire; their port settings must agree.
  SerialSettings port;
  int address = 1;  // Modbus slave id 1..247; frames 0..255, factory setting 0

  // Frames only: the instrument sends by itself instead of being asked. Only for one on a wire.
  bool automatic_output = false;
  int automatic_rate_code = 1;  // the instrument's own code; 1 is 5 Hz on the BEWIS AS400
  bool swap_axes = false;       // frames only: the instrument's X is gamma

  ModbusRegisterMap registers;

  std::chrono::nanoseconds poll_period = std::chrono::milliseconds(50);
  // The instrument's own filter and conversion delay, from its data sheet.
  std::chrono::nanoseconds latency{0};
  std::chrono::nanoseconds response_timeout = std::chrono::milliseconds(100);
  // Longest gap inside one Modbus reply. USB adapters that collect for 16 ms need more than that.
  std::chrono::nanoseconds byte_timeout = std::chrono::milliseconds(10);
  // After any error nothing is asked for so long. Must exceed the instrument's slowest reply: RTU
  // has no transaction number, so a reply that comes late would pass as the answer to the next
  // request.
  std::chrono::nanoseconds quiet_time = std::chrono::milliseconds(200);
  std::chrono::nanoseconds reconnect_period = std::chrono::milliseconds(100);
  std::chrono::nanoseconds silent_after = std::chrono::milliseconds(500);
  // The port is closed and opened again when the whole wire is silent for so long; 0 never.
  std::chrono::nanoseconds reopen_after = std::chrono::seconds(5);

  double range_rad = DegToRad(30.0);
  double max_step_rad = DegToRad(2.0);
  std::chrono::nanoseconds frozen_after{0};

  double sim_sigma_rad = DegToRad(0.005);
  double sim_resolution_rad = DegToRad(0.0001);
};

struct ConfigFault {
  std::string key;      // as in the file, below the inclinometer: "poll_period_ms"
  std::string message;  // what it is and what would be right
};

// Every fault of one config, so that all are reported at once.
std::vector<ConfigFault> FindFaults(const InclinometerConfig& config);

// Faults between configs: instruments on one wire that cannot share it. The key is "NAME.key".
std::vector<ConfigFault> FindSharingFaults(std::span<const InclinometerConfig> configs);

}  // namespace tbm
