#pragma once

#include <string>
#include <vector>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

// The command `tbm`: parses the arguments (without the program's name), runs the command they name
// and returns the exit code for the shell. No exception leaves it.
ExitCode RunTbm(std::vector<std::string> arguments, const Console& console);

}  // namespace tbm
