#pragma once

#include <cstdint>
#include <string>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"
#include "guidance/app/live_network.h"

namespace tbm {

struct RecordRequest {
  std::string out;      // folder
  std::string program;  // stands in the header of each file
  LiveNetwork network;
  std::int64_t limit_mb = 20'000;  // of all journal files in the folder together
  double minutes = 30.0;           // of one file
  double seconds = 0.0;            // 0: until Ctrl-C
};

// Journals every sample of every topic. kDds when a limited time passed and nothing at all was
// heard; kDevice when something was and the disk did not take all of it.
ExitCode RunRecord(const RecordRequest& request, const Console& console);

}  // namespace tbm
