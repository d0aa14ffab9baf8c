#pragma once

#include <string>
#include <string_view>

#include "guidance/config/axis_file.h"

namespace tbm {

// The tunneller's table; see ParseAxis.
Result<LoadedAxis, AxisFileFaults> ParseAxisTable(std::string_view text,
                                                  const std::string& file,
                                                  const AxisFileOptions& options);

}  // namespace tbm
