#pragma once

#include <functional>
#include <string>

#include <CLI/CLI.hpp>

#include "devices/app/machine_options.h"
#include "pose/base/result.h"

namespace tbm {

// Starts what else looks at the world, kept alive by the caller. The value is what to print about
// it once the camera is up, one line each.
using StartInstruments =
    std::function<Result<std::string, std::string>(const SimulatedMachine& machine)>;

// A simulator program from command line to exit code: the world, the instruments, the camera that
// looks at it, truth.csv where asked for; until a signal comes or the time is over.
//
// `options` are those that AddMachineOptions has tied to `app`.
int RunSimulator(CLI::App& app,
                 int argc,
                 char** argv,
                 const MachineOptions& options,
                 const StartInstruments& start_instruments = {});

}  // namespace tbm
