#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "devices/app/end_signals.h"
#include "devices/app/gige_simulator.h"
#include "devices/sim/camera_view.h"
#include "devices/sim/world.h"
#include "guidance/config/machine_file.h"
#include "pose/base/result.h"

namespace CLI {
class App;
}

namespace tbm {

// What every simulator program offers on its command line: camera, rig, motion, faults.
struct MachineOptions {
  GigeSimulatorOptions camera;
  std::string rig_file;
  std::string machine_file;  // machine.yaml instead of the rig: the whole machine in its tunnel
  std::optional<double> chainage_m;
  std::string truth_file;
  double run_for_s = 0.0;  // 0: until a signal comes
  double speed = 1.0;
  sim::Motion motion;
  sim::ViewOptions view;
  double advance_mm_per_min = 60.0;
  double vibration_mm = 0.05;
  std::vector<std::string> hidden_leds;
  std::vector<std::string> lamps;
  std::vector<std::string> reflections;
  std::vector<std::string> tilt_faults;
};

void AddMachineOptions(CLI::App& app, MachineOptions& options);

// --machine and --chainage, after AddMachineOptions.
void AddTunnelOptions(CLI::App& app, MachineOptions& options);

// Reads the command line. The exit code where it is wrong or only asks for help.
std::optional<int> ParseSimulator(CLI::App& app, int argc, char** argv);

struct SimulatedMachine {
  std::shared_ptr<const sim::World> world;
  std::optional<MachineFile> file;  // of a machine in a tunnel
  Timestamp begins_at;
};

// What the options describe, beginning now. All faults of the command line and of the files at
// once, one a line.
Result<SimulatedMachine, std::string> BuildMachine(const MachineOptions& options);

}  // namespace tbm
