#include "devices/inclinometer/bcd_frame_wire.h"

#include <gtest/gtest.h>

#include "tests/devices/inclinometer/fake_line.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using test::FakeClock;
using test::FakeLink;
using Bytes = FakeLink::Bytes;

Bytes ReplyFrom(int address, double x_deg, double y_deg) {
  const FrameBytes bytes = EncodeFrame(FrameFamily::kRion68,
                                       EncodeAngles(static_cast<std::uint8_t>(address),
                                                    FrameLayout::kFourByteTemperature,
                                                    {x_deg, y_deg, 21.5}));
  return {bytes.begin(), bytes.end()};
}

class FrameWire : public testing::Test {
 protected:
  FrameWire() {
    config_.driver = InclinometerDriver::kRion68;
    config_.address = 0;
    auto link = std::make_unique<FakeLink>(clock_);
    link_ = link.get();
    wire_ = std::make_unique<BcdFrameWire>(FrameFamily::kRion68, std::move(link), clock_);
    EXPECT_FALSE(wire_->Open());
  }
  // The instrument's bytes, so long after the question.
  void Answers(std::chrono::nanoseconds after, Bytes bytes) {
    link_->on_write = [this, after, bytes](const Bytes&) {
      link_->ArriveAt(clock_.Steady() + after, bytes);
    };
  }

  FakeClock clock_;
  InclinometerConfig config_;
  FakeLink* link_ = nullptr;
  std::unique_ptr<BcdFrameWire> wire_;
};

TEST_F(FrameWire, AsksAndReadsBothAnglesAndTheTemperature) {
  Answers(20ms, ReplyFrom(0, 1.5, -2.5));
  const auto reading = wire_->Ask(config_);
  ASSERT_TRUE(reading);
  EXPECT_EQ(link_->written.front(), (Bytes{0x68, 0x04, 0x00, 0x04, 0x08}));
  EXPECT_NEAR(reading->raw.beta_rad, DegToRad(1.5), 1e-12);
  EXPECT_NEAR(reading->raw.gamma_rad, DegToRad(-2.5), 1e-12);
  EXPECT_EQ(reading->temperature_celsius, 21.5);
  EXPECT_EQ(reading->request_characters, 5u);
  EXPECT_EQ(reading->reply_characters, 16u);
}

TEST_F(FrameWire, SwapsTheAxesWhenTold) {
  config_.swap_axes = true;
  Answers(20ms, ReplyFrom(0, 1.5, -2.5));
  const auto reading = wire_->Ask(config_);
  ASSERT_TRUE(reading);
  EXPECT_NEAR(reading->raw.beta_rad, DegToRad(-2.5), 1e-12);
}

TEST_F(FrameWire, GivesUpAtTheTimeoutNotLater) {
  const auto before = clock_.Steady();
  const auto reading = wire_->Ask(config_);
  ASSERT_FALSE(reading);
  EXPECT_EQ(reading.error(), InclinometerFailure::kNoReply);
  EXPECT_EQ(clock_.Steady() - before, config_.response_timeout);
}

TEST_F(FrameWire, AReplyAfterTheTimeoutIsNoReply) {
  Answers(101ms, ReplyFrom(0, 1.5, -2.5));
  const auto reading = wire_->Ask(config_);
  ASSERT_FALSE(reading);
  EXPECT_EQ(reading.error(), InclinometerFailure::kNoReply);
  clock_.Advance(200ms);
  EXPECT_EQ(wire_->Discard(), 16u);
}

TEST_F(FrameWire, HearsTheReplyThroughNoise) {
  Bytes bytes = {0xFF, 0x68, 0x0F, 0x68};
  const Bytes reply = ReplyFrom(0, 1.5, -2.5);
  bytes.insert(bytes.end(), reply.begin(), reply.end());
  bytes.insert(bytes.end(), {0x00, 0x00, 0x00, 0x00});
  Answers(20ms, bytes);
  EXPECT_TRUE(wire_->Ask(config_));
}

TEST_F(FrameWire, SaysWhyNothingCouldBeUsed) {
  Answers(20ms, ReplyFrom(5, 1.5, -2.5));
  auto reading = wire_->Ask(config_);
  ASSERT_FALSE(reading);
  EXPECT_EQ(reading.error(), InclinometerFailure::kOtherInstrument);

  Bytes damaged = ReplyFrom(0, 1.5, -2.5);
  damaged[6] ^= 1;
  Answers(20ms, damaged);
  reading = wire_->Ask(config_);
  ASSERT_FALSE(reading);
  EXPECT_EQ(reading.error(), InclinometerFailure::kGarbled);

  BcdFrame odd{0, 0x84, {}};
  for (int i = 0; i < 9; ++i) odd.data.push_back(0xAA);
  const FrameBytes bytes = EncodeFrame(FrameFamily::kRion68, odd);
  Answers(20ms, {bytes.begin(), bytes.end()});
  reading = wire_->Ask(config_);
  ASSERT_FALSE(reading);
  EXPECT_EQ(reading.error(), InclinometerFailure::kGarbled);

  link_->hung_up = true;
  reading = wire_->Ask(config_);
  ASSERT_FALSE(reading);
  EXPECT_EQ(reading.error(), InclinometerFailure::kHungUp);
}

}  // namespace
}  // namespace tbm
