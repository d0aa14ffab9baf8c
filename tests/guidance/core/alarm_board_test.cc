#include "guidance/core/alarm_board.h"

#include <array>
#include <limits>

#include <gtest/gtest.h>

namespace tbm {
namespace {

constexpr Timestamp At(double seconds) { return {static_cast<std::int64_t>(seconds * 1e9)}; }

// Deviation above 30 mm, back below 25; two seconds before it counts, three before it is over.
constexpr std::array kRules{
    AlarmRule{"deviation_high",
              AlarmPriority::kHigh,
              "off the design",
              "steer back",
              0.030,
              0.025,
              std::chrono::seconds(2),
              std::chrono::seconds(3)},
    AlarmRule{"prism_lost", AlarmPriority::kLow, "a prism is hidden", "clean it", 0.5, 0.5, {}, {}},
};

struct Board : AlarmBoard {
  Board() : AlarmBoard(kRules) {}
  AlarmState state(std::size_t i = 0) const { return alarm(i).state; }
  void Raise() {
    (void)Update(0, 0.040, At(0));
    (void)Update(0, 0.040, At(2));
  }
};

TEST(AlarmBoard, IsRaisedOnlyAfterItsDelay) {
  Board board;
  EXPECT_FALSE(board.Update(0, 0.031, At(0)));
  EXPECT_FALSE(board.Update(0, 0.031, At(1.9)));
  EXPECT_EQ(board.state(), AlarmState::kNormal);
  EXPECT_TRUE(board.Update(0, 0.031, At(2)));
  EXPECT_EQ(board.state(), AlarmState::kUnacknowledged);
  EXPECT_EQ(board.alarm(0).since, At(2));
}

TEST(AlarmBoard, AShortPeakStartsTheDelayAnew) {
  Board board;
  (void)board.Update(0, 0.031, At(0));
  (void)board.Update(0, 0.029, At(1));
  EXPECT_FALSE(board.Update(0, 0.031, At(2)));
  EXPECT_EQ(board.state(), AlarmState::kNormal);
}

TEST(AlarmBoard, BetweenTheLimitsItStaysAsItIs) {
  Board board;
  board.Raise();
  for (int i = 3; i < 100; ++i) EXPECT_FALSE(board.Update(0, 0.027, At(i)));
  EXPECT_EQ(board.state(), AlarmState::kUnacknowledged);
  Board calm;
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(calm.Update(0, 0.027, At(i)));
  EXPECT_EQ(calm.state(), AlarmState::kNormal);
}

TEST(AlarmBoard, WhatNobodySawStaysUntilAcknowledged) {
  Board board;
  board.Raise();
  (void)board.Update(0, 0.010, At(10));
  EXPECT_TRUE(board.Update(0, 0.010, At(13)));
  EXPECT_EQ(board.state(), AlarmState::kReturnedUnacknowledged);
  EXPECT_TRUE(board.Acknowledge(0, At(20)));
  EXPECT_EQ(board.state(), AlarmState::kNormal);
  EXPECT_FALSE(board.Acknowledge(0, At(21)));
}

TEST(AlarmBoard, AcknowledgedIsOverWithItsCause) {
  Board board;
  board.Raise();
  EXPECT_TRUE(board.Acknowledge(0, At(5)));
  EXPECT_EQ(board.state(), AlarmState::kAcknowledged);
  EXPECT_TRUE(board.alarm(0).is_active());
  (void)board.Update(0, 0.010, At(10));
  EXPECT_TRUE(board.Update(0, 0.010, At(13)));
  EXPECT_EQ(board.state(), AlarmState::kNormal);
}

TEST(AlarmBoard, MissingDataNeitherRaisesNorClears) {
  Board board;
  board.Raise();
  (void)board.Update(0, 0.010, At(10));
  EXPECT_FALSE(board.Update(0, {}, At(12)));
  EXPECT_FALSE(board.Update(0, std::numeric_limits<double>::quiet_NaN(), At(100)));
  EXPECT_EQ(board.state(), AlarmState::kUnacknowledged);
  // What was missing does not count as time below the limit.
  EXPECT_FALSE(board.Update(0, 0.010, At(101)));
  EXPECT_EQ(board.state(), AlarmState::kUnacknowledged);
  EXPECT_EQ(board.alarm(0).value, 0.010);
}

TEST(AlarmBoard, RaisedAgainBeforeAnybodySawIsOneMoreTime) {
  Board board;
  board.Raise();
  (void)board.Update(0, 0.010, At(10));
  (void)board.Update(0, 0.010, At(13));
  (void)board.Update(0, 0.040, At(14));
  EXPECT_TRUE(board.Update(0, 0.040, At(16)));
  EXPECT_EQ(board.state(), AlarmState::kUnacknowledged);
  EXPECT_EQ(board.alarm(0).times_raised, 2u);
  EXPECT_EQ(board.alarm(0).raised_at, At(16));
}

TEST(AlarmBoard, FirstOutIsTheOneThatCameFirst) {
  Board board;
  EXPECT_FALSE(board.FirstOut());
  EXPECT_TRUE(board.Update(1, 1.0, At(1)));
  board.Raise();
  EXPECT_EQ(board.FirstOut(), 1u);
  (void)board.Acknowledge(1, At(3));
  EXPECT_EQ(board.FirstOut(), 1u);  // answered, but it still stands
  (void)board.Update(1, 0.0, At(4));
  EXPECT_EQ(board.FirstOut(), 0u);
}

TEST(AlarmBoard, AClockSetBackStartsTheDelayAnew) {
  Board board;
  (void)board.Update(0, 0.040, At(1000));
  EXPECT_FALSE(board.Update(0, 0.040, At(10)));
  EXPECT_FALSE(board.Update(0, 0.040, At(11)));
  EXPECT_TRUE(board.Update(0, 0.040, At(12)));
}

TEST(AlarmBoard, AShelfHidesAndNothingElse) {
  Board board;
  EXPECT_TRUE(board.Shelve(0, At(600), At(0)));
  board.Raise();
  EXPECT_TRUE(board.Update(1, 1.0, At(3)));
  EXPECT_EQ(board.state(), AlarmState::kUnacknowledged);
  EXPECT_EQ(board.alarm(0).times_raised, 1u);
  EXPECT_EQ(board.alarm(0).shelved_until, At(600));
  EXPECT_EQ(board.FirstOut(), 0u) << "hidden, and still the first";
  EXPECT_TRUE(board.Acknowledge(0, At(5)));
  EXPECT_EQ(board.state(), AlarmState::kAcknowledged);
  EXPECT_EQ(board.alarm(0).shelved_until, At(600));
}

TEST(AlarmBoard, AShelfEndsAtItsTimeWhateverIsKnown) {
  Board board;
  EXPECT_TRUE(board.Shelve(0, At(600), At(0)));
  (void)board.Update(0, {}, At(599.9));
  EXPECT_TRUE(board.alarm(0).shelved_until);
  EXPECT_FALSE(board.Update(0, {}, At(600))) << "the state is as it was";
  EXPECT_FALSE(board.alarm(0).shelved_until);
}

TEST(AlarmBoard, AShelfEndsByHandAndByAClockSetBack) {
  Board board;
  EXPECT_FALSE(board.Unshelve(0));
  EXPECT_TRUE(board.Shelve(0, At(2000), At(1000)));
  EXPECT_TRUE(board.Shelve(0, At(1500), At(1100))) << "another time";
  EXPECT_EQ(board.alarm(0).shelved_until, At(1500));
  (void)board.Update(0, 0.0, At(1100));
  EXPECT_TRUE(board.alarm(0).shelved_until);
  EXPECT_TRUE(board.Unshelve(0));
  EXPECT_FALSE(board.alarm(0).shelved_until);
  EXPECT_TRUE(board.Shelve(0, At(2000), At(1000)));
  (void)board.Update(0, 0.0, At(999));
  EXPECT_FALSE(board.alarm(0).shelved_until) << "more would remain than was asked for";
}

TEST(AlarmBoard, NoShelfIsForeverAndAnUrgentOnesIsShort) {
  Board board;
  for (const double until : {-1.0, 0.0, 1.0}) {
    EXPECT_FALSE(board.Shelve(1, At(until), At(1))) << until;
  }
  EXPECT_FALSE(board.Shelve(0, At(1801), At(0)));
  EXPECT_TRUE(board.Shelve(0, At(1800), At(0)));
  EXPECT_FALSE(board.Shelve(1, At(8 * 3600 + 1), At(0)));
  EXPECT_TRUE(board.Shelve(1, At(8 * 3600), At(0)));
  EXPECT_FALSE(board.Shelve(0, At(5000), At(1)));
  EXPECT_EQ(board.alarm(0).shelved_until, At(1800)) << "refused, nothing has changed";
}

TEST(AlarmBoard, IsFoundByItsCode) {
  const Board board;
  EXPECT_EQ(board.Find("prism_lost"), 1u);
  EXPECT_FALSE(board.Find("nothing"));
}

}  // namespace
}  // namespace tbm
