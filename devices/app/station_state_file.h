#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "guidance/station/kept_station.h"
#include "pose/base/result.h"

namespace tbm {

// The station's set-up on disk. A text that a person can read; its last line is the CRC-32 of all
// before it, so that a file that was cut or edited is refused and never half believed.
std::string TextOf(const KeptStation& kept);

// The error names file and line and says what is wrong.
Result<KeptStation, std::string> ParseKeptStation(std::string_view text, const std::string& file);

// Empty when there is no such file.
Result<std::optional<KeptStation>, std::string> LoadKeptStation(const std::string& path);

// Whole or not at all, also through a power cut: written beside, synced, renamed, the folder's
// names synced. 0, or an errno value.
int SaveKeptStation(const std::string& path, const KeptStation& kept);

}  // namespace tbm
