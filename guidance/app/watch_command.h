#pragma once

#include <string>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"
#include "guidance/app/live_network.h"

namespace tbm {

struct WatchRequest {
  LiveNetwork network;
  double seconds = 0.0;  // 0: until Ctrl-C
};

// Shows the live topics until it is told to stop: a screen on a terminal, lines into a pipe. kDds
// when a limited time passed and nothing at all was heard.
ExitCode RunWatch(const WatchRequest& request, const Console& console);

}  // namespace tbm
