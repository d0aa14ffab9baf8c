#pragma once

#include "guidance/app/check_command.h"

namespace tbm {

// Compares what guidance published with independent shots at points of the machine. `poses` is a
// record of guidance (IsGuidanceRecord).
ExitCode RunChainCheck(const CheckRequest& request, const Console& console);

}  // namespace tbm
