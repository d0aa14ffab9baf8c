#include <memory>

#include <fmt/format.h>

#include "devices/app/run_simulator.h"
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

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "A whole simulated machine: a GigE Vision camera that looks at an LED target, and the two\n"
      "inclinometers on serial ports, all of the same world.",
      "tbm_sim");
  tbm::MachineOptions options;
  tbm::TiltEmulatorOptions tilts;
  tbm::AddMachineOptions(app, options);
  AddTiltOptions(app, tilts);

  const tbm::SystemClock clock;
  std::unique_ptr<tbm::TiltEmulators> emulators;
  const auto start =
      [&](std::shared_ptr<const tbm::sim::World> world) -> tbm::Result<std::string, std::string> {
    auto started = tbm::TiltEmulators::Start(tilts, std::move(world), clock);
    if (!started) return tbm::Failure{started.error()};
    emulators = std::move(started).value();
    return Lines(tilts);
  };
  return tbm::RunSimulator(app, argc, argv, options, start);
}
