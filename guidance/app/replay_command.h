#pragma once

#include <string>
#include <vector>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct ReplayRequest {
  std::vector<std::string> journals;  // files, or folders of them
  std::string machine;                // another machine file instead of the journal's; may be empty
};

// Takes the steps again that a journal of the guidance process holds. kDone when every message came
// out bit for bit as it was, or when another machine was asked for; kBadInput when there was
// nothing to take; kInternal when something came out otherwise.
ExitCode RunReplay(const ReplayRequest& request, const Console& console);

}  // namespace tbm
