#include "devices/total_station/total_station_config.h"

#include <algorithm>
#include <array>
#include <utility>

#include <arpa/inet.h>
#include <fmt/format.h>

namespace tbm {
namespace {

constexpr std::array<std::pair<std::string_view, TotalStationDriver>, 2> kDriverWords = {{
    {"geocom_tcp", TotalStationDriver::kGeocomTcp},
    {"geocom_serial", TotalStationDriver::kGeocomSerial},
}};

class Faults {
 public:
  template <class T>
  void Range(const char* key, T value, T low, T high) {
    // Written so that NaN is a fault.
    if (value >= low && value <= high) return;
    Add(key, fmt::format("{}: wanted {} .. {}", value, low, high));
  }
  void Ms(const char* key, Duration value, double low_ms, double high_ms) {
    Range(key, static_cast<double>(value.count()) * 1e-6, low_ms, high_ms);
  }
  void Add(const char* key, const std::string& what) {
    lines_.push_back(fmt::format("total_station.{}: {}", key, what));
  }
  std::vector<std::string> Take() { return std::move(lines_); }

 private:
  std::vector<std::string> lines_;
};

bool IsAddress(const std::string& text) {
  in6_addr parsed{};
  return inet_pton(AF_INET, text.c_str(), &parsed) == 1 ||
         inet_pton(AF_INET6, text.c_str(), &parsed) == 1;
}

}  // namespace

std::optional<TotalStationDriver> TotalStationDriverFromWord(std::string_view word) {
  for (const auto& [name, driver] : kDriverWords) {
    if (name == word) return driver;
  }
  return std::nullopt;
}

std::string_view WordOf(TotalStationDriver driver) {
  for (const auto& [name, value] : kDriverWords) {
    if (value == driver) return name;
  }
  return "unknown";
}

std::vector<std::string> CheckTotalStationConfig(const TotalStationConfig& config) {
  Faults faults;
  if (config.driver == TotalStationDriver::kGeocomTcp) {
    if (!IsAddress(config.address)) {
      faults.Add("address",
                 fmt::format("\"{}\": wanted an IP address such as 192.168.1.20", config.address));
    }
    faults.Range("tcp_port", config.tcp_port, 1, 65535);
  } else {
    if (config.port.path.empty()) faults.Add("port", "empty: wanted a device such as /dev/ttyUSB0");
    if (std::ranges::find(kBaudRates, config.port.baud) == std::end(kBaudRates)) {
      faults.Add(
          "baud",
          fmt::format("{}: wanted one of {}", config.port.baud, fmt::join(kBaudRates, ", ")));
    }
    faults.Range("stop_bits", config.port.stop_bits, 1, 2);
  }
  faults.Ms("connect_timeout_ms", config.connect_timeout, 50, 60'000);
  faults.Ms("answer_timeout_ms", config.answer_timeout, 50, 60'000);
  faults.Ms("measure_timeout_ms", config.measure_timeout, 100, 120'000);
  faults.Ms("motion_timeout_ms", config.motion_timeout, 100, 300'000);
  faults.Ms("first_back_off_ms", config.first_back_off, 10, 60'000);
  faults.Ms("longest_back_off_ms", config.longest_back_off, 10, 600'000);
  if (config.longest_back_off < config.first_back_off) {
    faults.Add("longest_back_off_ms", "is shorter than first_back_off_ms");
  }
  if (config.measure_timeout < config.answer_timeout) {
    faults.Add("measure_timeout_ms", "is shorter than answer_timeout_ms");
  }
  faults.Range("arrived_within_rad", config.arrived_within_rad, 1e-7, 0.01);
  faults.Range("longest_distance_m", config.longest_distance_m, 1.0, 20'000.0);
  return faults.Take();
}

}  // namespace tbm
