#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "devices/bus/byte_link.h"
#include "pose/base/time.h"

namespace tbm {

enum class TotalStationDriver {
  kGeocomTcp,     // `geocom_tcp`: Leica GeoCOM over a network or a radio bridge
  kGeocomSerial,  // `geocom_serial`: the same over a serial port
};
std::optional<TotalStationDriver> TotalStationDriverFromWord(std::string_view word);
std::string_view WordOf(TotalStationDriver driver);

enum class ChecksumUse {
  kAuto,  // asked for when connecting; used when the instrument can
  kOn,    // an instrument without it is not talked to
  kOff,   // firmware that is upset by the question. A flipped bit can then pass as a value
};

// One total station, in SI units. The loader turns keys (answer_timeout_ms, ...) into this.
struct TotalStationConfig {
  TotalStationDriver driver = TotalStationDriver::kGeocomTcp;

  std::string address = "127.0.0.1";  // IPv4 or IPv6; no names, they may take minutes to resolve
  int tcp_port = 1212;
  SerialSettings port;  // geocom_serial

  ChecksumUse checksum = ChecksumUse::kAuto;

  // Limits of one call, from the last byte sent. The instrument's own limit for a damaged request
  // is 3 s. A motorised call with a search takes 10 s and more.
  Duration connect_timeout = std::chrono::seconds(3);
  Duration answer_timeout = std::chrono::seconds(4);
  Duration measure_timeout = std::chrono::seconds(15);
  Duration motion_timeout = std::chrono::seconds(30);

  // Between attempts to open the connection; doubles from the first to the longest.
  Duration first_back_off = std::chrono::milliseconds(500);
  Duration longest_back_off = std::chrono::seconds(8);

  // How near to where it was told to go a telescope counts as arrived when the answer was lost.
  double arrived_within_rad = 1e-4;
  double longest_distance_m = 2000.0;  // beyond it an answer is implausible
};

// Every fault of a config as one line "total_station.<key>: <value>: what is right". Empty when it
// is good.
std::vector<std::string> CheckTotalStationConfig(const TotalStationConfig& config);

}  // namespace tbm
