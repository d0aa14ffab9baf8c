#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hmi_bridge/core/console_fixture.h"

namespace tbm::hmi {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

TEST(ConsoleAlarms, SilenceOfTheGuidanceIsAnAlarmWithinTwoSeconds) {
  Console console;
  console.Hear(GuidanceAt(console.now.utc));
  console.Wait(700);
  EXPECT_THAT(console.Alarms(), IsEmpty());
  for (int i = 0; i < 6; ++i) console.Wait(200);
  EXPECT_THAT(console.Alarms(), ElementsAre("hmi_bridge/guidance_silent unacknowledged"));
  console.Hear(GuidanceAt(console.now.utc));
  console.Wait(10);
  EXPECT_THAT(console.Alarms(), ElementsAre("hmi_bridge/guidance_silent returned_unacknowledged"));
  EXPECT_TRUE(console.Ask("acknowledge", "hmi_bridge/guidance_silent"));
  EXPECT_THAT(console.Alarms(), IsEmpty());
}

TEST(ConsoleAlarms, NeverHeardIsMissedAfterTheStart) {
  Console console;
  for (int i = 0; i < 9; ++i) console.Wait(1000);
  EXPECT_THAT(console.Alarms(), IsEmpty());
  for (int i = 0; i < 5; ++i) console.Wait(1000);
  EXPECT_THAT(console.Alarms(),
              ElementsAre("hmi_bridge/guidance_silent unacknowledged",
                          "hmi_bridge/camera_box_silent unacknowledged",
                          "hmi_bridge/total_station_silent unacknowledged"));
}

TEST(ConsoleAlarms, AProcessThatFallsSilentClearsNothing) {
  Console console;
  console.Hear(
      AlarmNow("deviation_high", dds::AlarmPhase::kUnacknowledged, dds::AlarmUrgency::kHigh));
  const std::int64_t heard_utc_ms = Milliseconds(console.now.utc);
  EXPECT_TRUE(console.AlarmOf("deviation_high")["silent_since_utc_ms"].is_null());
  console.Wait(3500);
  EXPECT_EQ(console.AlarmOf("deviation_high")["silent_since_utc_ms"], heard_utc_ms);
  EXPECT_EQ(console.AlarmOf("deviation_high")["phase"], "unacknowledged");
}

TEST(ConsoleAlarms, UrgentFirstAndOfThoseTheFirstRaised) {
  Console console;
  auto low = AlarmNow("tilt_late", dds::AlarmPhase::kUnacknowledged, dds::AlarmUrgency::kLow);
  low.raised_at = {10 * kMs};
  auto late = AlarmNow("position_lost", dds::AlarmPhase::kAcknowledged, dds::AlarmUrgency::kHigh);
  late.raised_at = {30 * kMs};
  auto early =
      AlarmNow("deviation_high", dds::AlarmPhase::kUnacknowledged, dds::AlarmUrgency::kHigh);
  early.raised_at = {20 * kMs};
  auto normal = AlarmNow("roll_high", dds::AlarmPhase::kNormal, dds::AlarmUrgency::kHigh);
  for (const auto& alarm : {low, late, early, normal}) console.Hear(alarm);
  EXPECT_THAT(console.Alarms(),
              ElementsAre("guidance/deviation_high unacknowledged",
                          "guidance/position_lost acknowledged",
                          "guidance/tilt_late unacknowledged"));
  EXPECT_EQ(console.Part("alarms")["first_out"], "guidance/tilt_late");
}

TEST(ConsoleAlarms, AShelvedOneIsListedAlsoWhenItIsNormal) {
  Console console;
  auto shelved = AlarmNow("roll_high", dds::AlarmPhase::kNormal, dds::AlarmUrgency::kMedium);
  shelved.shelved_until = console.now.utc + std::chrono::minutes(5);
  shelved.shelved_by = "bob";
  console.Hear(shelved);
  EXPECT_EQ(console.AlarmOf("roll_high")["shelved_by"], "bob");
  EXPECT_TRUE(console.Part("alarms")["first_out"].is_null());
}

TEST(ConsoleAlarms, AnEventThatStandsIsAnAlarmUntilItIsOverAndAnswered) {
  Console console;
  console.Hear(EventNow("camera_silent", true, console.now.utc - std::chrono::seconds(60)));
  EXPECT_THAT(console.Alarms(), ElementsAre("camera_box/camera_silent unacknowledged"));
  EXPECT_EQ(console.AlarmOf("camera_silent")["origin"], "event");
  EXPECT_EQ(console.AlarmOf("camera_silent")["raised_at_utc_ms"],
            Milliseconds(console.now.utc) - 60'000);
  console.Hear(EventNow("camera_silent", false, console.now.utc));
  EXPECT_THAT(console.Alarms(), ElementsAre("camera_box/camera_silent returned_unacknowledged"));
  EXPECT_TRUE(console.Ask("acknowledge", "camera_box/camera_silent"));
  EXPECT_THAT(console.Alarms(), IsEmpty());
}

TEST(ConsoleAlarms, InformationIsNoAlarm) {
  Console console;
  dds::Event event = EventNow("started", true, console.now.utc);
  event.severity = dds::Severity::kInfo;
  console.Hear(event);
  EXPECT_THAT(console.Alarms(), IsEmpty());
  EXPECT_EQ(console.Part("events").size(), 1u);
}

TEST(ConsoleAlarms, WhatItsProcessKeepsIsListedOnce) {
  Console console;
  dds::Event event = EventNow("deviation_high", true, console.now.utc);
  event.source = "guidance";
  console.Hear(event);
  const auto status =
      AlarmNow("deviation_high", dds::AlarmPhase::kAcknowledged, dds::AlarmUrgency::kHigh);
  console.Hear(status);
  EXPECT_THAT(console.Alarms(), ElementsAre("guidance/deviation_high acknowledged"));
  console.Hear(event);
  EXPECT_THAT(console.Alarms(), ElementsAre("guidance/deviation_high acknowledged"));
}

TEST(ConsoleAlarms, AnAnswerOutlivesTheBridgeButNotANewEvent) {
  Console before;
  const Timestamp at = before.now.utc;
  before.Hear(EventNow("camera_silent", true, at));
  ASSERT_TRUE(before.Ask("acknowledge", "camera_box/camera_silent"));
  Console after;
  after.board.own_alarms().Restore(before.board.own_alarms().answers());
  after.Hear(EventNow("camera_silent", true, at));
  EXPECT_THAT(after.Alarms(), ElementsAre("camera_box/camera_silent acknowledged"));
  EXPECT_EQ(after.AlarmOf("camera_silent")["acknowledged_by"], "ann");
  after.Hear(EventNow("camera_silent", false, at + std::chrono::seconds(5)));
  after.Hear(EventNow("camera_silent", true, at + std::chrono::seconds(9)));
  EXPECT_THAT(after.Alarms(), ElementsAre("camera_box/camera_silent unacknowledged"));
  EXPECT_EQ(after.AlarmOf("camera_silent")["acknowledged_by"], "");
}

TEST(ConsoleAlarms, AreShelvedForATimeWithNameAndReason) {
  Console console;
  console.Hear(EventNow("camera_silent", true, console.now.utc));
  EXPECT_FALSE(console.Ask("shelve", "camera_box/camera_silent 15"));
  EXPECT_FALSE(console.Ask("shelve", "camera_box/camera_silent 0", "cleaning"));
  EXPECT_FALSE(console.Ask("shelve", "camera_box/nothing 15", "cleaning"));
  ASSERT_TRUE(console.Ask("shelve", "camera_box/camera_silent 15", "cleaning"));
  const Json shelved = console.AlarmOf("camera_silent");
  EXPECT_EQ(shelved["shelved_until_utc_ms"], Milliseconds(console.now.utc) + 15 * 60'000);
  EXPECT_EQ(shelved["shelved_by"], "ann");
  EXPECT_EQ(shelved["shelved_because"], "cleaning");
  console.Wait(15 * 60'000);
  EXPECT_TRUE(console.AlarmOf("camera_silent")["shelved_until_utc_ms"].is_null());
  EXPECT_EQ(console.AlarmOf("camera_silent")["shelved_by"], "");
}

TEST(ConsoleAlarms, ManyEventsTakeNoMoreThanTheirRoom) {
  Console console;
  for (int i = 0; i < 1000; ++i) {
    const std::string code = "code_" + std::to_string(i);
    console.Hear(EventNow(code.c_str(), true, console.now.utc));
  }
  EXPECT_EQ(console.board.own_alarms().entries().size(),
            OwnAlarms::kMostEvents + kConsoleAlarmCount);
  EXPECT_EQ(console.Part("events").size(), 60u);
}

TEST(ConsoleAlarms, AnotherMachineFileOrClockIsTold) {
  Console console;
  dds::Guidance other = GuidanceAt(console.now.utc - std::chrono::seconds(3600));
  other.machine_sha256 = "another";
  for (int i = 0; i < 60; ++i) {
    other.valid_at = console.now.utc - std::chrono::seconds(3600);
    console.Hear(other);
    console.Wait(100);
  }
  EXPECT_THAT(console.Alarms(),
              ElementsAre("hmi_bridge/other_machine_file unacknowledged",
                          "hmi_bridge/clock_disagrees unacknowledged"));
}

TEST(ConsoleAlarms, ACalibrationThatIsDueIsTold) {
  Console console;
  console.Hear(GuidanceAt(console.now.utc));
  console.Wait(99'000);
  EXPECT_TRUE(console.AlarmOf("calibration_due").is_null());
  console.Wait(1000);
  EXPECT_THAT(console.AlarmOf("calibration_due")["cause"].get<std::string>(), HasSubstr("camera"));
  EXPECT_EQ(console.Part("machine")["calibrations"][0]["due_at_utc_ms"], 1'800'000'100'000);
}

TEST(ConsoleAlarms, NoNetworkIsOne) {
  Console console;
  console.board.SetNetwork(false, console.now);
  console.Wait(100);
  console.Wait(1200);
  EXPECT_THAT(console.Alarms(), ElementsAre("hmi_bridge/no_network unacknowledged"));
  EXPECT_EQ(console.Part("bridge")["dds"]["running"], false);
  console.board.SetNetwork(true, console.now);
  console.Wait(100);
  EXPECT_EQ(console.Part("bridge")["dds"]["running"], true);
  EXPECT_THAT(console.Alarms(), ElementsAre("hmi_bridge/no_network returned_unacknowledged"));
}

TEST(ConsoleAlarms, WhatHasNoRoomIsToldByAnother) {
  Console console;
  for (int i = 0; i < static_cast<int>(OwnAlarms::kMostEvents); ++i) {
    console.Hear(EventNow(("code_" + std::to_string(i)).c_str(), true, console.now.utc));
  }
  console.Wait(100);
  EXPECT_TRUE(console.AlarmOf("too_many_events").is_null());
  console.Hear(EventNow("one_more", true, console.now.utc));
  console.Wait(100);
  const Json too_many = console.AlarmOf("too_many_events");
  ASSERT_FALSE(too_many.is_null());
  EXPECT_EQ(too_many["phase"], "unacknowledged");
  EXPECT_THAT(too_many["cause"].get<std::string>(), HasSubstr("camera_box/one_more"));
  console.Hear(EventNow("code_7", false, console.now.utc));
  ASSERT_TRUE(console.Ask("acknowledge", "camera_box/code_7"));
  console.Wait(100);
  EXPECT_EQ(console.AlarmOf("too_many_events")["phase"], "returned_unacknowledged");
  console.Hear(EventNow("one_more", true, console.now.utc));
  EXPECT_FALSE(console.AlarmOf("one_more").is_null());
}

TEST(ConsoleAlarms, EachChangeIsALineOfTheLog) {
  Console console;
  console.Hear(EventNow("camera_silent", true, console.now.utc));
  EXPECT_THAT(console.board.own_alarms().TakeNews(),
              ElementsAre("source=hmi_bridge code=alarm alarm=camera_box/camera_silent "
                          "state=unacknowledged by=\"\" text=\"the lens is covered\""));
  EXPECT_THAT(console.board.own_alarms().TakeNews(), IsEmpty());
  ASSERT_TRUE(console.Ask("acknowledge", "camera_box/camera_silent"));
  EXPECT_THAT(console.board.own_alarms().TakeNews(),
              ElementsAre(HasSubstr("state=acknowledged by=\"ann\"")));
  dds::Event over = EventNow("odd\n", true, console.now.utc);
  over.text = "a \"quote\"\x1b[2J";
  console.Hear(over);
  EXPECT_THAT(console.board.own_alarms().TakeNews(),
              ElementsAre(HasSubstr("alarm=camera_box/odd? state=unacknowledged by=\"\" "
                                    "text=\"a ?quote??[2J\"")));
}

TEST(ConsoleAlarms, OneOfSeveralCausesThatEndsClearsNothing) {
  Console console;
  dds::Alarm alarm{dds::AlarmKind::kSecondWriter, true, "tbm/v1/guidance", "TBM-1", "two of them"};
  console.board.Add(alarm, console.now);
  alarm.active = false;
  console.board.Add(alarm, console.now);
  EXPECT_EQ(console.AlarmOf("second_writer")["phase"], "unacknowledged");
  alarm.kind_stands = false;
  console.board.Add(alarm, console.now);
  EXPECT_EQ(console.AlarmOf("second_writer")["phase"], "returned_unacknowledged");
}

TEST(ConsoleAlarms, DdsThatDoesNotStartIsOne) {
  Console console;
  console.board.Add(
      dds::Alarm{dds::AlarmKind::kStartFailed, true, "tbm/v1/guidance", "reader", "no reader"},
      console.now);
  EXPECT_THAT(console.AlarmOf("dds_start_failed")["cause"].get<std::string>(),
              HasSubstr("no reader"));
}

TEST(ConsoleAlarms, TheDdsSideSpeaksToo) {
  Console console;
  console.board.Add(
      dds::Alarm{dds::AlarmKind::kSecondWriter, true, "tbm/v1/guidance", "front", "two of them"},
      console.now);
  EXPECT_THAT(console.AlarmOf("second_writer")["cause"].get<std::string>(),
              HasSubstr("two of them"));
  EXPECT_EQ(console.AlarmOf("second_writer")["urgency"], "high");
}

}  // namespace
}  // namespace tbm::hmi
