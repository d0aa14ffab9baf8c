// When a polled inclinometer asks, waits, reconnects and believes: all of it on a fake clock.
#include "devices/inclinometer/polled_inclinometer.h"

#include <functional>

#include <gtest/gtest.h>

#include "tests/devices/inclinometer/fake_line.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using test::FakeClock;
using test::FakeSleeper;

using Answer = Result<WireReading, InclinometerFailure>;

// Answers what the test says, after the time the test says.
class FakeWire final : public TiltWire {
 public:
  explicit FakeWire(FakeClock& clock) : clock_(clock) {}

  std::optional<InclinometerFailure> Open() override {
    ++opens;
    if (!open_failure) is_open_ = true;
    return open_failure;
  }
  void Close() override { is_open_ = false; }
  bool IsOpen() const override { return is_open_; }
  std::size_t Discard() override { return std::exchange(stale_bytes, 0); }
  Answer Ask(const InclinometerConfig& instrument) override {
    asked_at.push_back(clock_.Steady());
    asked.push_back(instrument.address);
    clock_.Advance(answer_takes);
    return answer(instrument);
  }

  std::optional<InclinometerFailure> open_failure;
  std::chrono::nanoseconds answer_takes = 5ms;
  std::function<Answer(const InclinometerConfig&)> answer = [](const InclinometerConfig&) {
    return Answer(WireReading{{0.01, -0.02}, 21.5, 8, 9});
  };
  std::size_t stale_bytes = 0;
  int opens = 0;
  std::vector<FakeClock::SteadyTime> asked_at;
  std::vector<int> asked;

 private:
  FakeClock& clock_;
  bool is_open_ = false;
};

class Polled : public testing::Test {
 protected:
  Polled() {
    config_.driver = InclinometerDriver::kModbus;
    config_.name = "target";
    config_.port.baud = 9600;
    auto wire = std::make_unique<FakeWire>(clock_);
    wire_ = wire.get();
    bus_ = std::make_shared<TiltBus>(
        std::move(wire), TiltBus::Timing{200ms, 100ms, 5s}, clock_, sleeper_);
    driver_ = std::make_unique<PolledInclinometer>(config_, bus_, clock_, false);
  }
  Result<TiltSample, InclinometerFailure> Read(std::chrono::nanoseconds wait = 1s) {
    return driver_->Read(clock_.Steady() + wait);
  }
  void Fail(InclinometerFailure failure) {
    wire_->answer = [failure](const InclinometerConfig&) { return Answer(Failure{failure}); };
  }
  void Succeed() {
    wire_->answer = [](const InclinometerConfig&) {
      return Answer(WireReading{{0.01, -0.02}, 21.5, 8, 9});
    };
  }

  FakeClock clock_;
  FakeSleeper sleeper_{clock_};
  InclinometerConfig config_;
  FakeWire* wire_ = nullptr;
  std::shared_ptr<TiltBus> bus_;
  std::unique_ptr<PolledInclinometer> driver_;
};

TEST_F(Polled, StampsTheMiddleBetweenQuestionAndAnswer) {
  config_.latency = 40ms;
  PolledInclinometer driver(config_, bus_, clock_, false);
  wire_->answer_takes = 30ms;
  const Timestamp sent = clock_.Now();
  const auto sample = driver.Read(clock_.Steady() + 1s);
  ASSERT_TRUE(sample);
  // 8 characters of 10 bits at 9600 baud out, 9 back: sensed between 8.333 and 20.625 ms.
  EXPECT_NEAR(
      SecondsBetween(sent, sample->sensed_at), 0.5 * (8.33333e-3 + 20.625e-3) - 0.040, 1e-8);
  EXPECT_EQ(sample->raw.beta_rad, 0.01);
  EXPECT_EQ(sample->raw.gamma_rad, -0.02);
  EXPECT_EQ(sample->temperature_celsius, 21.5);
}

TEST_F(Polled, StampsTheMiddleOfAllWhenAnAdapterCollectsBytes) {
  wire_->answer_takes = 4ms;  // less than the line time: the adapter told nothing about it
  const Timestamp sent = clock_.Now();
  const auto sample = Read();
  ASSERT_TRUE(sample);
  EXPECT_NEAR(SecondsBetween(sent, sample->sensed_at), 2e-3, 1e-9);
}

TEST_F(Polled, AStepOfCivilTimeBetweenReadsMovesOnlyTheStamps) {
  ASSERT_TRUE(Read());
  clock_.StepCivilTime(-3600s);
  const Timestamp stepped = clock_.Now();
  const auto sample = Read();
  ASSERT_TRUE(sample);
  EXPECT_GE(sample->sensed_at, stepped);
  EXPECT_LT(SecondsBetween(stepped, sample->sensed_at), 0.1);
}

TEST_F(Polled, KeepsTheBeatAndNeverCatchesUp) {
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(Read());
  for (std::size_t i = 2; i < 5; ++i) {
    EXPECT_EQ(wire_->asked_at[i] - wire_->asked_at[i - 1], config_.poll_period);
  }
  clock_.Advance(10s);
  ASSERT_TRUE(Read());
  ASSERT_TRUE(Read());
  ASSERT_TRUE(Read());
  EXPECT_GE(wire_->asked_at[7] - wire_->asked_at[6], config_.poll_period);
}

TEST_F(Polled, WaitsForTheDeadlineWhenNothingIsDue) {
  ASSERT_TRUE(Read());
  ASSERT_TRUE(Read());
  const auto before = clock_.Steady();
  const auto sample = Read(10ms);
  ASSERT_FALSE(sample);
  EXPECT_EQ(sample.error(), InclinometerFailure::kNotDue);
  EXPECT_EQ(clock_.Steady() - before, 10ms);
  EXPECT_EQ(wire_->asked.size(), 2u);
  EXPECT_FALSE(driver_->Health().last_failure);
}

