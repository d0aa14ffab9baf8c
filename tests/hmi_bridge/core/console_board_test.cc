#include "hmi_bridge/core/console_board.h"

#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/config/guidance_file.h"
#include "tests/idl/guidance_samples.h"
#include "tests/idl/samples.h"
#include "tests/support/temp_folder.h"

namespace tbm::hmi {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr double kNaN = dds::kNaN;
constexpr std::int64_t kMs = 1'000'000;

const GuidedMachine& Example() {
  static const GuidedMachine machine = [] {
    const test::TempFolder folder;
    for (const char* file : {"guidance/app/example/machine.yaml",
                             "guidance/app/example/axis.xml",
                             "pose/app/example/rig.yaml"}) {
      const std::filesystem::path from = std::string(TBM_SOURCE_DIR "/") + file;
      std::filesystem::copy_file(from, folder / from.filename().string());
    }
    MachineFaults warnings;
    auto loaded = LoadGuidedMachine(folder / "machine.yaml", &warnings);
    return std::move(loaded).value();
  }();
  return machine;
}

// A board of the example's machine, and its clock.
struct Console {
  Moment now{{1'800'000'000'000 * kMs}, 5'000'000};
  ConsoleBoard board{ConsoleMachineOf(Example().machine,
                                      Example().rig,
                                      Example().axis,
                                      Example().machine_sha256,
                                      {{"camera", {0}, {1'800'000'100'000 * kMs}}}),
                     {"1.2.3", "build-7", 25, now.utc},
                     now};

