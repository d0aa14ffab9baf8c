#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pose/base/time.h"

namespace tbm {

struct JournalFile {
  std::string path;
  std::uint64_t number = 0;
  std::int64_t bytes = 0;
};

// "journal_20261123T140500Z_007.mcap"
std::string JournalFileName(Timestamp first_log_time, std::uint64_t number);

// The number in such a name; empty for any other name.
std::optional<std::uint64_t> JournalFileNumber(std::string_view name);

// The journal files of a folder, in the order in which they were written. Other files are passed
// over; empty also when the folder cannot be read.
std::vector<JournalFile> JournalFilesIn(const std::string& folder);

}  // namespace tbm
