#include "devices/imu/stim_config.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace tbm {
namespace {

constexpr std::array<std::pair<std::string_view, StimModel>, 3> kModelWords = {{
    {"stim300", StimModel::kStim300},
    {"stim210", StimModel::kStim210},
    {"stim202", StimModel::kStim202},
}};
constexpr std::array<int, 4> kAccelRanges_g = {5, 10, 30, 80};
constexpr std::array<double, 5> kSampleRates_hz = {125.0, 250.0, 500.0, 1000.0, 2000.0};

class Faults {
 public:
  void Unless(bool is_right, std::string fault) {
    if (!is_right) found_.push_back(std::move(fault));
  }
  void NeedMs(std::string_view key, Duration value, double low_ms, double high_ms) {
    const double ms = static_cast<double>(value.count()) / 1e6;
    Unless(ms >= low_ms && ms <= high_ms,
           fmt::format("imu.{}: {}: must be {} to {}", key, ms, low_ms, high_ms));
  }
  std::vector<std::string> Take() { return std::move(found_); }

 private:
  std::vector<std::string> found_;
};

void CheckPort(const SerialSettings& port, Faults* faults) {
  faults->Unless(!port.path.empty(), "imu.port: empty: must be a device such as /dev/ttyUSB0");
  faults->Unless(std::ranges::find(kBaudRates, port.baud) != std::end(kBaudRates),
                 fmt::format("imu.baud: {}: must be one of {}; of the unit's rates 460800 and "
                             "921600 are among them",
                             port.baud,
                             fmt::join(kBaudRates, ", ")));
  faults->Unless(port.stop_bits == 1 || port.stop_bits == 2,
                 fmt::format("imu.stop_bits: {}: must be 1 or 2", port.stop_bits));
}

// The shortest datagram of the family must at least fit between two samples.
void CheckLineLoad(const StimConfig& config, Faults* faults) {
  const StimFamily family = FamilyOf(config.model);
  const std::size_t shortest = StimLength(family, StimLayouts(family).front());
  const double line_s = static_cast<double>(config.port.LineTime(shortest).count()) * 1e-9;
  faults->Unless(line_s * config.scales.sample_rate_hz <= 1.0,
                 fmt::format("imu.baud: {}: too slow for {} samples a second",
                             config.port.baud,
                             config.scales.sample_rate_hz));
}

}  // namespace

std::optional<StimModel> StimModelFromWord(std::string_view word) {
  for (const auto& [name, model] : kModelWords) {
    if (name == word) return model;
  }
  return std::nullopt;
}

std::string_view WordOf(StimModel model) {
  for (const auto& [name, value] : kModelWords) {
    if (value == model) return name;
  }
  return "unknown";
}

StimFamily FamilyOf(StimModel model) {
  return model == StimModel::kStim300 ? StimFamily::kStim300 : StimFamily::kStim210;
}

int StimConfig::CounterStep() const {
  return static_cast<int>(std::lround(counter_hz / scales.sample_rate_hz));
}

std::vector<std::string> CheckStimConfig(const StimConfig& config) {
  Faults faults;
  CheckPort(config.port, &faults);
  const StimScales& scales = config.scales;
  const bool is_rate_known =
      std::ranges::find(kSampleRates_hz, scales.sample_rate_hz) != std::end(kSampleRates_hz);
  const bool is_too_fast = config.model == StimModel::kStim202 && scales.sample_rate_hz > 1000.0;
  faults.Unless(is_rate_known && !is_too_fast,
                fmt::format("imu.sample_rate_hz: {}: must be 125, 250, 500, 1000{}",
                            scales.sample_rate_hz,
                            config.model == StimModel::kStim202 ? "" : " or 2000"));
  faults.Unless(std::ranges::find(kAccelRanges_g, scales.accel_range_g) != std::end(kAccelRanges_g),
                fmt::format("imu.accel_range_g: {}: must be {}",
                            scales.accel_range_g,
                            fmt::join(kAccelRanges_g, ", ")));
  const double step = config.counter_hz / scales.sample_rate_hz;
  faults.Unless(step >= 1.0 && step <= 128.0 && step == std::round(step),
                fmt::format("imu.counter_hz: {}: must be 1 to 128 times sample_rate_hz, 2000 as "
                            "far as is known",
                            config.counter_hz));
  if (is_rate_known && config.port.baud > 0) CheckLineLoad(config, &faults);
  faults.NeedMs("constant_delay_ms", config.constant_delay, 0, 100);
  faults.NeedMs("silent_after_ms", config.silent_after, 50, 600000);
  faults.NeedMs("reconnect_period_ms", config.reconnect_period, 20, 60000);
  faults.NeedMs("reopen_after_ms", config.reopen_after, 0, 600000);
  faults.NeedMs("frozen_after_ms", config.frozen_after, 0, 60000);
  return faults.Take();
}

}  // namespace tbm
