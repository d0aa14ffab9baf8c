#include "guidance/journal/mcap_repair.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

#include "guidance/journal/mcap_writer.h"

namespace tbm {
namespace {

constexpr std::size_t kChunkBytes = 64 * 1024;
constexpr std::int64_t kChunkNs = 1'000'000'000;

struct Place {
  std::uint64_t offset = 0;
  Timestamp log_time;
};

class Rewriting {
 public:
  Rewriting(BytesView file, std::string_view program) : file_(file), writer_(program) {
    Append(writer_.Begin());
  }

  void Add(const McapChannel& channel, const McapMessage& message) {
    const auto id = IdOf(channel, message.channel);
    if (!id) return;
    CloseChunkBefore(message);
    writer_.AddMessage(*id, message.sequence, message.log_time, message.publish_time, message.data);
    places_.push_back(
        {static_cast<std::uint64_t>(message.data.data() - file_.data()), message.log_time});
    repair_.first = std::min(repair_.first.value_or(message.log_time), message.log_time);
    repair_.last = std::max(repair_.last.value_or(message.log_time), message.log_time);
    CountMissing(channel.topic, message);
  }

  McapRepair End(McapContent content) {
    Append(writer_.End());
    for (const McapDamage& damage : content.damages) repair_.losses.push_back(LossAt(damage));
    repair_.content = std::move(content);
    return std::move(repair_);
  }

 private:
  std::optional<std::uint16_t> IdOf(const McapChannel& channel, std::uint16_t old_id) {
    const auto known = ids_.find(old_id);
    if (known != ids_.end()) return known->second;
    // One more than the format has numbers for, when it is not written by us.
    if (ids_.size() == std::numeric_limits<std::uint16_t>::max()) return {};
    const auto id = writer_.AddChannel(channel.topic, channel.message_encoding, channel.schema);
    return ids_.emplace(old_id, id).first->second;
  }

  void CloseChunkBefore(const McapMessage& message) {
    const std::int64_t second = message.log_time.ns / kChunkNs;
    if (writer_.gathered_bytes() + message.data.size() >= kChunkBytes || second != chunk_second_) {
      Append(writer_.TakeChunk());
    }
    chunk_second_ = second;
  }

  void CountMissing(const std::string& topic, const McapMessage& message) {
    const auto [last, is_first] = sequences_.try_emplace(message.channel, message.sequence);
    if (!is_first && message.sequence > last->second) {
      const std::uint64_t missing = message.sequence - last->second - 1;
      if (missing > 0) repair_.missing[topic] += missing;
    }
    last->second = message.sequence;
  }

  McapLoss LossAt(const McapDamage& damage) const {
    McapLoss loss{damage, {}, {}};
    const auto behind = std::lower_bound(
        places_.begin(), places_.end(), damage.offset, [](const Place& place, std::uint64_t at) {
          return place.offset < at;
        });
    if (behind != places_.begin()) loss.before = std::prev(behind)->log_time;
    if (behind != places_.end()) loss.behind = behind->log_time;
    return loss;
  }

  void Append(const Bytes& bytes) {
    repair_.bytes.insert(repair_.bytes.end(), bytes.begin(), bytes.end());
  }

  BytesView file_;
  McapWriter writer_;
  McapRepair repair_;
  std::map<std::uint16_t, std::uint16_t> ids_;  // in the damaged file -> in the good one
  std::map<std::uint16_t, std::uint32_t> sequences_;
  std::vector<Place> places_;
  std::int64_t chunk_second_ = 0;
};

Result<McapRepair, McapFailure> Rewritten(BytesView file, std::string_view program) {
  Rewriting rewriting(file, program);
  const auto content = ReadMcap(file, [&](const McapChannel& channel, const McapMessage& message) {
    rewriting.Add(channel, message);
  });
  if (!content) return Failure{content.error()};
  return rewriting.End(*content);
}

}  // namespace

Result<McapRepair, McapFailure> RepairMcap(BytesView file, std::string_view program) {
  Result<McapRepair, McapFailure> repair = Rewritten(file, program);
  if (repair || file.size() < mcap::kMagic.size()) return repair;
  Bytes mended(file.begin(), file.end());
  std::transform(mcap::kMagic.begin(), mcap::kMagic.end(), mended.begin(), [](unsigned char c) {
    return static_cast<std::byte>(c);
  });
  Result<McapRepair, McapFailure> second = Rewritten(mended, program);
  if (!second || second->content.messages == 0) return repair;
  McapRepair found = std::move(second).value();
  found.losses.insert(found.losses.begin(), {{McapDamageKind::kMalformed, 0}, {}, found.first});
  return found;
}

}  // namespace tbm
