#pragma once

#include <string>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"
#include "guidance/app/live_network.h"

namespace tbm {

struct AskRequest {
  std::string addressee;  // "total_station", "guidance"
  std::string verb;       // idl/README.md, "Commands"
  std::string argument;
  std::string by;       // the person who asks
  std::string because;  // may be empty
  std::string machine;  // empty: the one machine that is heard
  LiveNetwork network;
  double wait_s = 300.0;  // for the last answer
};

// Sends one command and prints the answers. kDone when it was done; kBadInput when it was refused
// or cannot be sent; kDevice when it failed; kDds when nobody answers.
ExitCode RunAsk(const AskRequest& request, const Console& console);

}  // namespace tbm
