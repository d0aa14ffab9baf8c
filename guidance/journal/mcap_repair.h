#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "guidance/journal/mcap_reader.h"

namespace tbm {

// A place where something was lost, between the log times of the messages that lie next to it in
// the file; empty where there is none.
struct McapLoss {
  McapDamage damage;
  std::optional<Timestamp> before;
  std::optional<Timestamp> behind;
};

struct McapRepair {
  Bytes bytes;                     // a whole file: chunks, indexes, summary, footer
  McapContent content;             // what the damaged file held
  std::optional<Timestamp> first;  // earliest and latest log time
  std::optional<Timestamp> last;
  std::vector<McapLoss> losses;
  // By topic, how many sequence numbers between the first and the last are not there: lost here, or
  // dropped when they were to be written.
  std::map<std::string, std::uint64_t> missing;
};

// All whole messages of a damaged file in a good one, with their numbers and times, in the same
// order. `program` stands in its header. kNotMcap only when there is not one message in it and it
// does not begin as such a file does: bytes that are damaged at the very beginning are repaired
// too.
Result<McapRepair, McapFailure> RepairMcap(BytesView file, std::string_view program);

}  // namespace tbm
