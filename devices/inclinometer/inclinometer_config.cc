#include "devices/inclinometer/inclinometer_config.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace tbm {
namespace {

using std::chrono::nanoseconds;

constexpr std::array<std::pair<std::string_view, InclinometerDriver>, 5> kDriverWords = {{
    {"modbus", InclinometerDriver::kModbus},
    {"rion68", InclinometerDriver::kRion68},
    {"bewis77", InclinometerDriver::kBewis77},
    {"sim", InclinometerDriver::kSim},
    {"replay", InclinometerDriver::kReplay},
}};

// Characters of a question and an answer, of the longer frames and of a usual register map.
constexpr std::size_t kLongestExchange = 22;

bool HasPort(InclinometerDriver driver) {
  return driver != InclinometerDriver::kSim && driver != InclinometerDriver::kReplay;
}

double Milliseconds(nanoseconds span) { return static_cast<double>(span.count()) * 1e-6; }

class Faults {
 public:
  void Unless(bool is_right, std::string_view key, std::string message) {
    if (!is_right) found_.push_back({std::string(key), std::move(message)});
  }
  void NeedMs(std::string_view key, nanoseconds value, double low_ms, double high_ms) {
    const double ms = Milliseconds(value);
    Unless(ms >= low_ms && ms <= high_ms,
           key,
           fmt::format("is {}, must be {} to {}", ms, low_ms, high_ms));
  }
  void NeedDeg(std::string_view key, double value_rad, double low_deg, double high_deg) {
    const double deg = RadToDeg(value_rad);
    Unless(deg >= low_deg && deg <= high_deg,
           key,
           fmt::format("is {}, must be {} to {}", deg, low_deg, high_deg));
  }
  void NeedInt(std::string_view key, int value, int low, int high) {
    Unless(value >= low && value <= high,
           key,
           fmt::format("is {}, must be {} to {}", value, low, high));
  }
  std::vector<ConfigFault> Take() { return std::move(found_); }

 private:
  std::vector<ConfigFault> found_;
};

void CheckPort(const InclinometerConfig& config, Faults* faults) {
  const SerialSettings& port = config.port;
  faults->Unless(!port.path.empty(), "port", "is empty, must be a device such as /dev/ttyUSB0");
  faults->Unless(std::ranges::find(kBaudRates, port.baud) != std::end(kBaudRates),
                 "baud",
                 fmt::format("is {}, must be one of {}", port.baud, fmt::join(kBaudRates, ", ")));
  faults->NeedInt("stop_bits", port.stop_bits, 1, 2);
  const bool is_modbus = config.driver == InclinometerDriver::kModbus;
  faults->NeedInt("address", config.address, is_modbus ? 1 : 0, is_modbus ? 247 : 255);
  faults->NeedInt("automatic_rate_code", config.automatic_rate_code, 1, 255);
  faults->Unless(!(is_modbus && config.automatic_output),
                 "automatic_output",
                 "is true, but a Modbus instrument only answers");
  faults->NeedMs("response_timeout_ms", config.response_timeout, 10, 5000);
  faults->NeedMs("byte_timeout_ms", config.byte_timeout, 1, 1000);
  faults->NeedMs("quiet_time_ms", config.quiet_time, 10, 10000);
  faults->NeedMs("reconnect_period_ms", config.reconnect_period, 20, 60000);
  faults->NeedMs("reopen_after_ms", config.reopen_after, 0, 600000);
  const double line_ms = port.baud > 0 ? Milliseconds(port.LineTime(kLongestExchange)) : 0.0;
  faults->Unless(Milliseconds(config.response_timeout) >= line_ms,
                 "response_timeout_ms",
                 fmt::format("is {}, but question and answer alone take {:.0f} ms at {} baud",
                             Milliseconds(config.response_timeout),
                             line_ms,
                             port.baud));
  faults->Unless(
      config.quiet_time >= config.response_timeout,
      "quiet_time_ms",
      "is shorter than response_timeout_ms, so a late reply would pass as the next one's");
}

void CheckRegisters(const ModbusRegisterMap& map, Faults* faults) {
  faults->Unless(map.function == 3 || map.function == 4,
                 "registers.function",
                 fmt::format("is {}, must be 3 or 4", map.function));
  faults->NeedInt("registers.beta_register", map.beta_register, 0, 65534);
  faults->NeedInt("registers.gamma_register", map.gamma_register, 0, 65534);
  if (map.temperature_register) {
    faults->NeedInt("registers.temperature_register", *map.temperature_register, 0, 65534);
  }
  faults->Unless(std::abs(map.beta_register - map.gamma_register) >= map.WordsPerAngle(),
                 "registers.gamma_register",
                 "overlaps registers.beta_register");
  faults->Unless(
      map.Count() <= kMaxRegisterSpan,
      "registers",
      fmt::format(
          "span {} registers, at most {} can be read at once", map.Count(), kMaxRegisterSpan));
  const double deg_per_lsb = RadToDeg(map.rad_per_lsb);
  faults->Unless(deg_per_lsb >= 1e-7 && deg_per_lsb <= 180.0,
                 "registers.deg_per_lsb",
                 fmt::format("is {}, must be 1e-7 to 180", deg_per_lsb));
}

}  // namespace

