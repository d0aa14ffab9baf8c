#pragma once

#include <string>

#include "guidance/rail/rail_recording.h"
#include "guidance/rail/rail_start.h"

namespace tbm {

// What is wrong with the start of a run, and in which of its files, for the one who has to mend it.
std::string Explain(const RailStartFailure& failure, const RailSetup& setup);

}  // namespace tbm
