#include "devices/app/run_simulator.h"

#include <cstdio>

#include <fmt/format.h>

#include "devices/app/gige_simulator.h"
#include "devices/app/truth_writer.h"

namespace tbm {
namespace {

enum ExitCode { kDone = 0, kWrongCommand = 2, kDevice = 3 };

}  // namespace

int RunSimulator(const char* program,
                 const MachineOptions& options,
                 const StartInstruments& start_instruments) {
  HoldSignals();
  const auto machine = BuildMachine(options);
  if (!machine) {
    fmt::print(stderr, "{}", machine.error());
    return kWrongCommand;
  }
  const auto& world = machine->world;
  TruthWriter truth(options.truth_file, world);
  if (!options.truth_file.empty() && !truth.is_open()) {
    fmt::print(stderr, "--truth {}: cannot be written\n", options.truth_file);
    return kWrongCommand;
  }
  const Result<std::string, std::string> instruments =
      start_instruments ? start_instruments(*machine) : std::string();
  if (!instruments) {
    fmt::print(stderr, "{}: {}\n", program, instruments.error());
    return kDevice;
  }
  const auto camera =
      GigeSimulator::Start(options.camera, world, options.view, [&truth](const Shown& shown) {
        truth.Write(shown.sensed_at);
      });
  if (!camera) {
    fmt::print(stderr, "{}: {}\n", program, camera.error());
    return kDevice;
  }
  fmt::print("camera address={} serial={}\n", options.camera.address, options.camera.serial);
  fmt::print("{}ready\n", *instruments);
  std::fflush(stdout);
  WaitForEnd(options.run_for_s);
  fmt::print(
      "camera frames_sent={} images_late={}\n", (*camera)->frames_sent(), (*camera)->images_late());
  return kDone;
}

}  // namespace tbm
