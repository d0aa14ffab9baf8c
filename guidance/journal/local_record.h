#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "guidance/journal/mcap_format.h"
#include "pose/base/time.h"

namespace tbm {

// What stands in a journal beside the DDS topics: all that a step of the guidance rested on, so
// that it can be taken again. Plain CDR, little-endian, with its IDL text as the schema.

inline constexpr std::string_view kStepTopic = "local/step";
inline constexpr std::string_view kFileTopic = "local/file";

// One step: it used every input that stands before it in the journal and behind the step before.
struct StepRecord {
  Timestamp now;
  std::uint64_t step_number = 0;  // from 1

  bool operator==(const StepRecord&) const = default;
};

// A file that the process read at its start. A process writes "machine", "rig" and "axis", in this
// order, before its first step.
struct FileRecord {
  std::string role;
  std::string path;
  std::string content;

  bool operator==(const FileRecord&) const = default;
};

McapSchema StepSchema();
McapSchema FileSchema();
Bytes Encoded(const StepRecord& record);
Bytes Encoded(const FileRecord& record);
// Empty for anything but exactly one such record.
std::optional<StepRecord> StepFrom(BytesView bytes);
std::optional<FileRecord> FileFrom(BytesView bytes);

}  // namespace tbm
