#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <vector>

#include "devices/bus/byte_link.h"
#include "devices/bus/sleeper.h"
#include "tests/support/fake_clock.h"

namespace tbm::test {

class FakeSleeper final : public Sleeper {
 public:
  explicit FakeSleeper(FakeClock& clock) : clock_(clock) {}
  void SleepUntil(std::chrono::steady_clock::time_point wake) override {
    ++sleeps;
    clock_.AdvanceTo(wake);
  }
  int sleeps = 0;

 private:
  FakeClock& clock_;
};

// A serial line on which time passes only while somebody waits. What the test puts on it arrives at
// its instant; a hook sees what is written.
class FakeLink final : public ByteLink {
 public:
  using Bytes = std::vector<std::uint8_t>;

  explicit FakeLink(FakeClock& clock) : clock_(clock) {}

  std::optional<LinkFailure> Open() override {
    ++opens;
    if (open_failure) return open_failure;
    is_open_ = true;
    arriving_.clear();
    return std::nullopt;
  }
  void Close() override { is_open_ = false; }
  bool IsOpen() const override { return is_open_; }

  std::optional<LinkFailure> Write(std::span<const std::uint8_t> bytes) override {
    if (hung_up) return LinkFailure::kHungUp;
    written.emplace_back(bytes.begin(), bytes.end());
    if (on_write) on_write(written.back());
    return std::nullopt;
  }
  Result<std::size_t, LinkFailure> Read(std::span<std::uint8_t> into, SteadyTime until) override {
    if (hung_up) return Failure{LinkFailure::kHungUp};
    if (arriving_.empty() || arriving_.front().at > until) {
      clock_.AdvanceTo(until);
      return Failure{LinkFailure::kTimeout};
    }
    clock_.AdvanceTo(arriving_.front().at);
    std::size_t count = 0;
    while (!arriving_.empty() && arriving_.front().at <= clock_.Steady() && count < into.size()) {
      into[count++] = arriving_.front().byte;
      arriving_.pop_front();
    }
    return count;
  }
  std::size_t Discard() override {
    std::size_t count = 0;
    for (; !arriving_.empty() && arriving_.front().at <= clock_.Steady(); ++count) {
      arriving_.pop_front();
    }
    return count;
  }

  void ArriveAt(SteadyTime at, const Bytes& bytes) {
    auto place = std::ranges::upper_bound(arriving_, at, {}, &Arriving::at);
    for (const std::uint8_t byte : bytes) place = arriving_.insert(place, {at, byte}) + 1;
  }

  std::optional<LinkFailure> open_failure;
  bool hung_up = false;
  int opens = 0;
  std::vector<Bytes> written;
  std::function<void(const Bytes&)> on_write;

 private:
  struct Arriving {
    SteadyTime at;
    std::uint8_t byte;
  };
  FakeClock& clock_;
  bool is_open_ = false;
  std::deque<Arriving> arriving_;
};

}  // namespace tbm::test
