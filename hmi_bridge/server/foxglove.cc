#include "hmi_bridge/server/foxglove.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "hmi_bridge/server/json_text.h"
#include "pose/base/check.h"

namespace tbm::hmi {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMostSubscriptions = 256;
constexpr std::size_t kMostAnswers = 8;
constexpr int kWarning = 1;

std::optional<std::uint32_t> Id(const Json& json) {
  if (!json.is_number_unsigned() || json.get<std::uint64_t>() > UINT32_MAX) return std::nullopt;
  return static_cast<std::uint32_t>(json.get<std::uint64_t>());
}

std::optional<std::uint32_t> Id(const Json& object, const char* key) {
  if (!object.is_object() || !object.contains(key)) return std::nullopt;
  return Id(object[key]);
}

// The list an operation is about; empty when it has none.
const Json& List(const Json& operation, const char* key) {
  static const Json kNone = Json::array();
  if (!operation.contains(key) || !operation[key].is_array()) return kNone;
  return operation[key];
}

}  // namespace

std::string FoxgloveServerInfo(std::string_view name, std::string_view session_id) {
  return fmt::format(R"({{"op":"serverInfo","name":{},"capabilities":[],"supportedEncodings":[],)"
                     R"("metadata":{{}},"sessionId":{}}})",
                     Quoted(name),
                     Quoted(session_id));
}

std::string FoxgloveAdvertise(const std::vector<RawChannel>& channels) {
  std::string text = R"({"op":"advertise","channels":[)";
  for (std::size_t i = 0; i < channels.size(); ++i) {
    text += fmt::format(
        R"({}{{"id":{},"topic":{},"encoding":"cdr","schemaName":{},"schemaEncoding":"omgidl","schema":{}}})",
        i == 0 ? "" : ",",
        i,
        Quoted(channels[i].topic),
        Quoted(channels[i].schema_name),
        Quoted(channels[i].schema_text));
  }
  return text + "]}";
}

std::string FoxgloveStatus(int level, std::string_view text) {
  return fmt::format(R"({{"op":"status","level":{},"message":{}}})", level, Quoted(text));
}

void PutFoxgloveHead(std::uint32_t subscription, Timestamp at, std::span<std::byte> into) {
  TBM_CHECK(into.size() >= kFoxgloveHeadBytes);
  into[0] = std::byte{0x01};
  for (unsigned i = 0; i < 4; ++i) into[1 + i] = static_cast<std::byte>(subscription >> (8 * i));
  const auto ns = static_cast<std::uint64_t>(at.ns);
  for (unsigned i = 0; i < 8; ++i) into[5 + i] = static_cast<std::byte>(ns >> (8 * i));
}

FoxgloveSubscriptions::Outcome FoxgloveSubscriptions::TakeText(std::string_view text) {
  Outcome outcome;
  const auto tell = [&outcome](std::string_view what) {
    if (outcome.answers.size() < kMostAnswers) {
      outcome.answers.push_back(FoxgloveStatus(kWarning, what));
    }
  };
  const Json operation =
      NestsDeeperThan(text, 8) ? Json() : Json::parse(text.begin(), text.end(), nullptr, false);
  if (!operation.is_object() || !operation.contains("op") || !operation["op"].is_string()) {
    tell("not understood: no JSON object with op");
    return outcome;
  }
  const std::string op = operation["op"].get<std::string>();
  if (op == "subscribe") {
    for (const Json& wish : List(operation, "subscriptions")) {
      const auto id = Id(wish, "id");
      const auto channel = Id(wish, "channelId");
      if (!id || !channel || *channel >= listeners_.size()) {
        tell("subscribe: there is no such channel");
      } else if (channel_of_.size() >= kMostSubscriptions) {
        tell(fmt::format("subscribe: at most {} subscriptions", kMostSubscriptions));
      } else if (!channel_of_.emplace(*id, *channel).second) {
        tell(fmt::format("subscribe: id {} is in use", *id));
      } else if (listeners_[*channel]++ == 0) {
        outcome.begun.push_back(*channel);
      }
    }
  } else if (op == "unsubscribe") {
    for (const Json& wish : List(operation, "subscriptionIds")) {
      const auto id = Id(wish);
      const auto found = id ? channel_of_.find(*id) : channel_of_.end();
      if (found == channel_of_.end()) {
        tell("unsubscribe: there is no such subscription");
        continue;
      }
      if (--listeners_[found->second] == 0) outcome.ended.push_back(found->second);
      channel_of_.erase(found);
    }
  } else {
    tell(fmt::format("{}: this server is read-only and knows subscribe and unsubscribe",
                     op.substr(0, 40)));
  }
  return outcome;
}

FoxgloveSubscriptions::Outcome FoxgloveSubscriptions::TakeBinary() const {
  return {{FoxgloveStatus(kWarning, "binary messages are not taken: this server is read-only")},
          {},
          {}};
}

std::vector<std::size_t> FoxgloveSubscriptions::Channels() const {
  std::vector<std::size_t> channels;
  for (std::size_t i = 0; i < listeners_.size(); ++i) {
    if (listeners_[i] > 0) channels.push_back(i);
  }
  return channels;
}

std::size_t SampleQueue::Push(Waiting waiting) {
  size_bytes_ += waiting.sample->cdr.size();
  waiting_.push_back(std::move(waiting));
  std::size_t dropped = 0;
  while (waiting_.size() > most_samples_ || size_bytes_ > most_bytes_) {
    size_bytes_ -= waiting_.front().sample->cdr.size();
    waiting_.pop_front();
    ++dropped;
  }
  return dropped;
}

SampleQueue::Waiting SampleQueue::Pop() {
  Waiting first = std::move(waiting_.front());
  waiting_.pop_front();
  size_bytes_ -= first.sample->cdr.size();
  return first;
}

}  // namespace tbm::hmi
