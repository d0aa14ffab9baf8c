#include "guidance/journal/mcap_reader.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <type_traits>
#include <utility>

#include <zlib.h>

namespace tbm {
namespace {

using mcap::Op;

// Takes numbers and texts from the front of some bytes. Once something did not fit, nothing does.
class Cursor {
 public:
  explicit Cursor(BytesView bytes) : bytes_(bytes) {}

  bool is_sound() const { return is_sound_; }
  BytesView rest() const { return bytes_; }

  template <class Number>
  Number Take() {
    static_assert(std::is_unsigned_v<Number>);
    const BytesView taken = TakeBytes(sizeof(Number));
    Number number = 0;
    for (std::size_t i = 0; i < taken.size(); ++i) {
      number |= static_cast<Number>(static_cast<Number>(taken[i]) << (8 * i));
    }
    return number;
  }

  std::string TakeText() {
    const BytesView taken = TakeBytes(Take<std::uint32_t>());
    std::string text(taken.size(), '\0');
    if (!taken.empty()) std::memcpy(text.data(), taken.data(), taken.size());
    return text;
  }

  BytesView TakeBytes(std::uint64_t count) {
    if (!is_sound_ || count > bytes_.size()) {
      is_sound_ = false;
      return {};
    }
    const BytesView taken = bytes_.first(static_cast<std::size_t>(count));
    bytes_ = bytes_.subspan(static_cast<std::size_t>(count));
    return taken;
  }

