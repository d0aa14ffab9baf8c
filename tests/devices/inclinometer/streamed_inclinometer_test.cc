#include "devices/inclinometer/streamed_inclinometer.h"

#include <gtest/gtest.h>

#include "tests/devices/inclinometer/fake_line.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using test::FakeClock;
using test::FakeLink;
using test::FakeSleeper;
using Bytes = FakeLink::Bytes;

Bytes Sent(double x_deg) {
  const FrameBytes bytes = EncodeFrame(
      FrameFamily::kRion68, EncodeAngles(0, FrameLayout::kFourByteTemperature, {x_deg, 0.5, 20.0}));
  return {bytes.begin(), bytes.end()};
}

class Streamed : public testing::Test {
 protected:
  Streamed() {
    config_.driver = InclinometerDriver::kRion68;
    config_.address = 0;
    config_.automatic_output = true;
    config_.latency = 10ms;
    auto link = std::make_unique<FakeLink>(clock_);
    link_ = link.get();
    driver_ = std::make_unique<StreamedInclinometer>(
        config_, FrameFamily::kRion68, std::move(link), clock_, sleeper_);
  }
  Result<TiltSample, InclinometerFailure> Read(std::chrono::nanoseconds wait = 100ms) {
    return driver_->Read(clock_.Steady() + wait);
  }
  void Arrive(std::chrono::nanoseconds after, const Bytes& bytes) {
    link_->ArriveAt(clock_.Steady() + after, bytes);
  }

  FakeClock clock_;
  FakeSleeper sleeper_{clock_};
  InclinometerConfig config_;
  FakeLink* link_ = nullptr;
  std::unique_ptr<StreamedInclinometer> driver_;
};

TEST_F(Streamed, AsksForOutputWhenItOpens) {
  EXPECT_FALSE(Read());
  ASSERT_EQ(link_->written.size(), 1u);
  EXPECT_EQ(link_->written[0], (Bytes{0x68, 0x05, 0x00, 0x0C, 0x01, 0x12}));
}

TEST_F(Streamed, StampsTheFirstBitLessTheLatency) {
  EXPECT_FALSE(Read());
  const Timestamp before = clock_.Now();
  Arrive(50ms, Sent(1.5));
  const auto sample = Read();
  ASSERT_TRUE(sample);
  // 16 characters of 10 bits at 9600 baud.
  EXPECT_NEAR(SecondsBetween(before, sample->sensed_at), 0.050 - 16.66667e-3 - 0.010, 1e-8);
  EXPECT_NEAR(sample->raw.beta_rad, DegToRad(1.5), 1e-12);
}

TEST_F(Streamed, OfSeveralAtOnceOnlyTheNewestHasAnInstant) {
  EXPECT_FALSE(Read());
  Arrive(10ms, Sent(1.1));
  Arrive(10ms, Sent(1.2));
  Arrive(10ms, Sent(1.3));
  const auto sample = Read();
  ASSERT_TRUE(sample);
  EXPECT_NEAR(sample->raw.beta_rad, DegToRad(1.3), 1e-12);
  EXPECT_EQ(driver_->Health().counters.stale, 2u);
}

TEST_F(Streamed, PutsAFrameTogetherFromPieces) {
  EXPECT_FALSE(Read());
  const Bytes whole = Sent(1.5);
  for (std::size_t i = 0; i < whole.size(); ++i) Arrive(i * 1ms, {whole[i]});
  EXPECT_TRUE(Read());
}

TEST_F(Streamed, AFrameCutByTheDeadlineIsNotLost) {
  EXPECT_FALSE(Read());
  const Bytes whole = Sent(1.5);
  Arrive(5ms, Bytes(whole.begin(), whole.begin() + 7));
  Arrive(20ms, Bytes(whole.begin() + 7, whole.end()));
  const auto first = Read(10ms);
  ASSERT_FALSE(first);
  EXPECT_EQ(first.error(), InclinometerFailure::kNotDue);
  EXPECT_TRUE(Read(20ms));
}

TEST_F(Streamed, BecomesSilentAsksAgainAndReopens) {
  EXPECT_FALSE(Read());
  Arrive(10ms, Sent(1.5));
  ASSERT_TRUE(Read());
  EXPECT_EQ(driver_->Health().state, InclinometerState::kStreaming);
  const auto start = clock_.Steady();
  bool was_no_reply = false;
  int calls = 0;
  while (clock_.Steady() - start < 4s) {
    const auto sample = Read();
    ASSERT_FALSE(sample);
    was_no_reply = was_no_reply || sample.error() == InclinometerFailure::kNoReply;
    ASSERT_LT(++calls, 100) << "spins";
  }
  EXPECT_TRUE(was_no_reply);
  EXPECT_EQ(driver_->Health().state, InclinometerState::kSilent);
  EXPECT_GE(link_->written.size(), 4u);
  EXPECT_LE(link_->written.size(), 6u);
  while (clock_.Steady() - start < 6s) EXPECT_FALSE(Read());
  EXPECT_EQ(link_->opens, 2);
  Arrive(10ms, Sent(1.5));
  EXPECT_TRUE(Read());
}

TEST_F(Streamed, ClosesOnHangUpAndWaitsBeforeItOpensAgain) {
  EXPECT_FALSE(Read());
  link_->hung_up = true;
  const auto sample = Read();
  ASSERT_FALSE(sample);
  EXPECT_EQ(sample.error(), InclinometerFailure::kHungUp);
  EXPECT_EQ(driver_->Health().state, InclinometerState::kClosed);
  link_->hung_up = false;
  link_->open_failure = LinkFailure::kMissing;
  const auto start = clock_.Steady();
  for (int calls = 0; clock_.Steady() - start < 10s; ++calls) {
    ASSERT_LT(calls, 1000) << "spins";
    EXPECT_FALSE(Read(20ms));
  }
  EXPECT_NEAR(link_->opens, 101, 2);
}

TEST_F(Streamed, CountsADamagedFrameAndGoesOn) {
  EXPECT_FALSE(Read());
  Bytes damaged = Sent(1.5);
  damaged[7] ^= 2;
  Arrive(10ms, damaged);
  const auto first = Read();
  ASSERT_FALSE(first);
  EXPECT_EQ(first.error(), InclinometerFailure::kGarbled);
  Arrive(10ms, Sent(1.5));
  EXPECT_TRUE(Read());
  EXPECT_EQ(driver_->Health().counters.garbled, 1u);
}

TEST_F(Streamed, CountsDamageAlsoWhenAGoodFrameFollowsInOnePiece) {
  EXPECT_FALSE(Read());
  Bytes damaged = Sent(1.5);
  damaged[7] ^= 2;
  Arrive(10ms, damaged);
  Arrive(10ms, damaged);
  Arrive(10ms, Sent(1.5));
  EXPECT_TRUE(Read());
  EXPECT_EQ(driver_->Health().counters.garbled, 2u);
  EXPECT_FALSE(driver_->Health().last_failure);
}

}  // namespace
}  // namespace tbm
