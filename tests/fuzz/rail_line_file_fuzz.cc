// rail_line.yaml.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "guidance/config/rail_line_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto config =
      tbm::ParseRailLineConfig({reinterpret_cast<const char*>(data), size}, "rail_line.yaml");
  if (!config) {
    if (config.error().empty()) __builtin_trap();  // refused without saying why
    for (const auto& fault : config.error()) {
      if (fault.Text().empty()) __builtin_trap();
    }
    return 0;
  }
  if (config->machine_id.empty() || config->machine_id.size() > 32) __builtin_trap();
  if (!(config->lag_s >= 0.0)) __builtin_trap();
  if (config->replay.has_value() == config->devices.has_value()) __builtin_trap();
  if (config->replay && !(config->replay->speed > 0.0)) __builtin_trap();
  if (config->devices && !tbm::CheckStimConfig(config->devices->imu).empty()) __builtin_trap();
  for (std::size_t i = 1; i < config->alert_m.size(); ++i) {
    if (!(config->alert_m[i] > config->alert_m[i - 1])) __builtin_trap();
  }
  return 0;
}
