#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "guidance/journal/mcap_format.h"
#include "pose/base/result.h"
#include "pose/base/time.h"

namespace tbm {

struct McapChannel {
  std::string topic;
  std::string message_encoding;
  McapSchema schema;  // empty where the file gives none

  bool operator==(const McapChannel&) const = default;
};

struct McapMessage {
  std::uint16_t channel = 0;
  std::uint32_t sequence = 0;
  Timestamp log_time;
  Timestamp publish_time;
  BytesView data;  // lies in the file's bytes
};

enum class McapFailure {
  kNotMcap,  // does not begin as an MCAP file of version 0 does
};

enum class McapDamageKind {
  kCut,         // the file ends in the middle of a record
  kMalformed,   // a record whose content is no such record
  kWrongCrc,    // a chunk whose bytes have changed
  kCompressed,  // a chunk in a compression that is not read here
  kNoChannel,   // a message of a channel that was never declared
  kForeign,     // a record among the data that our journals do not have
};

struct McapDamage {
  McapDamageKind kind = McapDamageKind::kCut;
  std::uint64_t offset = 0;  // of the record in the file
};

struct McapContent {
  std::map<std::uint16_t, McapChannel> channels;
  std::uint64_t messages = 0;
  std::uint64_t chunks = 0;
  bool has_footer = false;  // the file was closed as it should
  std::vector<McapDamage> damages;
};

// Messages are believed inside chunks only, where a CRC covers them.
//
// Reads a file from its first byte to its last without needing its summary or footer, message by
// message in the order of the file; `on_message` may be empty. Where there is a whole summary,
// schemas and channels are taken from it. What is damaged is told and left
// out: behind it, reading goes on at the next chunk whose CRC is right.
Result<McapContent, McapFailure> ReadMcap(
    BytesView file, const std::function<void(const McapChannel&, const McapMessage&)>& on_message);

}  // namespace tbm
