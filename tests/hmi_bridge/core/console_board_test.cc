#include <cmath>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hmi_bridge/core/console_fixture.h"
#include "tests/idl/guidance_samples.h"
#include "tests/idl/rail_samples.h"
#include "tests/idl/samples.h"

namespace tbm::hmi {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr double kNaN = dds::kNaN;

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

TEST(ViewJson, ATrolleyWithoutAPlaceHasNoNumbers) {
  dds::TrolleyState state = dds::test::FullTrolleyState();
  const Json known = ViewOf(state, nullptr);
  EXPECT_EQ(known["position_world_m"], Json({804.1, -805.2, 806.3}));
  EXPECT_EQ(known["position_sigma_mm"], Json({8.1, 8.2, 8.3}));
  EXPECT_EQ(known["status"], "open");
  const Json none = ViewOf(dds::TrolleyState(), nullptr);
  EXPECT_TRUE(none["position_world_m"].is_null() && none["speed_m_per_s"].is_null());
  EXPECT_TRUE(none["target_age_s"].is_null());
  EXPECT_EQ(none["status"], "none");
  EXPECT_EQ(ViewOf(dds::test::FullSettlementPiece())["highest_alert"], 4);
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
  console.board.Send(command, console.now);
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
  console.board.Send(dds::test::FullCommand(), console.now);
  console.Wait(7000);
  EXPECT_EQ(console.Part("commands")[0]["state"], "sent");
  console.Wait(2000);
  EXPECT_EQ(console.Part("commands")[0]["state"], "unanswered");
}

TEST(Commands, OneThatCouldNotBeSentIsNotListed) {
  Console console;
  dds::Command first = dds::test::FullCommand();
  first.request_id = "request-1";
  dds::Command second = dds::test::FullCommand();
  second.request_id = "request-2";
  console.board.Send(first, console.now);
  console.board.Send(second, console.now);
  console.board.Withdraw(second);
  ASSERT_EQ(console.Part("commands").size(), 1u);
  EXPECT_EQ(console.Part("commands")[0]["request_id"], "request-1");
}

TEST(ConsoleBoard, TargetsTakeNoMoreThanTheirRoomAndTheOldestGoes) {
  Console console;
  for (int i = 0; i < 100; ++i) {
    dds::StationObservation observation;
    observation.target = std::string_view("prism_" + std::to_string(i));
    observation.sensed_at = console.now.utc + std::chrono::seconds(i);
    console.Hear(observation);
  }
  const Json observations = console.Part("station")["observations"];
  EXPECT_EQ(observations.size(), 64u);
  for (const Json& observation : observations) EXPECT_NE(observation["target"], "prism_35");
}

TEST(ConsoleBoard, OfTwoSendersNeitherIsRememberedOrExported) {
  Console console;
  dds::Guidance guidance = GuidanceAt(console.now.utc);
  guidance.machine_id = "TBM-1";
  console.board.Add(guidance, {console.now.steady_ms, true}, console.now);
  const auto all = console.board.history().Between("cutter_face", 0, 1LL << 60, 1000);
  ASSERT_TRUE(all);
  EXPECT_TRUE((*all)["columns"]["at_utc_ms"].empty());
  const std::string metrics = console.board.Metrics(console.now);
  EXPECT_THAT(metrics, Not(HasSubstr("tbm_deviation_millimetres{")));
  EXPECT_THAT(metrics, HasSubstr("tbm_guidance_validity{machine=\"TBM-1\"} 0\n"));
  console.board.Add(guidance, {console.now.steady_ms, false}, console.now);
  EXPECT_THAT(console.board.Metrics(console.now), HasSubstr("tbm_deviation_millimetres{"));
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
