#include "idl/cpp/alarm_causes.h"

#include <gtest/gtest.h>

namespace tbm::dds::test {
namespace {

using namespace std::chrono_literals;

class AlarmCausesTest : public testing::Test {
 protected:
  std::optional<Alarm> Tell(AlarmKind kind,
                            bool active,
                            const std::string& topic,
                            const std::string& subject) {
    return causes_.Told({kind, active, topic, subject, "text"}, now_);
  }

  AlarmCauses causes_;
  AlarmCauses::Instant now_{1h};
};

TEST_F(AlarmCausesTest, TheEndOfOneCauseIsNotTheEndOfItsKind) {
  Tell(AlarmKind::kSecondWriter, true, "guidance", "TBM-1");
  Tell(AlarmKind::kSecondWriter, true, "shield_pose", "front");
  Tell(AlarmKind::kSecondWriter, true, "shield_pose", "rear");
  const auto first = Tell(AlarmKind::kSecondWriter, false, "shield_pose", "front");
  ASSERT_TRUE(first);
  EXPECT_TRUE(first->kind_stands);
  EXPECT_FALSE(first->ChangesKind());
  EXPECT_FALSE(Tell(AlarmKind::kSecondWriter, false, "guidance", "TBM-1")->ChangesKind());
  const auto last = Tell(AlarmKind::kSecondWriter, false, "shield_pose", "rear");
  ASSERT_TRUE(last);
  EXPECT_FALSE(last->kind_stands);
  EXPECT_TRUE(last->ChangesKind());
}

TEST_F(AlarmCausesTest, KindsHaveNothingToDoWithEachOther) {
  Tell(AlarmKind::kSilent, true, "guidance", "TBM-1");
  Tell(AlarmKind::kSecondWriter, true, "guidance", "TBM-1");
  EXPECT_TRUE(Tell(AlarmKind::kSilent, false, "guidance", "TBM-1")->ChangesKind());
}

TEST_F(AlarmCausesTest, TheSameCauseToldAgainIsOne) {
  Tell(AlarmKind::kSilent, true, "guidance", "TBM-1");
  EXPECT_TRUE(Tell(AlarmKind::kSilent, true, "guidance", "TBM-1")->ChangesKind());
  EXPECT_TRUE(Tell(AlarmKind::kSilent, false, "guidance", "TBM-1")->ChangesKind());
}

TEST_F(AlarmCausesTest, WhatNeverBeganDoesNotEnd) {
  EXPECT_FALSE(Tell(AlarmKind::kSilent, false, "guidance", "TBM-1"));
}

TEST_F(AlarmCausesTest, RefusalsAreOverWhenNoneHasComeForAMinute) {
  Tell(AlarmKind::kRejected, true, "guidance", "");
  Tell(AlarmKind::kIncompatibleQos, true, "guidance", "reader");
  now_ += 59s;
  Tell(AlarmKind::kRejected, true, "guidance", "");
  now_ += 59s;
  EXPECT_TRUE(causes_.Expire(now_).empty());
  now_ += 2s;
  const auto over = causes_.Expire(now_);
  ASSERT_EQ(over.size(), 1u);
  EXPECT_EQ(over[0].kind, AlarmKind::kRejected);
  EXPECT_EQ(over[0].topic, "guidance");
  EXPECT_FALSE(over[0].active);
  EXPECT_TRUE(over[0].ChangesKind());
  EXPECT_TRUE(causes_.Expire(now_).empty());
}

TEST_F(AlarmCausesTest, WithoutANetworkOnlyItsOwnTroubleIsKnown) {
  Tell(AlarmKind::kNoNetwork, true, "", "");
  Tell(AlarmKind::kStartFailed, true, "", "");
  Tell(AlarmKind::kStartFailed, true, "guidance", "reader");
  Tell(AlarmKind::kInterfaceMismatch, true, "", "a process");
  Tell(AlarmKind::kSilent, true, "guidance", "TBM-1");
  Tell(AlarmKind::kSilent, true, "event", "camera_box");
  const auto over = causes_.EndOfNetwork();
  ASSERT_EQ(over.size(), 4u);
  EXPECT_FALSE(over[0].ChangesKind()) << "the process itself did not start either";
  EXPECT_TRUE(over[1].ChangesKind());
  EXPECT_FALSE(over[2].ChangesKind()) << "one of two topics";
  EXPECT_TRUE(over[3].ChangesKind());
  EXPECT_TRUE(Tell(AlarmKind::kNoNetwork, false, "", "")->ChangesKind());
  EXPECT_TRUE(Tell(AlarmKind::kStartFailed, false, "", "")->ChangesKind());
}

}  // namespace
}  // namespace tbm::dds::test
