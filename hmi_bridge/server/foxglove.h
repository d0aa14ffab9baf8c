#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hmi_bridge/server/console_source.h"
#include "pose/base/time.h"

namespace tbm::hmi {

// foxglove.websocket.v1, the server's half, without capabilities: a tool may listen, nothing else.

std::string FoxgloveServerInfo(std::string_view name, std::string_view session_id);
std::string FoxgloveAdvertise(const std::vector<RawChannel>& channels);
std::string FoxgloveStatus(int level, std::string_view text);  // 0 info, 1 warning, 2 error

// One sample for all who listen to its channel.
struct Sample {
  std::size_t channel = 0;
  Timestamp at;
  std::vector<std::byte> cdr;
};

// 0x01, the subscription, nanoseconds; the sample's bytes follow.
inline constexpr std::size_t kFoxgloveHeadBytes = 13;
void PutFoxgloveHead(std::uint32_t subscription, Timestamp at, std::span<std::byte> into);

// What one tool has asked for.
class FoxgloveSubscriptions {
 public:
  explicit FoxgloveSubscriptions(std::size_t channels) : listeners_(channels, 0) {}

  struct Outcome {
    std::vector<std::string> answers;  // status messages
    std::vector<std::size_t> begun;    // channels that were not listened to before
    std::vector<std::size_t> ended;
  };
  Outcome TakeText(std::string_view text);
  Outcome TakeBinary() const;

  // Calls `take` with the id of each subscription to the channel.
  template <class Take>
  void Each(std::size_t channel, Take take) const {
    if (channel >= listeners_.size() || listeners_[channel] == 0) return;
    for (const auto& [id, listened] : channel_of_) {
      if (listened == channel) take(id);
    }
  }
  std::vector<std::size_t> Channels() const;

 private:
  std::map<std::uint32_t, std::size_t> channel_of_;
  std::vector<int> listeners_;
};

// Samples that wait for a tool. Bounded: the oldest make room.
class SampleQueue {
 public:
  SampleQueue(std::size_t most_samples, std::size_t most_bytes)
      : most_samples_(most_samples), most_bytes_(most_bytes) {}

  struct Waiting {
    std::uint32_t subscription = 0;
    std::shared_ptr<const Sample> sample;
  };
  // How many had to go.
  std::size_t Push(Waiting waiting);
  bool empty() const { return waiting_.empty(); }
  Waiting Pop();
  std::size_t size() const { return waiting_.size(); }
  std::size_t size_bytes() const { return size_bytes_; }

 private:
  const std::size_t most_samples_;
  const std::size_t most_bytes_;
  std::size_t size_bytes_ = 0;
  std::deque<Waiting> waiting_;
};

}  // namespace tbm::hmi