  void Wait(std::int64_t ms) {
    now.utc = now.utc + std::chrono::milliseconds(ms);
    now.steady_ms += ms;
    board.Tick(now);
  }
  template <class Message>
  void Hear(Message message) {
    message.machine_id = "TBM-1";
    board.Add(message, {now.steady_ms, false}, now);
  }
  Json Part(std::string_view name) {
    for (const Section& section : board.Sections()) {
      if (section.name == name) return Json::parse(*section.json);
    }
    ADD_FAILURE() << "no section " << name;
    return nullptr;
  }
  std::vector<std::string> Alarms() {
    std::vector<std::string> keys;
    const Json alarms = Part("alarms");
    for (const Json& alarm : alarms["list"]) {
      keys.push_back(alarm["source"].get<std::string>() + "/" + alarm["code"].get<std::string>() +
                     " " + alarm["phase"].get<std::string>());
    }
    return keys;
  }
  Json AlarmOf(const std::string& code) {
    const Json alarms = Part("alarms");
    for (const Json& alarm : alarms["list"]) {
      if (alarm["code"] == code) return alarm;
    }
    return nullptr;
  }
  Result<std::string, std::string> Ask(const char* verb,
                                       const char* argument,
                                       const char* because = "") {
    dds::Command command;
    command.addressee = kOwnAddressee;
    command.verb = verb;
    command.argument = argument;
    command.by = "ann";
    command.because = because;
    return board.Obey(command, now);
  }
};

dds::Guidance GuidanceAt(Timestamp valid_at, double chainage_m = 100.0) {
  dds::Guidance guidance;
  guidance.valid_at = valid_at;
  guidance.validity = dds::Validity::kValid;
  guidance.steer_by = "cutter_face";
  guidance.machine_sha256 = std::string_view(Example().machine_sha256);
  guidance.axis_sha256 = std::string_view(Example().axis.file_sha256());
  dds::GuidedPoint point;
  point.name = "cutter_face";
  point.shield = "front";
  point.validity = dds::Validity::kValid;
  point.deviation_right_m = 0.0123456;
  point.deviation_up_m = -0.00000001;
  point.chainage_m = chainage_m;
  guidance.points.push_back(point);
  return guidance;
}

dds::AlarmStatus AlarmNow(const char* code, dds::AlarmPhase phase, dds::AlarmUrgency urgency) {
  dds::AlarmStatus alarm;
  alarm.source = "guidance";
  alarm.code = code;
  alarm.phase = phase;
  alarm.urgency = urgency;
  return alarm;
}

dds::Event EventNow(const char* code, bool active, Timestamp at) {
  dds::Event event;
  event.source = "camera_box";
  event.code = code;
  event.severity = dds::Severity::kAlarm;
  event.active = active;
  event.at = at;
  event.text = "the lens is covered";
  return event;
}

TEST(ViewJson, MetresBecomeMillimetresAndRadiansDegrees) {
  dds::Guidance guidance = dds::test::FullGuidance();
  guidance.lead_right_per_m = -0.0015;
  guidance.articulation_up_rad = std::numbers::pi / 360;
  guidance.stroke_m = 0.75;
  const Json view = ViewOf(guidance, nullptr);
  EXPECT_EQ(view["lead_right_mm_per_m"], -1.5);
  EXPECT_EQ(view["articulation_up_deg"], 0.5);
  EXPECT_EQ(view["stroke_mm"], 750.0);
  const Json& point = view["points"][0];
  EXPECT_NEAR(point["right_mm"].get<double>(), 1e3 * guidance.points[0].deviation_right_m, 0.006);
  EXPECT_NEAR(
      point["trend_up_mm_per_m"].get<double>(), 1e3 * guidance.points[0].trend_up_per_m, 0.0006);
}

TEST(ViewJson, SpeedIsMillimetresInAMinute) {
  dds::ShieldPose pose = dds::test::FullShieldPose();
  pose.speed_m_per_s = 0.001;
  EXPECT_EQ(ViewOf(pose, nullptr)["speed_mm_per_min"], 60.0);
}

TEST(ViewJson, WhatIsNotKnownIsNull) {
  const Json view = ViewOf(dds::Guidance(), nullptr);
  EXPECT_TRUE(view["stroke_mm"].is_null());
  EXPECT_TRUE(view["ring_number"].is_null());
  EXPECT_TRUE(view["prisms"]["dof"].is_null());
  EXPECT_EQ(view["validity"], "invalid");
  const Json set_up = ViewOf(dds::StationSetUp(), nullptr);
  EXPECT_TRUE(set_up["position_in_site_m"].is_null());
  EXPECT_TRUE(set_up["set_up_at_utc_ms"].is_null());
}

TEST(ViewJson, RoundsAndKnowsNoMinusZero) {
  EXPECT_EQ(Rounded(12.3456, 2).dump(), "12.35");
  EXPECT_EQ(Rounded(-0.001, 2).dump(), "0.0");
  EXPECT_TRUE(Rounded(kNaN, 2).is_null());
  EXPECT_TRUE(Rounded(INFINITY, 2).is_null());
}

TEST(ViewJson, ResidualsAreOfTheSameFrameOrNone) {
  const Rig& rig = Example().rig;
  dds::RelativePose pose;
  pose.status = PoseStatus::kOk;
  pose.sensed_at = {77};
  pose.camera_from_target.rotation = Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX());
  pose.camera_from_target.translation = {0.0, 0.0, 4.0};
  const auto projected = Project(rig.camera, pose.camera_from_target * rig.leds[1].p_led_in_target);
  ASSERT_TRUE(projected);
  dds::FrameFeatures frame;
  frame.sensed_at = {77};
  frame.spots.push_back({});
  frame.spots[0].led_index = 1;
  frame.spots[0].centre.pixel_px = projected->pixel_px + Eigen::Vector2d(0.25, -0.5);
  const Json of_frame = ViewOf(frame, &pose, rig, nullptr)["spots"][0];
  EXPECT_EQ(of_frame["led"], rig.leds[1].id);
  EXPECT_EQ(of_frame["residual_u_px"], 0.25);
  EXPECT_EQ(of_frame["residual_v_px"], -0.5);
  frame.sensed_at = {78};
  EXPECT_TRUE(ViewOf(frame, &pose, rig, nullptr)["spots"][0]["residual_u_px"].is_null());
  frame.sensed_at = {77};
  pose.status = PoseStatus::kNone;
  EXPECT_TRUE(ViewOf(frame, &pose, rig, nullptr)["spots"][0]["residual_u_px"].is_null());
  EXPECT_TRUE(ViewOf(frame, nullptr, rig, nullptr)["spots"][0]["residual_u_px"].is_null());
}

TEST(ViewJson, AnLedThatTheRigDoesNotHaveIsNone) {
  dds::FrameFeatures frame;
  frame.spots.push_back({});
  frame.spots[0].led_index = 31;
  EXPECT_TRUE(ViewOf(frame, nullptr, Example().rig, nullptr)["spots"][0]["led"].is_null());
}

