#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hmi_bridge/server/console_source.h"

namespace tbm::hmi {

// What one console has been sent, and the next message for it. There is no queue: a version that
// was overtaken while the client was slow is never sent.
class LiveFeed {
 public:
  // Sections that are newer than what was sent, as openapi.yaml's `Snapshot`; they count as sent.
  // The text is good until the next call.
  const std::string& Next(const Picture& picture);

 private:
  std::vector<std::pair<std::string_view, std::uint64_t>> sent_;
  std::uint64_t number_ = 0;
  std::string text_;
};

}  // namespace tbm::hmi
