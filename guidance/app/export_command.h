#pragma once

#include <string>
#include <vector>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct ExportRequest {
  std::vector<std::string> journals;  // files, or folders of them
  std::string out;                    // folder
  std::vector<std::string> topics;    // "guidance" or "tbm/v1/guidance"; empty: all
  std::string from;                   // log times, see UtcFromText; empty: no limit
  std::string to;
  bool force = false;
};

// One CSV per topic. What cannot be read is reported and the rest exported; kBadInput when that was
// more than the torn end of a journal that was not closed.
ExitCode RunExport(const ExportRequest& request, const Console& console);

}  // namespace tbm