std::optional<InclinometerDriver> InclinometerDriverFromWord(std::string_view word) {
  for (const auto& [name, driver] : kDriverWords) {
    if (name == word) return driver;
  }
  return std::nullopt;
}

std::string_view WordOf(InclinometerDriver driver) {
  for (const auto& [name, value] : kDriverWords) {
    if (value == driver) return name;
  }
  return "unknown";
}

std::vector<ConfigFault> FindFaults(const InclinometerConfig& config) {
  Faults faults;
  if (HasPort(config.driver)) CheckPort(config, &faults);
  if (config.driver == InclinometerDriver::kModbus) CheckRegisters(config.registers, &faults);
  faults.NeedMs("poll_period_ms", config.poll_period, 1, 60000);
  faults.NeedMs("latency_ms", config.latency, 0, 10000);
  faults.NeedMs("silent_after_ms", config.silent_after, 10, 600000);
  faults.Unless(config.silent_after > config.poll_period,
                "silent_after_ms",
                "is not longer than poll_period_ms, so every instrument would count as silent");
  faults.NeedMs("frozen_after_ms", config.frozen_after, 0, 86400000.0);
  faults.NeedDeg("range_deg", config.range_rad, 0.1, 90.0);
  faults.NeedDeg("max_step_deg", config.max_step_rad, 0.0, 180.0);
  faults.NeedDeg("sim_sigma_deg", config.sim_sigma_rad, 0.0, 10.0);
  faults.NeedDeg("sim_resolution_deg", config.sim_resolution_rad, 0.0, 10.0);
  return faults.Take();
}

std::vector<ConfigFault> FindSharingFaults(std::span<const InclinometerConfig> configs) {
  std::vector<ConfigFault> faults;
  for (std::size_t i = 0; i < configs.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const InclinometerConfig& a = configs[k];
      const InclinometerConfig& b = configs[i];
      if (!HasPort(a.driver) || !HasPort(b.driver) || a.port.path != b.port.path) continue;
      const auto differ = [&](bool is_wrong, std::string_view key, std::string_view why) {
        if (!is_wrong) return;
        faults.push_back({fmt::format("{}.{}", b.name, key),
                          fmt::format("shares {} with `{}`, but {}", b.port.path, a.name, why)});
      };
      differ(a.driver != b.driver, "driver", "one wire speaks one protocol");
      differ(a.address == b.address, "address", "both have the same address");
      differ(a.automatic_output || b.automatic_output,
             "automatic_output",
             "instruments that send by themselves would talk over each other");
      differ(a.port.baud != b.port.baud || a.port.parity != b.port.parity ||
                 a.port.stop_bits != b.port.stop_bits,
             "baud",
             "baud, parity and stop_bits differ");
    }
  }
  return faults;
}

}  // namespace tbm
