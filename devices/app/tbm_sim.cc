#include <memory>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "devices/app/run_simulator.h"
#include "devices/app/station_emulator.h"
#include "devices/app/tilt_emulators.h"
#include "pose/base/clock.h"

namespace {

void AddTiltOptions(CLI::App& app, tbm::TiltEmulatorOptions& tilts) {
  app.add_option("--tilt-protocol", tilts.protocol, "modbus, rion68 or bewis77")
      ->capture_default_str()
      ->check(CLI::IsMember({"modbus", "rion68", "bewis77"}));
  app.add_option(
         "--target-port", tilts.target_port, "link to the serial port to be made; address 1")
      ->capture_default_str();
  app.add_option("--camera-port",
                 tilts.camera_port,
                 "same for the camera's; address 2; the same path puts both on one wire")
      ->capture_default_str();
  app.add_option("--baud", tilts.baud, "line rate, as far as delays go")->capture_default_str();
}

std::string Lines(const tbm::TiltEmulatorOptions& tilts) {
  return fmt::format(
      "inclinometer name=target protocol={0} port={1} address=1\n"
      "inclinometer name=camera protocol={0} port={2} address=2\n",
      tilts.protocol,
      tilts.target_port,
      tilts.camera_port);
}

struct StationInTunnel {
  tbm::StationOptions station;
  int port = -1;
  std::string references_file;
};

void AddStation(CLI::App& app, StationInTunnel& o) {
  app.option_defaults()->group("Total station");
  app.add_option("--station-port",
                 o.port,
                 "TCP port of a total station that sees the prisms of --machine; 0: the system "
                 "chooses, the first lines tell")
      ->check(CLI::Range(0, 65535));
  app.add_option("--station-address", o.station.address, "IPv4 address of it, on this computer")
      ->capture_default_str();
  app.add_option("--references", o.references_file, "CSV name,x_m,y_m,z_m of its reference prisms");
  tbm::AddStationOptions(app, o.station);
}

// The prisms on the rear shield where the world says that they are, and the references.
tbm::Result<std::vector<tbm::SimulatedPrism>, std::string> PrismsOf(
    const StationInTunnel& options, const tbm::SimulatedMachine& machine) {
  std::vector<tbm::SimulatedPrism> prisms;
  for (const tbm::NamedPrism& prism : machine.file->machine.prisms) {
    prisms.push_back(
        {prism.name, [world = machine.world, p = prism.prism.p_in_rear_shield](tbm::Timestamp at) {
           return Eigen::Vector3d(world->SiteFromRearShield(at) * p);
         }});
  }
  if (options.references_file.empty()) return prisms;
  auto references = tbm::ReadPrisms(options.references_file, "name", machine.begins_at);
  if (!references) return tbm::Failure{references.error()};
  for (const tbm::SimulatedPrism& reference : *references) prisms.push_back(reference);
  return prisms;
}

tbm::Result<std::unique_ptr<tbm::StationEmulator>, std::string> StartStation(
    StationInTunnel options, const tbm::SimulatedMachine& machine, const tbm::Clock& clock) {
  if (!machine.file) {
    return tbm::Failure{std::string("--station-port: the total station needs --machine")};
  }
  auto prisms = PrismsOf(options, machine);
  if (!prisms) return tbm::Failure{prisms.error()};
  options.station.tcp_port = options.port;
  auto station = tbm::StationEmulator::Start(
      options.station, std::move(prisms).value(), machine.begins_at, clock);
  if (!station) return tbm::Failure{station.error().message};
  return std::move(station).value();
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "A whole simulated machine: a GigE Vision camera that looks at an LED target, the two\n"
      "inclinometers on serial ports, and with --machine and --station-port a total station that\n"
      "looks at the rear shield's prisms; all of the same world.",
      "tbm_sim");
  tbm::MachineOptions options;
  tbm::TiltEmulatorOptions tilts;
  StationInTunnel station;
  tbm::AddMachineOptions(app, options);
  tbm::AddTunnelOptions(app, options);
  AddTiltOptions(app, tilts);
  AddStation(app, station);

  const tbm::SystemClock clock;
  std::unique_ptr<tbm::TiltEmulators> emulators;
  std::unique_ptr<tbm::StationEmulator> total_station;
  const auto start =
      [&](const tbm::SimulatedMachine& machine) -> tbm::Result<std::string, std::string> {
    auto started = tbm::TiltEmulators::Start(tilts, machine.world, clock);
    if (!started) return tbm::Failure{started.error()};
    emulators = std::move(started).value();
    if (station.port < 0) return Lines(tilts);
    station.station.errors.seed = options.motion.seed;
    auto seen = StartStation(station, machine, clock);
    if (!seen) return tbm::Failure{seen.error()};
    total_station = std::move(seen).value();
    return Lines(tilts) + total_station->line() + "\n";
  };
  if (const auto exit_code = tbm::ParseSimulator(app, argc, argv)) return *exit_code;
  return tbm::RunSimulator("tbm_sim", options, start);
}