TEST(Age, IsTheWorseOfStampAndArrivalAndAFutureStampIsAsDoubtful) {
  const Moment now{{10'000 * kMs}, 500};
  EXPECT_EQ(AgeMs({.heard_steady_ms = 400}, {9'950 * kMs}, now), 100);
  EXPECT_EQ(AgeMs({.heard_steady_ms = 490}, {9'000 * kMs}, now), 1000);
  EXPECT_EQ(AgeMs({.heard_steady_ms = 490}, {13'000 * kMs}, now), 3000);
}

TEST(ConsoleBoard, OnlyWhatChangedIsMadeAnew) {
  Console console;
  console.Hear(GuidanceAt(console.now.utc));
  const auto before = console.board.Sections();
  console.Hear(dds::test::FullTiltReading());
  const auto after = console.board.Sections();
  for (std::size_t i = 0; i < before.size(); ++i) {
    const bool is_tilts = before[i].name == "tilts";
    EXPECT_EQ(after[i].version != before[i].version, is_tilts) << before[i].name;
    EXPECT_EQ(after[i].json != before[i].json, is_tilts) << before[i].name;
  }
}

TEST(ConsoleBoard, EveryVersionGrows) {
  Console console;
  console.Hear(GuidanceAt(console.now.utc));
  const std::uint64_t first = console.board.Sections()[2].version;
  console.Hear(GuidanceAt(console.now.utc));
  EXPECT_GT(console.board.Sections()[2].version, first);
}

TEST(ConsoleBoard, AnotherMachineIsNotShown) {
  Console console;
  dds::Guidance guidance = GuidanceAt(console.now.utc);
  guidance.machine_id = "TBM-2";
  console.board.Add(guidance, {console.now.steady_ms, false}, console.now);
  EXPECT_TRUE(console.Part("guidance").is_null());
  EXPECT_THAT(console.board.Metrics(console.now),
              HasSubstr("tbm_messages_of_other_machines_total{machine=\"TBM-1\"} 1\n"));
}

TEST(ConsoleBoard, TellsWhenItCameAndWhenItIsStale) {
  Console console;
  const Timestamp valid_at = console.now.utc - std::chrono::milliseconds(30);
  console.Hear(GuidanceAt(valid_at));
  const Json timing = console.Part("guidance")["timing"];
  EXPECT_EQ(timing["stamp_utc_ms"], valid_at.ns / kMs);
  EXPECT_EQ(timing["heard_steady_ms"], console.now.steady_ms);
  EXPECT_EQ(timing["stale_after_ms"], 400);
  EXPECT_FALSE(timing.contains("contested"));
  console.board.Add(dds::test::FullGuidance(), {1, true}, console.now);  // of another machine
  dds::Guidance rival = GuidanceAt(valid_at);
  rival.machine_id = "TBM-1";
  console.board.Add(rival, {console.now.steady_ms, true}, console.now);
  EXPECT_EQ(console.Part("guidance")["timing"]["contested"], true);
}

TEST(ConsoleBoard, TheMachineSectionHasTheDesignAhead) {
  Console console;
  const Json machine = console.Part("machine");
  EXPECT_EQ(machine["steer_by"], "cutter_face");
  EXPECT_EQ(machine["deviation_limit_mm"], 50.0);
  EXPECT_EQ(machine["leds"].size(), Example().rig.leds.size());
  const Json& axis = machine["axis"];
  ASSERT_GT(axis.size(), 10u);
  EXPECT_EQ(axis.front()["chainage_m"], machine["axis_start_m"]);
  EXPECT_EQ(axis.back()["chainage_m"], machine["axis_end_m"]);
}

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

TEST(ConsoleAlarms, TheDdsSideSpeaksToo) {
  Console console;
  console.board.Add(
      dds::Alarm{dds::AlarmKind::kSecondWriter, true, "tbm/v1/guidance", "two of them"},
      console.now);
  EXPECT_THAT(console.AlarmOf("second_writer")["cause"].get<std::string>(),
              HasSubstr("two of them"));
  EXPECT_EQ(console.AlarmOf("second_writer")["urgency"], "high");
}

TEST(ConsoleBoard, EventsOfThePastStandInTheOrderOfTime) {
  Console console;
  console.Hear(EventNow("second", false, {2000 * kMs}));
  console.Hear(EventNow("third", false, {3000 * kMs}));
  console.Hear(EventNow("first", false, {1000 * kMs}));
  const Json events = console.Part("events");
  EXPECT_EQ(events[0]["code"], "third");
  EXPECT_EQ(events[2]["code"], "first");
}

TEST(ConsoleBoard, TextThatIsNoUtf8HarmsNothing) {
  Console console;
  dds::Event event = EventNow("odd", false, console.now.utc);
  event.text = "\xff\xfe";
  console.Hear(event);
  EXPECT_EQ(console.Part("events").size(), 1u);
}

struct CommandCase {
  const char* addressee;
  const char* verb;
  Role role;
  int status;  // 0: it is a command
};

TEST(CommandOf, RolesAndVerbs) {
  for (const CommandCase& c : {CommandCase{"guidance", "acknowledge", Role::kOperator, 0},
                               CommandCase{"guidance", "acknowledge", Role::kViewer, 403},
                               CommandCase{"guidance", "set_up", Role::kSurveyor, 400},
                               CommandCase{"total_station", "set_up", Role::kSurveyor, 0},
                               CommandCase{"total_station", "set_up", Role::kOperator, 403},
                               CommandCase{"total_station", "shelve", Role::kOperator, 0},
                               CommandCase{"hmi_bridge", "unshelve", Role::kOperator, 0},
                               CommandCase{"hmi_bridge", "pause", Role::kSurveyor, 400},
                               CommandCase{"camera_box", "acknowledge", Role::kSurveyor, 400},
                               CommandCase{"", "", Role::kSurveyor, 400},
                               CommandCase{"guidance", "Acknowledge", Role::kSurveyor, 400}}) {
    const auto command = CommandOf({c.addressee, c.verb, "x", ""}, "ann", c.role);
    EXPECT_EQ(command ? 0 : command.error().http_status, c.status) << c.addressee << " " << c.verb;
    if (command) {
      EXPECT_EQ(command->by.view(), "ann");
    }
  }
}

TEST(CommandOf, NothingIsCutOffInSilence) {
  const std::string long_text(129, 'x');
  EXPECT_FALSE(CommandOf({"guidance", "acknowledge", long_text, ""}, "ann", Role::kSurveyor));
  EXPECT_FALSE(CommandOf({"guidance", "acknowledge", "x", long_text}, "ann", Role::kSurveyor));
  EXPECT_FALSE(
      CommandOf({"guidance", "acknowledge", std::string("a\0b", 3), ""}, "ann", Role::kSurveyor));
  EXPECT_FALSE(CommandOf({"guidance", "acknowledge", "a\nb", ""}, "ann", Role::kSurveyor));
}

TEST(Commands, AreFollowedUntilTheyAreAnswered) {
  Console console;
  dds::Command command = dds::test::FullCommand();
  command.addressee = "total_station";
  command.request_id = "request-1";
  console.board.Sent(command, console.now);
  EXPECT_EQ(console.Part("commands")[0]["state"], "sent");
  dds::CommandReply reply;
  reply.request_id = "request-1";
  reply.source = "guidance";  // not the one that was asked
  reply.outcome = dds::CommandOutcome::kDone;
  console.Hear(reply);
  EXPECT_EQ(console.Part("commands")[0]["state"], "sent");
  reply.source = "total_station";
  reply.outcome = dds::CommandOutcome::kAccepted;
  console.Hear(reply);
  console.Wait(20'000);
  EXPECT_EQ(console.Part("commands")[0]["state"], "accepted");
  reply.outcome = dds::CommandOutcome::kFailed;
  reply.text = "no reference was found";
  console.Hear(reply);
  EXPECT_EQ(console.Part("commands")[0]["state"], "failed");
  EXPECT_EQ(console.Part("commands")[0]["text"], "no reference was found");
}

TEST(Commands, OfWhichNothingIsHeardAreUnanswered) {
  Console console;
  console.board.Sent(dds::test::FullCommand(), console.now);
  console.Wait(7000);
  EXPECT_EQ(console.Part("commands")[0]["state"], "sent");
  console.Wait(2000);
  EXPECT_EQ(console.Part("commands")[0]["state"], "unanswered");
}

TEST(History, KeepsOneRowASecond) {
  Console console;
  for (int i = 0; i < 50; ++i) {
    console.Hear(GuidanceAt(console.now.utc));
    console.Wait(200);
  }
  const auto all = console.board.history().Between("cutter_face", 0, 1LL << 60, 1000);
  ASSERT_TRUE(all);
  const Json& columns = (*all)["columns"];
  EXPECT_EQ(columns["at_utc_ms"].size(), 10u);
  EXPECT_EQ(columns["right_mm"][0], 12.35);
  EXPECT_EQ(columns["chainage_m"][0], 100.0);
  EXPECT_EQ(columns["validity"][0], "valid");
  EXPECT_FALSE(console.board.history().Between("nothing", 0, 1LL << 60, 1000));
}

TEST(History, ThinsOutEvenlyAndKeepsBothEnds) {
  Console console;
  std::vector<std::int64_t> stamps;
  for (int i = 0; i < 101; ++i) {
    stamps.push_back(Milliseconds(console.now.utc));
    console.Hear(GuidanceAt(console.now.utc));
    console.Wait(1000);
  }
  const auto few = console.board.history().Between("cutter_face", 0, 1LL << 60, 3);
  EXPECT_THAT((*few)["columns"]["at_utc_ms"],
              ElementsAre(stamps.front(), stamps[50], stamps.back()));
}

TEST(History, WhatWasNotKnownIsAGapAndNoZero) {
  Console console;
  dds::Guidance blind = GuidanceAt(console.now.utc);
  blind.points[0] = {};
  blind.points[0].name = "cutter_face";
  console.Hear(blind);
  const auto all = console.board.history().Between("cutter_face", 0, 1LL << 60, 10);
  EXPECT_TRUE((*all)["columns"]["right_mm"][0].is_null());
  EXPECT_EQ((*all)["columns"]["validity"][0], "invalid");
}

TEST(History, AdvanceHasARowForEachFiftyMillimetres) {
  Console console;
  for (int i = 0; i <= 1000; ++i) {
    console.Hear(GuidanceAt(console.now.utc, 100.0 + 0.01 * i));
    console.Wait(100);
  }
  const auto back = console.board.history().Back("cutter_face", 5.0);
  ASSERT_TRUE(back);
  const Json& chainage = (*back)["columns"]["chainage_m"];
  ASSERT_GE(chainage.size(), 80u);
  EXPECT_LE(chainage.size(), 101u);
  EXPECT_GE(chainage.front().get<double>(), 105.0 - 0.06);
}

TEST(History, AnotherDriveForgetsWhatLiesAhead) {
  Console console;
  console.Hear(GuidanceAt(console.now.utc, 100.0));
  console.Hear(GuidanceAt(console.now.utc, 101.0));
  console.Hear(GuidanceAt(console.now.utc, 50.0));
  const auto back = console.board.history().Back("cutter_face", 1000.0);
  EXPECT_THAT((*back)["columns"]["chainage_m"], ElementsAre(50.0));
}

TEST(RowRing, TheOldestMakesRoom) {
  RowRing ring(3, 1);
  for (int i = 0; i < 5; ++i) ring.Push({static_cast<float>(i)}, i, i);
  ASSERT_EQ(ring.size(), 3u);
  EXPECT_EQ(ring.at_utc_ms(0), 2);
  EXPECT_EQ(ring.row(2)[0], 4.0f);
  ring.DropNewest();
  EXPECT_EQ(ring.at_utc_ms(ring.size() - 1), 3);
}

TEST(Metrics, AStaleDeviationIsNotExported) {
  Console console;
  console.Hear(GuidanceAt(console.now.utc));
  EXPECT_THAT(console.board.Metrics(console.now),
              HasSubstr("tbm_deviation_millimetres{direction=\"right\",point=\"cutter_face\","
                        "machine=\"TBM-1\"} 12.3456\n"));
  console.Wait(500);
  EXPECT_THAT(console.board.Metrics(console.now),
              Not(HasSubstr("tbm_deviation_millimetres{direction")));
}

TEST(Metrics, AllLinesOfAMetricStandTogether) {
  Console console;
  console.Hear(GuidanceAt(console.now.utc));
  console.Hear(dds::test::FullRelativePose());
  console.Hear(dds::test::FullDeviceHealth());
  std::istringstream lines(console.board.Metrics(console.now));
  std::map<std::string, int> groups;
  std::string last;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("#")) continue;
    const std::string name = line.substr(0, line.find('{'));
    if (name != last) ++groups[name];
    last = name;
  }
  EXPECT_EQ(groups.count("tbm_age_seconds"), 1u);
  for (const auto& [name, count] : groups) EXPECT_EQ(count, 1) << name;
}

TEST(Metrics, LabelsCannotBreakOut) {
  Console console;
  dds::DeviceHealth health = dds::test::FullDeviceHealth();
  health.device_id = "a\"b\\c\nd";
  console.Hear(health);
  EXPECT_THAT(console.board.Metrics(console.now), HasSubstr("device=\"a\\\"b\\\\c\\nd\""));
}

}  // namespace
}  // namespace tbm::hmi
