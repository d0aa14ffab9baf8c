#include <CLI/CLI.hpp>

#include "devices/app/run_simulator.h"

int main(int argc, char** argv) {
  CLI::App app("A GigE Vision camera on this computer that looks at a simulated LED target.",
               "camera_sim");
  tbm::MachineOptions options;
  tbm::AddMachineOptions(app, options);
  if (const auto exit_code = tbm::ParseSimulator(app, argc, argv)) return *exit_code;
  return tbm::RunSimulator("camera_sim", options);
}
