#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "devices/app/station_options.h"
#include "devices/bus/pty_server.h"
#include "devices/bus/tcp_server.h"
#include "devices/total_station/geocom_emulator.h"
#include "pose/base/clock.h"
#include "pose/base/result.h"

namespace tbm {

enum class StationStartFailure { kOptions, kLink };

struct StationNotStarted {
  StationStartFailure failure = StationStartFailure::kOptions;
  std::string message;  // one line for each thing that is wrong
};

// A simulated total station on its TCP port or pseudo-terminal, for as long as it lives.
class StationEmulator {
 public:
  static Result<std::unique_ptr<StationEmulator>, StationNotStarted> Start(
      const StationOptions& options,
      std::vector<SimulatedPrism> prisms,
      Timestamp start,
      const Clock& clock);

  // "total_station address=127.0.0.1 port=1212 prisms=4 serial_number=3512345"
  const std::string& line() const { return line_; }
  GeocomEmulator& emulator() { return emulator_; }

 private:
  StationEmulator(SimulatedStation station, const Clock& clock)
      : emulator_(station.emulator, std::move(station.instrument), clock) {}

  std::string line_;
  GeocomEmulator emulator_;
  std::optional<TcpServer> tcp_;
  std::optional<PtyServer> pty_;
};

}  // namespace tbm
