#include <cstdio>
#include <optional>

#include <fmt/format.h>

#include "devices/app/end_signals.h"
#include "devices/app/station_options.h"
#include "devices/bus/tcp_server.h"
#include "pose/base/clock.h"

namespace {

enum ExitCode { kDone = 0, kWrongCommand = 2, kDevice = 3 };

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("A motorised total station on this computer that speaks GeoCOM and sees prisms.",
               "total_station_sim");
  tbm::StationOptions options;
  tbm::AddStationOptions(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kWrongCommand;
  }
  tbm::HoldSignals();
  const tbm::SystemClock clock;
  auto station = tbm::BuildStation(options, clock.Now());
  if (!station) {
    fmt::print(stderr, "{}", station.error());
    return kWrongCommand;
  }
  const std::size_t prism_count = station->instrument.prisms.size();
  tbm::GeocomEmulator emulator(station->emulator, station->instrument, clock);
  unsigned seed = static_cast<unsigned>(options.errors.seed);
  for (const auto& one : station->faults)
    emulator.faults().AddLasting(one.fault, one.ratio, ++seed);

  std::optional<tbm::TcpServer> tcp;
  std::optional<tbm::PtyServer> pty;
  if (options.serial_link.empty()) {
    tcp.emplace(options.address, options.tcp_port, emulator);
    if (!tcp->IsUp()) {
      fmt::print(stderr,
                 "total_station_sim: port {} of {} cannot be had: is the address one of this "
                 "computer, and the port free?\n",
                 options.tcp_port,
                 options.address);
      return kDevice;
    }
    fmt::print("total_station address={} port={} ", options.address, tcp->port());
  } else {
    pty.emplace(options.serial_link, emulator);
    if (!pty->IsUp()) {
      fmt::print(stderr,
                 "{}: the link to a pseudo-terminal cannot be made: is its folder there and "
                 "writable, and is no other file of that name in the way?\n",
                 options.serial_link);
      return kDevice;
    }
    fmt::print("total_station serial={} ", options.serial_link);
  }
  fmt::print("prisms={} serial_number={}\nready\n", prism_count, options.emulator.serial_number);
  std::fflush(stdout);
  tbm::WaitForEnd(options.run_for_s);
  fmt::print(
      "total_station requests={} faults={}\n", emulator.requests(), emulator.faults().taken());
  return kDone;
}
