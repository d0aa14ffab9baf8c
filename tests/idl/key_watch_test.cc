#include "idl/cpp/key_watch.h"

#include <gtest/gtest.h>

namespace tbm::dds::test {
namespace {

using namespace std::chrono_literals;

class KeyWatchTest : public testing::Test {
 protected:
  static KeyWatch::Id Number(std::uint8_t n) { return {n}; }

  bool Hear(std::uint8_t key, std::uint8_t writer) {
    return watch_.Heard(
        Number(key), Number(writer), now_, [&] { return "key" + std::to_string(key); });
  }
  void Wait(std::chrono::milliseconds span) {
    now_ += span;
    watch_.Poll(now_);
  }
  int Raised(AlarmKind kind, bool active = true) const {
    int count = 0;
    for (const auto& [k, a] : raised_) count += k == kind && a == active;
    return count;
  }

  KeyWatch::Instant now_{1h};
  std::vector<std::pair<AlarmKind, bool>> raised_;
  KeyWatch watch_{
      500ms, 4, [this](AlarmKind kind, bool active, const std::string&, const std::string&) {
        raised_.emplace_back(kind, active);
      }};
};

TEST_F(KeyWatchTest, SaysOnceThatAKeyIsSilentAndOnceThatItIsBack) {
  Hear(1, 1);
  Wait(400ms);
  EXPECT_EQ(Raised(AlarmKind::kSilent), 0);
  Wait(200ms);
  Wait(200ms);
  EXPECT_EQ(Raised(AlarmKind::kSilent), 1);
  Hear(1, 1);
  EXPECT_EQ(Raised(AlarmKind::kSilent, false), 1);
}

// Seen 2026-11: DDS' timer, begun with the reader, went off as the first sample of a key came in.
TEST_F(KeyWatchTest, DoesNotBelieveADeadlineOfAKeyThatWasJustHeard) {
  Hear(1, 1);
  watch_.MissedDeadline(Number(1), now_ + 100ms);
  EXPECT_EQ(Raised(AlarmKind::kSilent), 0);
  watch_.MissedDeadline(Number(1), now_ + 500ms);
  EXPECT_EQ(Raised(AlarmKind::kSilent), 1);
}

TEST_F(KeyWatchTest, BelievesAtOnceThatTheWritersHaveLeft) {
  Hear(1, 1);
  watch_.Left(Number(1), "has no writer any more");
  EXPECT_EQ(Raised(AlarmKind::kSilent), 1);
}

TEST_F(KeyWatchTest, WatchesEachKeyForItself) {
  Hear(1, 1);
  Hear(2, 1);
  for (int i = 0; i < 5; ++i) {
    Wait(200ms);
    Hear(1, 1);
  }
  EXPECT_EQ(Raised(AlarmKind::kSilent), 1);
}

TEST_F(KeyWatchTest, CallsAWriterThatSendsNothingSilent) {
  watch_.Matched(1, now_);
  Wait(600ms);
  EXPECT_EQ(Raised(AlarmKind::kSilent), 1);
  Hear(1, 1);
  EXPECT_EQ(Raised(AlarmKind::kSilent, false), 1);
}

TEST_F(KeyWatchTest, TakesARestartedWriterForTheSameOne) {
  for (std::uint8_t writer = 1; writer < 20; ++writer) {
    for (int i = 0; i < 3; ++i) EXPECT_FALSE(Hear(1, writer));
  }
  EXPECT_EQ(Raised(AlarmKind::kSecondWriter), 0);
}

TEST_F(KeyWatchTest, FlagsTwoOrMoreWritersThatTakeTurns) {
  for (const int writers : {2, 3, 4}) {
    watch_.Clear();
    raised_.clear();
    bool contested = false;
    for (int i = 0; i < 2 * writers; ++i) {
      contested = Hear(1, static_cast<std::uint8_t>(1 + i % writers));
    }
    EXPECT_TRUE(contested);
    EXPECT_EQ(Raised(AlarmKind::kSecondWriter), 1);
  }
}

TEST_F(KeyWatchTest, ForgetsTheContestWhenOneWriterIsLeft) {
  Hear(1, 1);
  Hear(1, 2);
  EXPECT_TRUE(Hear(1, 1));
  for (int i = 0; i < 30; ++i) {
    Wait(200ms);
    Hear(1, 1);
  }
  EXPECT_EQ(Raised(AlarmKind::kSecondWriter, false), 1);
  EXPECT_FALSE(Hear(1, 1));
}

TEST_F(KeyWatchTest, DoesNotMixUpWritersOfDifferentKeys) {
  for (int i = 0; i < 4; ++i) {
    EXPECT_FALSE(Hear(1, 1));
    EXPECT_FALSE(Hear(2, 2));
  }
}

TEST_F(KeyWatchTest, IgnoresKeysBeyondItsRoom) {
  for (std::uint8_t key = 0; key < 10; ++key) EXPECT_FALSE(Hear(key, 1));
  Wait(600ms);
  EXPECT_EQ(Raised(AlarmKind::kSilent), 4);
}

}  // namespace
}  // namespace tbm::dds::test
