#pragma once

#include <string>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct RepairRequest {
  std::string file;
  std::string out;
  std::string program;  // stands in the header of the new file
  bool force = false;
};

// A good file out of a damaged one, and what was lost and where. kDone also when much was lost;
// kBadInput when there is nothing to be saved.
ExitCode RunRepair(const RepairRequest& request, const Console& console);

}  // namespace tbm
