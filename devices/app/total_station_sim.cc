#include <cstdio>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "devices/app/end_signals.h"
#include "devices/app/station_emulator.h"
#include "pose/base/clock.h"

namespace {

enum ExitCode { kDone = 0, kWrongCommand = 2, kDevice = 3 };

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("A motorised total station on this computer that speaks GeoCOM and sees prisms.",
               "total_station_sim");
  tbm::StationOptions options;
  std::string prisms_file;
  double run_for_s = 0.0;
  app.add_option("--prisms", prisms_file, "CSV prism,x_m,y_m,z_m[,constant_mm,vx_mm_per_s,..]")
      ->required();
  app.add_option("--address", options.address, "IPv4 address on this computer")
      ->capture_default_str();
  app.add_option(
         "--port", options.tcp_port, "TCP port; 0: the system chooses, the first line tells")
      ->capture_default_str()
      ->check(CLI::Range(0, 65535));
  app.add_option(
      "--serial-link", options.serial_link, "link to a serial port to be made, instead of TCP");
  app.add_option("--seed", options.errors.seed, "of noise and faults")->capture_default_str();
  app.add_option("--run-for", run_for_s, "end after so many seconds; 0: on a signal");
  tbm::AddStationOptions(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kWrongCommand;
  }
  tbm::HoldSignals();
  const tbm::SystemClock clock;
  const tbm::Timestamp start = clock.Now();
  auto prisms = tbm::ReadPrisms(prisms_file, "prism", start);
  if (!prisms) {
    fmt::print(stderr, "{}\n", prisms.error());
    return kWrongCommand;
  }
  const auto station =
      tbm::StationEmulator::Start(options, std::move(prisms).value(), start, clock);
  if (!station) {
    const bool is_link = station.error().failure == tbm::StationStartFailure::kLink;
    fmt::print(stderr, "{}{}", is_link ? "total_station_sim: " : "", station.error().message);
    if (is_link) fmt::print(stderr, "\n");
    return is_link ? kDevice : kWrongCommand;
  }
  fmt::print("{}\nready\n", (*station)->line());
  std::fflush(stdout);
  tbm::WaitForEnd(run_for_s);
  tbm::GeocomEmulator& emulator = (*station)->emulator();
  fmt::print(
      "total_station requests={} faults={}\n", emulator.requests(), emulator.faults().taken());
  return kDone;
}
