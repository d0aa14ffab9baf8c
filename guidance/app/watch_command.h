#pragma once

#include <string>
#include <vector>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct WatchRequest {
  int domain_id = 25;
  std::vector<std::string> interfaces;  // empty: 127.0.0.1
  std::vector<std::string> peers;
  double seconds = 0.0;  // 0: until Ctrl-C
};

// Shows the live topics until it is told to stop: a screen on a terminal, lines into a pipe. kDds
// when a limited time passed and nothing at all was heard.
ExitCode RunWatch(const WatchRequest& request, const Console& console);

}  // namespace tbm