 private:
  BytesView bytes_;
  bool is_sound_ = true;
};

struct Record {
  Op op;
  BytesView content;
};

// The record at the front of `bytes`; empty when it reaches beyond their end.
std::optional<Record> RecordAt(BytesView bytes) {
  Cursor cursor(bytes);
  const auto op = cursor.Take<std::uint8_t>();
  const auto length = cursor.Take<std::uint64_t>();
  const BytesView content = cursor.TakeBytes(length);
  if (!cursor.is_sound()) return {};
  return Record{static_cast<Op>(op), content};
}

std::uint32_t CrcOf(BytesView bytes) {
  return static_cast<std::uint32_t>(
      ::crc32_z(0, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

Timestamp TimeOf(std::uint64_t ns) { return {static_cast<std::int64_t>(ns)}; }

class Reading {
 public:
  Reading(BytesView file,
          const std::function<void(const McapChannel&, const McapMessage&)>& on_message)
      : file_(file), on_message_(on_message) {}

  McapContent Run() {
    LearnFromSummary();
    std::size_t at = mcap::kMagic.size();
    while (at < file_.size() && !content_.has_footer) {
      const std::optional<Record> record = RecordAt(file_.subspan(at));
      const std::optional<McapDamageKind> damage =
          record ? Take(*record, at) : std::optional(McapDamageKind::kCut);
      if (!damage) {
        at += mcap::kRecordHead + record->content.size();
        continue;
      }
      content_.damages.push_back({*damage, at});
      // Its own length is to be trusted only where all that it says of itself fits.
      at = NextChunk(at + 1);
    }
    return std::move(content_);
  }

 private:
  std::optional<McapDamageKind> Take(const Record& record, std::size_t at) {
    switch (record.op) {
      case Op::kHeader:
        return at == mcap::kMagic.size() && IsHeader(record.content)
                   ? std::nullopt
                   : std::optional(McapDamageKind::kMalformed);
      case Op::kSchema:
        return TakeSchema(record.content);
      case Op::kChannel:
        return TakeChannel(record.content);
      case Op::kChunk:
        return TakeChunk(record.content, at);
      case Op::kDataEnd:
        is_behind_data_ = true;
        return {};
      case Op::kFooter:
        content_.has_footer = is_behind_data_ && record.content.size() == 20;
        return content_.has_footer ? std::nullopt : std::optional(McapDamageKind::kMalformed);
      case Op::kMessageIndex:
        return IsIndex(record.content) ? std::nullopt : std::optional(McapDamageKind::kMalformed);
      default:
        // The summary says nothing that the data does not.
        return is_behind_data_ ? std::nullopt : std::optional(McapDamageKind::kForeign);
    }
  }

  static bool IsHeader(BytesView content) {
    Cursor cursor(content);
    (void)cursor.TakeText();  // profile
    (void)cursor.TakeText();  // library
    return cursor.is_sound() && cursor.rest().empty();
  }

  // Schemas and channels stand once among the data, where no CRC covers them. A whole summary tells
  // them again under a CRC of its own: with it, a damaged one costs nothing.
  void LearnFromSummary() {
    constexpr std::size_t kFooterContent = 20;
    constexpr std::size_t kFooter = mcap::kRecordHead + kFooterContent;
    if (file_.size() < 2 * mcap::kMagic.size() + kFooter || !EndsAsItShould()) return;
    const std::size_t footer_at = file_.size() - mcap::kMagic.size() - kFooter;
    const std::optional<Record> footer = RecordAt(file_.subspan(footer_at));
    if (!footer || footer->op != Op::kFooter || footer->content.size() != kFooterContent) return;
    Cursor cursor(footer->content);
    const auto start = cursor.Take<std::uint64_t>();
    (void)cursor.Take<std::uint64_t>();  // where the offsets of the groups begin
    if (start < mcap::kMagic.size() || start > footer_at) return;
    BytesView rest = file_.subspan(start, footer_at - start);
    const BytesView covered =
        file_.subspan(start, footer_at + kFooter - sizeof(std::uint32_t) - start);
    if (CrcOf(covered) != cursor.Take<std::uint32_t>()) return;
    while (const std::optional<Record> record = RecordAt(rest)) {
      if (record->op == Op::kSchema) (void)TakeSchema(record->content);
      if (record->op == Op::kChannel) (void)TakeChannel(record->content);
      rest = rest.subspan(mcap::kRecordHead + record->content.size());
    }
  }

  static bool IsIndex(BytesView content) {
    Cursor cursor(content);
    (void)cursor.Take<std::uint16_t>();
    const BytesView entries = cursor.TakeBytes(cursor.Take<std::uint32_t>());
    return cursor.is_sound() && cursor.rest().empty() && entries.size() % 16 == 0;
  }

  std::optional<McapDamageKind> TakeSchema(BytesView content) {
    Cursor cursor(content);
    const auto id = cursor.Take<std::uint16_t>();
    McapSchema schema;
    schema.name = cursor.TakeText();
    schema.encoding = cursor.TakeText();
    schema.text = cursor.TakeText();
    if (!cursor.is_sound() || !cursor.rest().empty()) return McapDamageKind::kMalformed;
    // Told again it is the same, or no declaration at all.
    const auto [known, is_new] = schemas_.try_emplace(id, schema);
    return is_new || known->second == schema ? std::nullopt
                                             : std::optional(McapDamageKind::kMalformed);
  }

  std::optional<McapDamageKind> TakeChannel(BytesView content) {
    Cursor cursor(content);
    const auto id = cursor.Take<std::uint16_t>();
    const auto schema = schemas_.find(cursor.Take<std::uint16_t>());
    McapChannel channel;
    channel.topic = cursor.TakeText();
    channel.message_encoding = cursor.TakeText();
    (void)cursor.TakeText();  // metadata
    if (!cursor.is_sound() || !cursor.rest().empty()) return McapDamageKind::kMalformed;
    if (schema != schemas_.end()) channel.schema = schema->second;
    const auto [known, is_new] = content_.channels.try_emplace(id, channel);
    return is_new || known->second == channel ? std::nullopt
                                              : std::optional(McapDamageKind::kMalformed);
  }

  std::optional<McapDamageKind> TakeMessage(BytesView content) {
    Cursor cursor(content);
    McapMessage message;
    message.channel = cursor.Take<std::uint16_t>();
    message.sequence = cursor.Take<std::uint32_t>();
    message.log_time = TimeOf(cursor.Take<std::uint64_t>());
    message.publish_time = TimeOf(cursor.Take<std::uint64_t>());
    if (!cursor.is_sound()) return McapDamageKind::kMalformed;
    message.data = cursor.rest();
    const auto channel = content_.channels.find(message.channel);
    if (channel == content_.channels.end()) return McapDamageKind::kNoChannel;
    ++content_.messages;
    if (on_message_) on_message_(channel->second, message);
    return {};
  }

  struct Chunk {
    std::uint32_t crc = 0;
    std::string compression;
    BytesView records;
  };

  static std::optional<Chunk> ChunkOf(BytesView content) {
    Cursor cursor(content);
    Chunk chunk;
    (void)cursor.Take<std::uint64_t>();  // first and last time
    (void)cursor.Take<std::uint64_t>();
    const auto size = cursor.Take<std::uint64_t>();
    chunk.crc = cursor.Take<std::uint32_t>();
    chunk.compression = cursor.TakeText();
    chunk.records = cursor.TakeBytes(cursor.Take<std::uint64_t>());
    if (!cursor.is_sound() || !cursor.rest().empty()) return {};
    if (chunk.compression.empty() && chunk.records.size() != size) return {};
    return chunk;
  }

  // Without a CRC (zero, as the specification allows) nothing is known against the bytes.
  static bool HasRightCrc(const Chunk& chunk) {
    return chunk.crc == 0 || chunk.crc == CrcOf(chunk.records);
  }

  std::optional<McapDamageKind> TakeChunk(BytesView content, std::size_t at) {
    const std::optional<Chunk> chunk = ChunkOf(content);
    if (!chunk) return McapDamageKind::kMalformed;
    if (!chunk->compression.empty()) return McapDamageKind::kCompressed;
    if (!HasRightCrc(*chunk)) return McapDamageKind::kWrongCrc;
    ++content_.chunks;
    BytesView rest = chunk->records;
    while (!rest.empty()) {
      const std::optional<Record> record = RecordAt(rest);
      if (!record) {
        content_.damages.push_back({McapDamageKind::kMalformed, at});
        break;
      }
      const auto damage = record->op == Op::kMessage ? TakeMessage(record->content)
                          : record->op == Op::kSchema || record->op == Op::kChannel
                              ? Take(*record, at)
                              : std::optional(McapDamageKind::kMalformed);
      if (damage) content_.damages.push_back({*damage, at});
      rest = rest.subspan(mcap::kRecordHead + record->content.size());
    }
    return {};
  }

  // The next place from `from` on where a whole chunk with the right CRC begins, or the data's end
  // with the summary behind it; the end of the file when there is none.
  std::size_t NextChunk(std::size_t from) const {
    for (std::size_t at = from; at + mcap::kRecordHead <= file_.size(); ++at) {
      const auto op = static_cast<Op>(file_[at]);
      if (op != Op::kChunk && op != Op::kDataEnd) continue;
      const std::optional<Record> record = RecordAt(file_.subspan(at));
      if (!record) continue;
      if (op == Op::kDataEnd) {
        if (record->content.size() == 4 && EndsAsItShould()) return at;
        continue;
      }
      const std::optional<Chunk> chunk = ChunkOf(record->content);
      if (chunk && chunk->crc != 0 && HasRightCrc(*chunk)) return at;
    }
    return file_.size();
  }

  bool EndsAsItShould() const {
    return file_.size() >= mcap::kMagic.size() &&
           std::memcmp(file_.last(mcap::kMagic.size()).data(),
                       mcap::kMagic.data(),
                       mcap::kMagic.size()) == 0;
  }

  BytesView file_;
  const std::function<void(const McapChannel&, const McapMessage&)>& on_message_;
  std::map<std::uint16_t, McapSchema> schemas_;
  McapContent content_;
  bool is_behind_data_ = false;
};

}  // namespace

Result<McapContent, McapFailure> ReadMcap(
    BytesView file, const std::function<void(const McapChannel&, const McapMessage&)>& on_message) {
  if (file.size() < mcap::kMagic.size() ||
      std::memcmp(file.data(), mcap::kMagic.data(), mcap::kMagic.size()) != 0) {
    return Failure{McapFailure::kNotMcap};
  }
  return Reading(file, on_message).Run();
}

}  // namespace tbm
