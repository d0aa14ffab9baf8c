#include "hmi_bridge/server/live_feed.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

namespace tbm::hmi {

const std::string& LiveFeed::Next(const Picture& picture) {
  text_.clear();
  fmt::format_to(std::back_inserter(text_),
                 R"({{"number":{},"at_utc_ms":{:.3f},"at_steady_ms":{:.3f},"sections":{{)",
                 ++number_,
                 picture.at_utc_ms,
                 picture.at_steady_ms);
  bool is_first = true;
  for (const Section& section : picture.sections) {
    if (section.version == 0 || section.json == nullptr) continue;
    auto sent = std::find_if(
        sent_.begin(), sent_.end(), [&](const auto& entry) { return entry.first == section.name; });
    if (sent == sent_.end()) sent = sent_.insert(sent_.end(), {section.name, 0});
    // Versions only grow: a picture that was taken earlier brings nothing back.
    if (section.version <= sent->second) continue;
    sent->second = section.version;
    if (!is_first) text_ += ',';
    is_first = false;
    text_ += '"';
    text_ += section.name;
    text_ += "\":";
    text_ += *section.json;
  }
  text_ += "}}";
  return text_;
}

}  // namespace tbm::hmi
