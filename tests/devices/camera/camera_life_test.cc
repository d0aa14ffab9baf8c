#include "devices/camera/camera_life.h"

#include <gtest/gtest.h>

namespace tbm {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

const CameraLife::Instant kStart{std::chrono::hours(1)};
constexpr milliseconds kSilentAfter(300);

CameraLife Streaming() {
  CameraLife life(kSilentAfter);
  life.Opening();
  life.Opened(kStart);
  life.GotFrame(kStart);
  return life;
}

TEST(CameraLife, ClosedMayOpenAtOnce) {
  const CameraLife life(kSilentAfter);
  EXPECT_EQ(life.state(), CameraState::kClosed);
  EXPECT_EQ(life.UntilOpening(kStart), Duration::zero());
}

TEST(CameraLife, OpeningThatSucceedsStreams) {
  CameraLife life(kSilentAfter);
  life.Opening();
  EXPECT_EQ(life.state(), CameraState::kOpening);
  life.Opened(kStart);
  EXPECT_EQ(life.state(), CameraState::kStreaming);
}

TEST(CameraLife, OpeningThatFailsWaitsLongerEachTimeUpToTheLimit) {
  CameraLife life(kSilentAfter);
  for (const int wait_ms : {250, 500, 1000, 2000, 2000}) {
    life.Opening();
    life.OpeningFailed(kStart);
    EXPECT_EQ(life.state(), CameraState::kClosed);
    EXPECT_EQ(life.UntilOpening(kStart), milliseconds(wait_ms));
    EXPECT_EQ(life.UntilOpening(kStart + milliseconds(wait_ms)), Duration::zero());
  }
}

TEST(CameraLife, AFrameMakesTheNextFailureWaitShortAgain) {
  CameraLife life = Streaming();
  for (int i = 0; i < 4; ++i) life.OpeningFailed(kStart);
  life.Opened(kStart);
  life.GotFrame(kStart);
  life.OpeningFailed(kStart);
  EXPECT_EQ(life.UntilOpening(kStart), milliseconds(250));
}

TEST(CameraLife, StreamingTurnsSilentOnlyAfterTheTime) {
  CameraLife life = Streaming();
  life.GotNothing(kStart + kSilentAfter - milliseconds(1));
  EXPECT_EQ(life.state(), CameraState::kStreaming);
  life.GotNothing(kStart + kSilentAfter);
  EXPECT_EQ(life.state(), CameraState::kSilent);
}

TEST(CameraLife, TheFirstFrameMayTakeASecond) {
  CameraLife life(kSilentAfter);
  life.Opened(kStart);
  life.GotNothing(kStart + milliseconds(999));
  EXPECT_EQ(life.state(), CameraState::kStreaming);
  life.GotNothing(kStart + seconds(1));
  EXPECT_EQ(life.state(), CameraState::kSilent);
}

TEST(CameraLife, SilentStreamsAgainWithTheNextFrame) {
  CameraLife life = Streaming();
  life.GotNothing(kStart + seconds(1));
  life.GotFrame(kStart + seconds(2));
  EXPECT_EQ(life.state(), CameraState::kStreaming);
  life.GotNothing(kStart + seconds(2) + kSilentAfter);
  EXPECT_EQ(life.state(), CameraState::kSilent);
}

TEST(CameraLife, ASilentCameraIsAskedAfterAWhileAndThenAgain) {
  CameraLife life = Streaming();
  const auto silent = kStart + kSilentAfter;
  life.GotNothing(silent);
  EXPECT_FALSE(life.ShouldAsk(silent + CameraLife::kGiveUpAfter - milliseconds(1)));
  const auto asked = silent + CameraLife::kGiveUpAfter;
  EXPECT_TRUE(life.ShouldAsk(asked));
  life.Asked(asked);
  EXPECT_FALSE(life.ShouldAsk(asked + CameraLife::kAskAgainAfter - milliseconds(1)));
  EXPECT_TRUE(life.ShouldAsk(asked + CameraLife::kAskAgainAfter));
}

TEST(CameraLife, AStreamingCameraIsNotAsked) {
  EXPECT_FALSE(Streaming().ShouldAsk(kStart + seconds(100)));
}

TEST(CameraLife, ALostConnectionMayBeOpenedAtOnce) {
  CameraLife life = Streaming();
  life.GotNothing(kStart + seconds(1));
  life.Lost(kStart + seconds(2));
  EXPECT_EQ(life.state(), CameraState::kClosed);
  EXPECT_EQ(life.UntilOpening(kStart + seconds(2)), Duration::zero());
}

}  // namespace
}  // namespace tbm
