#pragma once

#include <optional>
#include <string>

#include "devices/sim/drive.h"
#include "guidance/config/machine_file.h"
#include "pose/base/result.h"

namespace tbm {

// The machine of a machine.yaml in its tunnel.
struct LoadedTunnel {
  MachineFile file;
  sim::Tunnel tunnel;
};

// Reads machine.yaml and the design axis that it names. `start_chainage_m` is of the rear shield's
// datum, internal; without it, 60 m behind the start of the axis. The machine goes straight on
// where the axis ends. All faults at once, one a line.
Result<LoadedTunnel, std::string> LoadTunnel(const std::string& machine_file,
                                             std::optional<double> start_chainage_m);

}  // namespace tbm