TEST_F(Polled, LeavesTheWireQuietAfterEveryError) {
  ASSERT_TRUE(Read());
  for (const auto failure : {InclinometerFailure::kNoReply,
                             InclinometerFailure::kGarbled,
                             InclinometerFailure::kOtherInstrument,
                             InclinometerFailure::kException}) {
    Fail(failure);
    const auto failed = Read();
    ASSERT_FALSE(failed);
    EXPECT_EQ(failed.error(), failure);
    const auto error_at = clock_.Steady();
    Succeed();
    ASSERT_TRUE(Read());
    EXPECT_EQ(wire_->asked_at.back() - error_at, 200ms);
  }
}

TEST_F(Polled, CountsWhatCameInUnasked) {
  ASSERT_TRUE(Read());
  wire_->stale_bytes = 9;
  ASSERT_TRUE(Read());
  ASSERT_TRUE(Read());
  EXPECT_EQ(driver_->Health().counters.stale, 1u);
}

TEST_F(Polled, TriesAMissingPortEveryReconnectPeriodWithoutSpinning) {
  wire_->open_failure = InclinometerFailure::kPortMissing;
  const auto start = clock_.Steady();
  int calls = 0;
  while (clock_.Steady() - start < 10s) {
    const auto sample = Read(30ms);
    ASSERT_FALSE(sample);
    ++calls;
    ASSERT_LT(calls, 1000) << "spins";
  }
  EXPECT_NEAR(wire_->opens, 100, 2);
  EXPECT_EQ(driver_->Health().state, InclinometerState::kClosed);
  EXPECT_EQ(driver_->Health().last_failure, InclinometerFailure::kPortMissing);
  wire_->open_failure.reset();
  EXPECT_TRUE(Read());
}

TEST_F(Polled, GoesThroughItsLife) {
  EXPECT_EQ(driver_->Health().state, InclinometerState::kClosed);
  Fail(InclinometerFailure::kNoReply);
  ASSERT_FALSE(Read());
  EXPECT_EQ(driver_->Health().state, InclinometerState::kOpening);
  Succeed();
  ASSERT_TRUE(Read());
  EXPECT_EQ(driver_->Health().state, InclinometerState::kStreaming);
  clock_.Advance(config_.silent_after - 1ns);
  EXPECT_EQ(driver_->Health().state, InclinometerState::kStreaming);
  clock_.Advance(1ns);
  EXPECT_EQ(driver_->Health().state, InclinometerState::kSilent);
  ASSERT_TRUE(Read());
  EXPECT_EQ(driver_->Health().state, InclinometerState::kStreaming);
  Fail(InclinometerFailure::kHungUp);
  ASSERT_FALSE(Read());
  EXPECT_EQ(driver_->Health().state, InclinometerState::kClosed);
  Succeed();
  ASSERT_TRUE(Read());
  EXPECT_EQ(driver_->Health().state, InclinometerState::kStreaming);
  EXPECT_EQ(driver_->Health().counters.reconnects, 1u);
}

TEST_F(Polled, AnOpenPortThatNeverAnswersBecomesSilent) {
  Fail(InclinometerFailure::kNoReply);
  ASSERT_FALSE(Read());
  clock_.Advance(config_.silent_after);
  EXPECT_EQ(driver_->Health().state, InclinometerState::kSilent);
}

TEST_F(Polled, ReopensAPortThatStaysDead) {
  ASSERT_TRUE(Read());
  Fail(InclinometerFailure::kNoReply);
  const auto start = clock_.Steady();
  while (clock_.Steady() - start < 11s) ASSERT_FALSE(Read());
  EXPECT_EQ(wire_->opens, 3);
}

TEST_F(Polled, ImplausibleReadingsComeOutAsFailures) {
  ASSERT_TRUE(Read());
  wire_->answer = [](const InclinometerConfig&) {
    return Answer(WireReading{{DegToRad(45.0), 0.0}, {}, 8, 9});
  };
  const auto sample = Read();
  ASSERT_FALSE(sample);
  EXPECT_EQ(sample.error(), InclinometerFailure::kOutOfRange);
  EXPECT_EQ(driver_->Health().counters.implausible, 1u);
  EXPECT_EQ(driver_->Health().counters.good, 1u);
}

TEST_F(Polled, ADeadNeighbourIsAskedOnlyOnceASecond) {
  InclinometerConfig dead = config_;
  dead.address = 2;
  PolledInclinometer alive_one(config_, bus_, clock_, true);
  PolledInclinometer dead_one(dead, bus_, clock_, true);
  wire_->answer = [this](const InclinometerConfig& instrument) {
    if (instrument.address == 1) return Answer(WireReading{{0.01, -0.02}, {}, 8, 9});
    clock_.Advance(95ms);
    return Answer(Failure{InclinometerFailure::kNoReply});
  };
  const auto start = clock_.Steady();
  int good = 0;
  while (clock_.Steady() - start < 20s) {
    if (alive_one.Read(clock_.Steady() + 20ms)) ++good;
    EXPECT_FALSE(dead_one.Read(clock_.Steady()));
  }
  EXPECT_LE(std::ranges::count(wire_->asked, 2), 24);
  EXPECT_GT(good, 200);
  EXPECT_EQ(alive_one.Health().state, InclinometerState::kStreaming);
}

}  // namespace
}  // namespace tbm
