#include "guidance/journal/mcap_writer.h"

#include <algorithm>
#include <span>
#include <type_traits>

#include <zlib.h>

#include "pose/base/check.h"

namespace tbm {
namespace {

using mcap::Op;

template <class Number>
void Put(Bytes& bytes, Number number) {
  static_assert(std::is_unsigned_v<Number>);
  for (std::size_t i = 0; i < sizeof(Number); ++i) {
    bytes.push_back(static_cast<std::byte>(number >> (8 * i)));
  }
}

void PutBytes(Bytes& bytes, BytesView added) {
  bytes.insert(bytes.end(), added.begin(), added.end());
}

void PutText(Bytes& bytes, std::string_view text) {
  Put(bytes, static_cast<std::uint32_t>(text.size()));
  PutBytes(bytes, std::as_bytes(std::span(text)));
}

// Number of channel -> number, as both MCAP maps of this kind are written.
void PutMap(Bytes& bytes, const std::map<std::uint16_t, std::uint64_t>& map) {
  Put(bytes, static_cast<std::uint32_t>(10 * map.size()));
  for (const auto& [key, value] : map) {
    Put(bytes, key);
    Put(bytes, value);
  }
}

void PutRecord(Bytes& bytes, Op op, BytesView content) {
  Put(bytes, static_cast<std::uint8_t>(op));
  Put(bytes, static_cast<std::uint64_t>(content.size()));
  PutBytes(bytes, content);
}

std::uint32_t Crc(BytesView bytes, std::uint32_t before = 0) {
  return static_cast<std::uint32_t>(
      ::crc32_z(before, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

std::uint64_t Nanoseconds(Timestamp time) {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(time.ns, 0));
}

}  // namespace

McapWriter::McapWriter(std::string_view library) : library_(library) {}

Bytes McapWriter::Handed(Bytes bytes) {
  written_ += bytes.size();
  return bytes;
}

Bytes McapWriter::Begin() {
  TBM_CHECK(written_ == 0);
  Bytes bytes;
  PutBytes(bytes, std::as_bytes(std::span(mcap::kMagic)));
  Bytes header;
  PutText(header, "");  // no profile
  PutText(header, library_);
  PutRecord(bytes, Op::kHeader, header);
  return Handed(std::move(bytes));
}

std::uint16_t McapWriter::AddChannel(std::string_view topic,
                                     std::string_view message_encoding,
                                     const McapSchema& schema) {
  TBM_CHECK(channel_count_ < std::numeric_limits<std::uint16_t>::max());
  const auto id = static_cast<std::uint16_t>(++channel_count_);
  Bytes content;
  // Zero is no schema's number: it says that there is none. Each channel brings its own.
  const bool has_schema = schema != McapSchema{};
  if (has_schema) {
    Put(content, id);
    PutText(content, schema.name);
    PutText(content, schema.encoding);
    PutText(content, schema.text);
    PutRecord(schemas_, Op::kSchema, content);
    PutRecord(pending_, Op::kSchema, content);
    content.clear();
    ++schema_count_;
  }
  Put(content, id);
  Put(content, has_schema ? id : std::uint16_t{0});
  PutText(content, topic);
  PutText(content, message_encoding);
  Put(content, std::uint32_t{0});  // no metadata
  PutRecord(channels_, Op::kChannel, content);
  PutRecord(pending_, Op::kChannel, content);
  return id;
}

void McapWriter::AddMessage(std::uint16_t channel,
                            std::uint32_t sequence,
                            Timestamp log_time,
                            Timestamp publish_time,
                            BytesView data) {
  TBM_CHECK(channel >= 1 && channel <= channel_count_);
  const std::uint64_t time = Nanoseconds(log_time);
  chunk_index_[channel].emplace_back(time, chunk_.size());
  chunk_first_time_ = std::min(chunk_first_time_, time);
  chunk_last_time_ = std::max(chunk_last_time_, time);
  ++message_count_[channel];
  Put(chunk_, static_cast<std::uint8_t>(Op::kMessage));
  Put(chunk_, static_cast<std::uint64_t>(22 + data.size()));
  Put(chunk_, channel);
  Put(chunk_, sequence);
  Put(chunk_, time);
  Put(chunk_, Nanoseconds(publish_time));
  PutBytes(chunk_, data);
}

Bytes McapWriter::TakeChunk() {
  Bytes bytes;
  std::swap(bytes, pending_);
  if (chunk_.empty()) return Handed(std::move(bytes));

  Index index;
  index.start = written_ + bytes.size();
  index.first_time = chunk_first_time_;
  index.last_time = chunk_last_time_;
  index.records_size = chunk_.size();
  Bytes content;
  content.reserve(chunk_.size() + 64);
  Put(content, index.first_time);
  Put(content, index.last_time);
  Put(content, index.records_size);
  Put(content, Crc(chunk_));
  PutText(content, "");  // no compression
  Put(content, index.records_size);
  PutBytes(content, chunk_);
  PutRecord(bytes, Op::kChunk, content);
  index.length = mcap::kRecordHead + content.size();

  const std::size_t indexes_from = bytes.size();
  for (const auto& [channel, entries] : chunk_index_) {
    index.offset_of_channel[channel] = written_ + bytes.size();
    content.clear();
    Put(content, channel);
    Put(content, static_cast<std::uint32_t>(16 * entries.size()));
    for (const auto& [time, offset] : entries) {
      Put(content, time);
      Put(content, offset);
    }
    PutRecord(bytes, Op::kMessageIndex, content);
  }
  index.index_length = bytes.size() - indexes_from;
  indexes_.push_back(std::move(index));
  chunk_.clear();
  chunk_index_.clear();
  chunk_first_time_ = std::numeric_limits<std::uint64_t>::max();
  chunk_last_time_ = 0;
  return Handed(std::move(bytes));
}

Bytes McapWriter::End() {
  Bytes bytes = TakeChunk();
  const std::uint64_t before = written_ - bytes.size();
  Bytes content;
  Put(content, std::uint32_t{0});  // no CRC over all data: each chunk has its own
  PutRecord(bytes, Op::kDataEnd, content);

  const std::size_t summary_from = bytes.size();
  const std::uint64_t summary_start = before + summary_from;
  Bytes offsets;
  const auto add_group = [&](Op op, BytesView records) {
    if (records.empty()) return;
    content.clear();
    Put(content, static_cast<std::uint8_t>(op));
    Put(content, before + bytes.size());
    Put(content, static_cast<std::uint64_t>(records.size()));
    PutRecord(offsets, Op::kSummaryOffset, content);
    PutBytes(bytes, records);
  };
  add_group(Op::kSchema, schemas_);
  add_group(Op::kChannel, channels_);

  std::uint64_t messages = 0;
  std::uint64_t first_time = indexes_.empty() ? 0 : indexes_.front().first_time;
  std::uint64_t last_time = 0;
  Bytes chunk_indexes;
  for (const Index& index : indexes_) {
    first_time = std::min(first_time, index.first_time);
    last_time = std::max(last_time, index.last_time);
    content.clear();
    Put(content, index.first_time);
    Put(content, index.last_time);
    Put(content, index.start);
    Put(content, index.length);
    PutMap(content, index.offset_of_channel);
    Put(content, index.index_length);
    PutText(content, "");
    Put(content, index.records_size);
    Put(content, index.records_size);
    PutRecord(chunk_indexes, Op::kChunkIndex, content);
  }
  for (const auto& [channel, count] : message_count_) messages += count;
  Bytes statistics;
  content.clear();
  Put(content, messages);
  Put(content, schema_count_);
  Put(content, std::uint32_t{channel_count_});
  Put(content, std::uint32_t{0});  // attachments
  Put(content, std::uint32_t{0});  // metadata
  Put(content, static_cast<std::uint32_t>(indexes_.size()));
  Put(content, first_time);
  Put(content, last_time);
  PutMap(content, message_count_);
  PutRecord(statistics, Op::kStatistics, content);
  add_group(Op::kStatistics, statistics);
  add_group(Op::kChunkIndex, chunk_indexes);

  const std::uint64_t offsets_start = before + bytes.size();
  PutBytes(bytes, offsets);
  // The footer's CRC covers the summary and the footer itself up to the CRC.
  Put(bytes, static_cast<std::uint8_t>(Op::kFooter));
  Put(bytes, std::uint64_t{20});
  Put(bytes, summary_start);
  Put(bytes, offsets_start);
  Put(bytes, Crc(BytesView(bytes).subspan(summary_from)));
  PutBytes(bytes, std::as_bytes(std::span(mcap::kMagic)));
  written_ = before + bytes.size();
  return bytes;
}

}  // namespace tbm
