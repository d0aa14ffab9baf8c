#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace tbm {

using Bytes = std::vector<std::byte>;
using BytesView = std::span<const std::byte>;

// How the messages of a channel are to be read: for DDS topics the IDL text, encoding "omgidl".
struct McapSchema {
  std::string name;  // the type, "tbm::v1::RelativePose"
  std::string encoding;
  std::string text;

  bool operator==(const McapSchema&) const = default;
};

}  // namespace tbm

namespace tbm::mcap {

// Record types and the frame of a file, mcap.dev/spec, version 0. A record is its type (1 byte),
// the length of its content (8 bytes), the content. Numbers are little-endian; a text or an array
// is its length in bytes (4 bytes, a chunk's records 8) and the bytes.
inline constexpr std::array<unsigned char, 8> kMagic = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
inline constexpr std::uint64_t kRecordHead = 9;

enum class Op : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0B,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

}  // namespace tbm::mcap
