#pragma once

#include <string>
#include <string_view>

#include "guidance/config/axis_file.h"

namespace tbm {

// One alignment of a LandXML document (UTF-8, without byte order mark); see ParseAxis. Which
// elements and attributes are read: guidance/axis/docs/axis.md, section 2.
Result<LoadedAxis, AxisFileFaults> ParseLandXml(std::string_view text,
                                                const std::string& file,
                                                const AxisFileOptions& options);

}  // namespace tbm
