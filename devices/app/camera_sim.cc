#include <cstdio>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "devices/app/gige_simulator.h"
#include "devices/app/machine_options.h"
#include "devices/app/truth_writer.h"

namespace {

enum ExitCode { kDone = 0, kWrongCommand = 2, kDevice = 3 };

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("A GigE Vision camera on this computer that looks at a simulated LED target.");
  tbm::MachineOptions options;
  tbm::AddMachineOptions(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kWrongCommand;
  }
  tbm::HoldSignals();
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
  const auto camera = tbm::GigeSimulator::Start(
      options.camera, *world, options.view, [&truth](const tbm::Shown& shown) {
        truth.Write(shown.sensed_at);
      });
  if (!camera) {
    fmt::print(stderr, "camera_sim: {}\n", camera.error());
    return kDevice;
  }
  fmt::print("camera address={} serial={}\n", options.camera.address, options.camera.serial);
  fmt::print("ready\n");
  std::fflush(stdout);
  tbm::WaitForEnd(options.run_for_s);
  fmt::print(
      "camera frames_sent={} images_late={}\n", (*camera)->frames_sent(), (*camera)->images_late());
  return kDone;
}
