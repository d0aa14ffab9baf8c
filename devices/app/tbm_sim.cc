#include <cstdio>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "devices/app/gige_simulator.h"
#include "devices/app/machine_options.h"
#include "devices/app/tilt_emulators.h"
#include "devices/app/truth_writer.h"
#include "pose/base/clock.h"

namespace {

enum ExitCode { kDone = 0, kWrongCommand = 2, kDevice = 3 };

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

int Run(const tbm::MachineOptions& options, const tbm::TiltEmulatorOptions& tilts) {
  const tbm::SystemClock clock;
  const auto world = tbm::BuildWorld(options);
  if (!world) {
    fmt::print(stderr, "{}", world.error());
    return kWrongCommand;
  }
  tbm::TruthWriter truth(options.truth_file, *world);
  if (!options.truth_file.empty() && !truth.is_open()) {
    fmt::print(stderr, "--truth {}: cannot be written\n", options.truth_file);
    return kWrongCommand;
  }
  const auto emulators = tbm::TiltEmulators::Start(tilts, *world, clock);
  if (!emulators) {
    fmt::print(stderr, "tbm_sim: {}\n", emulators.error());
    return kDevice;
  }
  const auto camera = tbm::GigeSimulator::Start(
      options.camera, *world, options.view, [&truth](const tbm::Shown& shown) {
        truth.Write(shown.sensed_at);
      });
  if (!camera) {
    fmt::print(stderr, "tbm_sim: {}\n", camera.error());
    return kDevice;
  }
  fmt::print("camera address={} serial={}\n", options.camera.address, options.camera.serial);
  fmt::print("inclinometer name=target protocol={} port={} address=1\n",
             tilts.protocol,
             tilts.target_port);
  fmt::print("inclinometer name=camera protocol={} port={} address=2\n",
             tilts.protocol,
             tilts.camera_port);
  fmt::print("ready\n");
  std::fflush(stdout);
  tbm::WaitForEnd(options.run_for_s);
  fmt::print(
      "camera frames_sent={} images_late={}\n", (*camera)->frames_sent(), (*camera)->images_late());
  return kDone;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "A whole simulated machine: a GigE Vision camera that looks at an LED target, and the two\n"
      "inclinometers on serial ports, all of the same world.");
  tbm::MachineOptions options;
  tbm::TiltEmulatorOptions tilts;
  tbm::AddMachineOptions(app, options);
  AddTiltOptions(app, tilts);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kWrongCommand;
  }
  tbm::HoldSignals();
  return Run(options, tilts);
}
