#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "guidance/rail/rail_recording.h"

namespace tbm {

// The section `camera` of rail.yaml: rotation to a trillionth, position
// to a tenth of a micrometre, offset to a tenth of a microsecond, sigmas to four digits. Each line
// of `remarks` stands in it as a comment.
std::string RailCameraYaml(const RailCamera& camera, const std::vector<std::string>& remarks);

// `yaml` with `section` in place of the one whose name stands at the beginning of a line; every
// other line stays as it is, byte for byte. Empty where there is no such line.
std::optional<std::string> WithSection(std::string_view yaml,
                                       std::string_view name,
                                       std::string_view section);

}  // namespace tbm
