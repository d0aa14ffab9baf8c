#include "devices/app/run_simulator.h"

int main(int argc, char** argv) {
  CLI::App app("A GigE Vision camera on this computer that looks at a simulated LED target.",
               "camera_sim");
  tbm::MachineOptions options;
  tbm::AddMachineOptions(app, options);
  return tbm::RunSimulator(app, argc, argv, options);
}
