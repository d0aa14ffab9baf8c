// The set-up of the total station comes, is doubted, taken back, replaced and taken up again.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tests/guidance/core/core_bench.h"

namespace tbm::test {
namespace {

TEST_F(Core, WhatWasSeenSinceTheLastGoodCheckIsNotUsedWhenTheStationIsSuspect) {
  Begin();
  const Eigen::Vector3d before = core_.snapshot().rear.site_from_shield.b_from_a.translation;
  // The pillar was knocked after the check.
  core_.Advance(Knocked(seconds(40)), at_ + seconds(40));
  EXPECT_NEAR(
      core_.snapshot().rear.site_from_shield.b_from_a.translation.x() - before.x(), 0.03, 0.003);
  SetUpKnown set_up = SuspectSince(at_ + seconds(5));
  const auto live = Later(Without<SetUpKnown>(Without<PrismSeen>(round_)), seconds(41));
  auto with_check = live;
  with_check.insert(with_check.begin(), set_up);
  core_.Advance(with_check, at_ + seconds(41));
  EXPECT_EQ(core_.snapshot().rear.worth, Worth::kDegraded);
  EXPECT_EQ(core_.snapshot().rear.reason, GuidanceReason::kSetUpSuspect);
  EXPECT_LT((core_.snapshot().rear.site_from_shield.b_from_a.translation - before).norm(), 0.01);
  EXPECT_NEAR(core_.snapshot().rear.age_s, 45.0, 12.0);
  went_on_ = seconds(41);
  CameraGoesOn(seconds(43));
  EXPECT_EQ(StateOf(GuidanceAlarm::kSetUpNotGood), AlarmState::kUnacknowledged);
  // The check was repeated and is good: the readings count again.
  set_up.trusted_until.reset();
  core_.Advance(std::vector<GuidanceInput>{set_up}, at_ + seconds(44));
  EXPECT_NEAR(
      core_.snapshot().rear.site_from_shield.b_from_a.translation.x() - before.x(), 0.03, 0.003);
  EXPECT_EQ(core_.snapshot().fix_trouble, GuidanceReason::kNone);
}

// The pillar was knocked and the camera went blind before the check found it: what coasts rests on
// a fix that is taken back.
TEST_F(Core, TheCoastingFrontShieldGivesUpWhatIsTakenBack) {
  Begin();
  const Eigen::Vector3d before = core_.snapshot().front.site_from_shield.b_from_a.translation;
  core_.Advance(Knocked(seconds(40)), at_ + seconds(40));
  const ShieldState& front = core_.snapshot().front;
  EXPECT_GT((front.site_from_shield.b_from_a.translation - before).norm(), 0.025);
  core_.Advance({}, at_ + seconds(50));
  EXPECT_EQ(front.reason, GuidanceReason::kCameraCoasting);
  core_.Advance(std::vector<GuidanceInput>{SuspectSince(at_ + seconds(5))}, at_ + seconds(55));
  EXPECT_EQ(front.worth, Worth::kDegraded);
  EXPECT_EQ(front.reason, GuidanceReason::kSetUpSuspect);
  EXPECT_LT((front.site_from_shield.b_from_a.translation - before).norm(), 0.01);
  EXPECT_NEAR(front.age_s, 55.0 + begun_with_s_, 1e-6);
}

TEST_F(Core, NothingIsLeftToCoastOnWhenAllOfItIsTakenBack) {
  Begin();
  core_.Advance({}, at_ + seconds(20));
  EXPECT_EQ(core_.snapshot().front.worth, Worth::kDegraded);
  core_.Advance(std::vector<GuidanceInput>{SuspectSince(at_ - seconds(60))}, at_ + seconds(21));
  EXPECT_EQ(core_.snapshot().front.worth, Worth::kInvalid);
  EXPECT_EQ(core_.snapshot().front.reason, GuidanceReason::kSetUpSuspect);
}

// The camera's exposure is fresh enough to coast on, the fix of the rear shield below it is not.
TEST_F(Core, TheCoastingFrontShieldEndsWithTheFixItRestsOn) {
  Begin();
  CameraGoesOn(seconds(880));
  EXPECT_EQ(core_.snapshot().front.reason, GuidanceReason::kStationCoasting);
  core_.Advance({}, at_ + seconds(885));
  EXPECT_EQ(core_.snapshot().front.reason, GuidanceReason::kCameraCoasting);
  core_.Advance({}, at_ + seconds(930));
  EXPECT_EQ(core_.snapshot().camera.freshness, Freshness::kCoasting);
  EXPECT_EQ(core_.snapshot().front.worth, Worth::kInvalid);
  EXPECT_EQ(core_.snapshot().front.reason, GuidanceReason::kStationStale);
}

TEST_F(Core, TrendAndLookAheadForgetWhatIsTakenBack) {
  Timestamp checked_at;
  for (int i = 1; i <= 12; ++i) {
    drive_.Measure(2100.0 + 1.5 * i);
    core_.Advance(drive_.inputs(), drive_.now());
    if (i == 11) checked_at = drive_.now();
  }
  ASSERT_TRUE(Cutter().trend_right && Cutter().trend_up);
  ASSERT_EQ(core_.snapshot().ahead.size(), 20u);
  SetUpKnown set_up = std::get<SetUpKnown>(Only<SetUpKnown>(drive_.inputs()).front());
  const Timestamp now = drive_.now() + milliseconds(300);
  // A check that takes nothing back changes nothing.
  set_up.trusted_until = now;
  core_.Advance(std::vector<GuidanceInput>{set_up}, now);
  EXPECT_TRUE(Cutter().trend_right && !core_.snapshot().ahead.empty());
  set_up.trusted_until = checked_at;
  core_.Advance(std::vector<GuidanceInput>{set_up}, now);
  EXPECT_EQ(Cutter().worth, Worth::kDegraded);
  EXPECT_FALSE(Cutter().trend_right || Cutter().trend_up);
  EXPECT_TRUE(core_.snapshot().ahead.empty());
  // They begin anew with the next good look.
  drive_.Measure(2120.0);
  core_.Advance(drive_.inputs(), drive_.now());
  EXPECT_EQ(Cutter().worth, Worth::kValid);
  EXPECT_FALSE(Cutter().trend_right);
  EXPECT_EQ(core_.snapshot().ahead.size(), 20u);
}

TEST_F(Core, ANewSetUpDoesNotBringBackWhatTheOldOneTookBack) {
  for (const bool there_was_none_between : {false, true}) {
    GuidanceCore core(TheMachine().machine, TheMachine().rig, TheMachine().axis);
    core.Advance(round_, at_);
    const Eigen::Vector3d before = core.snapshot().rear.site_from_shield.b_from_a.translation;
    core.Advance(Knocked(seconds(40)), at_ + seconds(40));
    SetUpKnown set_up = SuspectSince(at_ + seconds(5));
    core.Advance(std::vector<GuidanceInput>{set_up}, at_ + seconds(41));
    if (there_was_none_between) {
      core.Advance(std::vector<GuidanceInput>{SetUpKnown{}}, at_ + seconds(42));
      EXPECT_EQ(core.snapshot().rear.worth, Worth::kInvalid);
    }
    set_up.number += 1;
    set_up.trusted_until.reset();
    core.Advance(std::vector<GuidanceInput>{set_up}, at_ + seconds(43));
    ASSERT_NE(core.snapshot().rear.worth, Worth::kInvalid);
    const Eigen::Vector3d now = core.snapshot().rear.site_from_shield.b_from_a.translation;
    EXPECT_LT((now - before).norm(), 0.01) << there_was_none_between;
  }
}

// The instrument was away and came back with the same set-up, checked and good.
TEST_F(Core, TheSameSetUpFoundGoodBringsBackWhatWasDoubted) {
  Begin();
  const Eigen::Vector3d before = core_.snapshot().rear.site_from_shield.b_from_a.translation;
  core_.Advance(Knocked(seconds(40)), at_ + seconds(40));
  SetUpKnown set_up = SuspectSince(at_ + seconds(5));
  core_.Advance(std::vector<GuidanceInput>{set_up, SetUpKnown{}}, at_ + seconds(41));
  set_up.trusted_until.reset();
  core_.Advance(std::vector<GuidanceInput>{set_up}, at_ + seconds(42));
  set_up.number += 1;
  core_.Advance(std::vector<GuidanceInput>{set_up}, at_ + seconds(43));
  const Eigen::Vector3d now = core_.snapshot().rear.site_from_shield.b_from_a.translation;
  EXPECT_NEAR(now.x() - before.x(), 0.03, 0.003);
}

// After undo_move the set-up has its old, lower number again.
TEST_F(Core, ASetUpThatIsTakenUpAgainIsReadAgain) {
  Begin();
  const Eigen::Vector3d before = core_.snapshot().rear.site_from_shield.b_from_a.translation;
  const SetUpKnown first = std::get<SetUpKnown>(Only<SetUpKnown>(round_).front());
  SetUpKnown second = first;
  second.number += 1;
  auto moved = Later(Without<SetUpKnown>(round_), seconds(40));
  for (GuidanceInput& input : moved) {
    if (auto* prism = std::get_if<PrismSeen>(&input)) prism->set_up_number = second.number;
  }
  moved.insert(moved.begin(), second);
  core_.Advance(moved, at_ + seconds(40));
  EXPECT_EQ(core_.snapshot().set_up_number, second.number);
  auto undone = Knocked(seconds(80));
  undone.insert(undone.begin(), first);
  core_.Advance(undone, at_ + seconds(80));
  EXPECT_EQ(core_.snapshot().set_up_number, first.number);
  EXPECT_EQ(core_.snapshot().rear.worth, Worth::kValid);
  EXPECT_EQ(core_.snapshot().fix->prisms_used, 4);
  const Eigen::Vector3d now = core_.snapshot().rear.site_from_shield.b_from_a.translation;
  EXPECT_NEAR(now.x() - before.x(), 0.03, 0.003);
}

// A prism that the second set-up never saw still has its reading of the first.
TEST_F(Core, AnOlderReadingOfATakenUpSetUpIsNotTheNewestFix) {
  Begin();
  const SetUpKnown first = std::get<SetUpKnown>(Only<SetUpKnown>(round_).front());
  SetUpKnown second = first;
  second.number += 1;
  auto moved = Knocked(seconds(40));
  std::erase_if(moved, [](const GuidanceInput& input) {
    const auto* prism = std::get_if<PrismSeen>(&input);
    return prism != nullptr && prism->prism > 1;
  });
  for (GuidanceInput& input : moved) {
    if (auto* prism = std::get_if<PrismSeen>(&input)) prism->set_up_number = second.number;
  }
  moved.insert(moved.begin(), second);
  core_.Advance(moved, at_ + seconds(40));
  const Timestamp fixed_at = core_.snapshot().fix->at;
  core_.Advance(std::vector<GuidanceInput>{first}, at_ + seconds(41));
  EXPECT_EQ(core_.snapshot().fix->at, fixed_at);
  EXPECT_EQ(core_.snapshot().fix_trouble, GuidanceReason::kNone);
}

// A reading every five seconds, and a check of the references that says after ten minutes that the
// pillar had moved all the while.
TEST_F(Core, WhatWasTrustedAtTheLastCheckIsStillKnownAtTheNext) {
  Begin();
  const RearShieldFix before = *core_.snapshot().fix;
  const auto live = Without<SetUpKnown>(Without<PrismSeen>(round_));
  const auto prisms = Only<PrismSeen>(round_);
  for (int i = 1; i <= 120; ++i) {
    const Duration after = seconds(5 * i);
    auto inputs = Later(live, after);
    PrismSeen prism = std::get<PrismSeen>(prisms[static_cast<std::size_t>(i) % prisms.size()]);
    prism.sensed_at = at_ + after;
    prism.p_in_site.x() += 0.03;
    inputs.push_back(prism);
    core_.Advance(inputs, at_ + after);
  }
  went_on_ = seconds(600);
  core_.Advance(std::vector<GuidanceInput>{SuspectSince(at_ + seconds(2))}, at_ + seconds(600));
  ASSERT_EQ(core_.snapshot().rear.worth, Worth::kDegraded);
  EXPECT_EQ(core_.snapshot().rear.reason, GuidanceReason::kSetUpSuspect);
  EXPECT_EQ(core_.snapshot().fix->at, before.at);
  EXPECT_EQ(core_.snapshot().fix->site_from_rear_shield, before.site_from_rear_shield);
}

// The other prisms are hidden after a while: what is left has its heading from the last fix that
// had one of its own, however many without came after.
TEST_F(Core, AFixWithAHeadingOfItsOwnIsNotGivenUpForOneWithout) {
  auto one = round_;
  std::erase_if(one, [](const GuidanceInput& input) {
    const auto* prism = std::get_if<PrismSeen>(&input);
    return prism != nullptr && prism->prism != 0;
  });
  // No heading before this: the first prism alone is no fix, then all four are.
  core_.Advance(Later(one, -seconds(30)), at_ - seconds(30));
  Begin();
  const Timestamp fixed_at = core_.snapshot().fix->at;
  for (int i = 1; i <= 60; ++i) {
    core_.Advance(Later(Without<SetUpKnown>(one), seconds(30 + 5 * i)), at_ + seconds(30 + 5 * i));
    ASSERT_EQ(core_.snapshot().fix_trouble, GuidanceReason::kNone) << i;
  }
  EXPECT_GT(SecondsBetween(fixed_at, core_.snapshot().fix->at), 300.0);
}

TEST_F(Core, WithNothingTrustedThereIsNoPosition) {
  auto never = round_;
  for (GuidanceInput& input : never) {
    if (auto* set_up = std::get_if<SetUpKnown>(&input)) set_up->trusted_until = Timestamp{-1};
  }
  core_.Advance(never, at_);
  EXPECT_EQ(core_.snapshot().rear.worth, Worth::kInvalid);
  EXPECT_EQ(core_.snapshot().rear.reason, GuidanceReason::kSetUpSuspect);
}

TEST_F(Core, ReadingsOfAnotherSetUpAreNotMixedWithThoseOfThisOne) {
  Begin();
  // A second set-up, 20 mm off, of which three prisms were read and one not yet.
  auto set_up = std::get<SetUpKnown>(Only<SetUpKnown>(round_).front());
  set_up.number += 1;
  std::vector<GuidanceInput> inputs{set_up};
  for (GuidanceInput input : Later(Only<PrismSeen>(round_), seconds(20))) {
    auto& prism = std::get<PrismSeen>(input);
    if (prism.prism == 3) continue;
    prism.set_up_number = set_up.number;
    prism.p_in_site.x() += 0.02;
    inputs.push_back(input);
  }
  const auto tilts = Later(Only<TiltSeen>(round_), seconds(20));
  inputs.insert(inputs.begin(), tilts.begin(), tilts.end());
  core_.Advance(inputs, at_ + seconds(20));
  ASSERT_TRUE(core_.snapshot().fix);
  EXPECT_EQ(core_.snapshot().fix->prisms_used, 3);
  EXPECT_FALSE(core_.snapshot().fix->left_out);
}

}  // namespace
}  // namespace tbm::test
