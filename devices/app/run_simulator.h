#pragma once

#include <functional>
#include <string>

#include "devices/app/machine_options.h"
#include "pose/base/result.h"

namespace tbm {

// Starts what else looks at the world, kept alive by the caller. The value is what to print about
// it once the camera is up, one line each.
using StartInstruments =
    std::function<Result<std::string, std::string>(const SimulatedMachine& machine)>;

// A simulator program behind its command line, to the exit code: the world, the instruments, the
// camera that looks at it, truth.csv where asked for; until a signal comes or the time is over.
int RunSimulator(const char* program,
                 const MachineOptions& options,
                 const StartInstruments& start_instruments = {});

}  // namespace tbm
