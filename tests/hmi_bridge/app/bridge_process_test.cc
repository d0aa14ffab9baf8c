#include "hmi_bridge/app/bridge_process.h"

#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/config/guidance_file.h"
#include "hmi_bridge/server/auth_store.h"
#include "hmi_bridge/server/console_server.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "tests/idl/dds_support.h"
#include "tests/idl/guidance_samples.h"
#include "tests/idl/samples.h"
#include "tests/support/temp_folder.h"

// The console's process between real DDS and a real server, on loopback.
namespace tbm::hmi {
namespace {

using namespace std::chrono_literals;
using dds::test::Eventually;
using ::testing::HasSubstr;

constexpr int kDomain = 193;

class BridgeProcessOnDds : public testing::Test {
 protected:
  BridgeProcessOnDds() {
    for (const char* file : {"guidance/app/example/machine.yaml",
                             "guidance/app/example/axis.xml",
                             "pose/app/example/rig.yaml"}) {
      const std::filesystem::path from = std::string(TBM_SOURCE_DIR "/") + file;
      std::filesystem::copy_file(from, folder_ / from.filename().string());
    }
    MachineFaults warnings;
    machine_.emplace(std::move(LoadGuidedMachine(folder_ / "machine.yaml", &warnings)).value());
    auth_ = std::move(AuthStore::Open(folder_ / "state", clock_)).value();
    state_.emplace(PrivateFolder::Open(folder_ / "state").value());
    process_ = std::make_unique<BridgeProcess>(
        ConsoleMachineOf(
            machine_->machine, machine_->rig, machine_->axis, machine_->machine_sha256, {}),
        BridgeFacts{"1", "build", kDomain, clock_.Now()},
        *state_,
        ReportPlaces{"/bin/true", folder_ / "axis.xml", {}, ""},
        participant_,
        clock_);
    server_ =
        std::make_unique<ConsoleServer>(ServerOptions{}, *process_, *process_, *auth_, clock_);
    EXPECT_TRUE(server_->Start().empty());
    process_->Listen(*server_);
    running_ = std::jthread([this](const std::stop_token& stop) { process_->Run(stop, {}); });
  }
  ~BridgeProcessOnDds() override {
    running_.request_stop();
    running_.join();
    process_->StopListening();
    server_->Stop();
  }

  Json Part(std::string_view name) {
    for (const Section& section : process_->Now().sections) {
      if (section.name == name) return Json::parse(*section.json);
    }
    return nullptr;
  }
  static std::string FaultOf(const ApiAnswer& answer) {
    const auto* fault = std::get_if<ApiFault>(&answer);
    return fault == nullptr ? "" : std::to_string(fault->http_status) + " " + fault->text;
  }
  std::string Audit() { return test::ReadText(state_->PathOf("audit.log")); }

  const SystemClock clock_;
  test::TempFolder folder_;
  std::optional<GuidedMachine> machine_;
  std::unique_ptr<AuthStore> auth_;
  std::optional<PrivateFolder> state_;
  dds::Participant participant_{dds::test::OnLoopback(kDomain, "bridge")};
  dds::Participant others_{dds::test::OnLoopback(kDomain, "others")};
  std::unique_ptr<BridgeProcess> process_;
  std::unique_ptr<ConsoleServer> server_;
  std::jthread running_;
};

// Of the console's machine, and of now.
template <class Message>
Message Ours(Message message, Timestamp now) {
  message.machine_id = "TBM-1";
  if constexpr (requires { message.published_at; }) message.published_at = now;
  if constexpr (requires { message.valid_at; }) message.valid_at = now;
  if constexpr (requires { message.sensed_at; }) message.sensed_at = now;
  return message;
}

TEST_F(BridgeProcessOnDds, ShowsEveryTopic) {
  dds::Publisher<dds::Guidance> guidance(others_);
  dds::Publisher<dds::ShieldPose> shields(others_);
  dds::Publisher<dds::RelativePose> poses(others_);
  dds::Publisher<dds::FrameFeatures> frames(others_);
  dds::Publisher<dds::TiltReading> tilts(others_);
  dds::Publisher<dds::StationSetUp> set_ups(others_);
  dds::Publisher<dds::StationObservation> observations(others_);
  dds::Publisher<dds::DeviceHealth> health(others_);
  dds::Publisher<dds::AlarmStatus> alarms(others_);
  dds::Publisher<dds::Event> events(others_);
  ASSERT_TRUE(Eventually([&] {
    return guidance.matched_readers() > 0 && shields.matched_readers() > 0 &&
           poses.matched_readers() > 0 && frames.matched_readers() > 0 &&
           tilts.matched_readers() > 0 && set_ups.matched_readers() > 0 &&
           observations.matched_readers() > 0 && health.matched_readers() > 0 &&
           alarms.matched_readers() > 0 && events.matched_readers() > 0;
  }));
  const Timestamp now = clock_.Now();
  dds::ShieldPose shield = Ours(dds::test::FullShieldPose(), now);
  shield.shield = "front";
  dds::StationSetUp set_up = Ours(dds::test::FullStationSetUp(), now);
  set_up.role = "in_use";
  EXPECT_EQ(guidance.Write(Ours(dds::test::FullGuidance(), now)), dds::WriteOutcome::kWritten);
  EXPECT_EQ(shields.Write(shield), dds::WriteOutcome::kWritten);
  EXPECT_EQ(poses.Write(Ours(dds::test::FullRelativePose(), now)), dds::WriteOutcome::kWritten);
  EXPECT_EQ(frames.Write(Ours(dds::test::FullFrameFeatures(), now)), dds::WriteOutcome::kWritten);
  EXPECT_EQ(tilts.Write(Ours(dds::test::FullTiltReading(), now)), dds::WriteOutcome::kWritten);
  EXPECT_EQ(set_ups.Write(set_up), dds::WriteOutcome::kWritten);
  EXPECT_EQ(observations.Write(Ours(dds::test::FullStationObservation(), now)),
            dds::WriteOutcome::kWritten);
  EXPECT_EQ(health.Write(Ours(dds::test::FullDeviceHealth(), now)), dds::WriteOutcome::kWritten);
  EXPECT_EQ(alarms.Write(Ours(dds::test::FullAlarmStatus(), now)), dds::WriteOutcome::kWritten);
  EXPECT_EQ(events.Write(Ours(dds::test::FullEvent(), now)), dds::WriteOutcome::kWritten);
  EXPECT_TRUE(Eventually([&] {
    return !Part("guidance").is_null() && !Part("shields")["front"].is_null() &&
           !Part("camera")["pose"].is_null() && !Part("camera")["frame"].is_null() &&
           Part("tilts").size() == 1 && !Part("station")["in_use"].is_null() &&
           Part("station")["observations"].size() == 1 && Part("devices").size() == 1 &&
           !Part("alarms")["list"].empty() && Part("events").size() == 1;
  }));
  EXPECT_THAT(process_->Metrics(),
              HasSubstr("tbm_samples_total{topic=\"tbm/v1/guidance\",outcome=\"delivered\"} 1\n"));
  EXPECT_TRUE(Eventually([&] { return Part("bridge")["dds"]["running"] == true; }));
}

TEST_F(BridgeProcessOnDds, ACommandGoesOutInThePersonsNameAndItsAnswerIsShown) {
  dds::Subscriber<dds::Command> commands(others_);
  dds::Publisher<dds::CommandReply> replies(others_);
  ASSERT_TRUE(
      Eventually([&] { return commands.matched_writers() > 0 && replies.matched_readers() > 0; }));
  const Timestamp before = clock_.Now();
  const auto answer = process_->Ask(
      {"total_station", "check_references", "", "after blasting"}, "ann", Role::kSurveyor);
  ASSERT_EQ(FaultOf(answer), "");
  const std::string id = Json::parse(std::get<std::string>(answer))["request_id"];
  dds::Command heard;
  dds::SampleFacts facts;
  ASSERT_TRUE(commands.Take(heard, facts, 5s));
  EXPECT_EQ(heard.machine_id.view(), "TBM-1");
  EXPECT_EQ(heard.request_id.view(), id);
  EXPECT_EQ(heard.addressee.view(), "total_station");
  EXPECT_EQ(heard.verb.view(), "check_references");
  EXPECT_EQ(heard.by.view(), "ann");
  EXPECT_EQ(heard.because.view(), "after blasting");
  EXPECT_GE(heard.issued_at, before);
  EXPECT_EQ(heard.expires_at - heard.issued_at, Duration(30s));
  EXPECT_THAT(Audit(), HasSubstr("\"outcome\":\"sent as " + id + "\""));
  dds::CommandReply reply;
  reply.machine_id = "TBM-1";
  reply.request_id = std::string_view(id);
  reply.source = "total_station";
  reply.outcome = dds::CommandOutcome::kAccepted;
  reply.text = "measuring";
  reply.published_at = clock_.Now();
  EXPECT_EQ(replies.Write(reply), dds::WriteOutcome::kWritten);
  EXPECT_TRUE(Eventually([&] { return Part("commands")[0]["state"] == "accepted"; }));
}

TEST_F(BridgeProcessOnDds, WhatMayNotBeAskedIsNotSentButWrittenDown) {
  dds::Subscriber<dds::Command> commands(others_);
  ASSERT_TRUE(Eventually([&] { return commands.matched_writers() > 0; }));
  EXPECT_THAT(FaultOf(process_->Ask({"total_station", "set_up", "", ""}, "bob", Role::kOperator)),
              HasSubstr("403"));
  dds::Command heard;
  dds::SampleFacts facts;
  EXPECT_FALSE(commands.Take(heard, facts, 300ms));
  EXPECT_THAT(Audit(), HasSubstr("\"outcome\":\"refused: "));
}

TEST_F(BridgeProcessOnDds, WithoutAnAuditLogNothingIsDone) {
  dds::Subscriber<dds::Command> commands(others_);
  ASSERT_TRUE(Eventually([&] { return commands.matched_writers() > 0; }));
  std::filesystem::create_directory(state_->PathOf("audit.log"));
  EXPECT_THAT(
      FaultOf(process_->Ask({"guidance", "acknowledge", "roll_high", ""}, "ann", Role::kOperator)),
      HasSubstr("503"));
  dds::Command heard;
  dds::SampleFacts facts;
  EXPECT_FALSE(commands.Take(heard, facts, 300ms));
}

TEST_F(BridgeProcessOnDds, ItsOwnAlarmsAreAnsweredHereAndTheJournalHearsOfIt) {
  dds::Publisher<dds::Event> events(others_);
  dds::Subscriber<dds::Command> commands(others_);
  ASSERT_TRUE(
      Eventually([&] { return events.matched_readers() > 0 && commands.matched_writers() > 0; }));
  dds::Event event = Ours(dds::test::FullEvent(), clock_.Now());
  event.source = "camera_box";
  event.code = "camera_silent";
  event.severity = dds::Severity::kAlarm;
  event.active = true;
  EXPECT_EQ(events.Write(event), dds::WriteOutcome::kWritten);
  ASSERT_TRUE(Eventually([&] { return !Part("alarms")["list"].empty(); }));
  ASSERT_EQ(
      FaultOf(process_->Ask(
          {"hmi_bridge", "acknowledge", "camera_box/camera_silent", ""}, "ann", Role::kOperator)),
      "");
  EXPECT_EQ(Part("alarms")["list"][0]["phase"], "acknowledged");
  EXPECT_EQ(Part("commands")[0]["state"], "done");
  dds::Command heard;
  dds::SampleFacts facts;
  ASSERT_TRUE(commands.Take(heard, facts, 5s));
  EXPECT_EQ(heard.addressee.view(), "hmi_bridge");
  EXPECT_EQ(heard.argument.view(), "camera_box/camera_silent");
  EXPECT_THAT(test::ReadText(state_->PathOf("answers.json")), HasSubstr("camera_silent"));
}

TEST_F(BridgeProcessOnDds, ReportsAreForSurveyorsAndTheirStateIsShown) {
  const std::string axis_check = R"({"kind":"axis_check"})";
  EXPECT_THAT(FaultOf(process_->StartReport(axis_check, "bob", Role::kOperator)), HasSubstr("403"));
  ASSERT_EQ(FaultOf(process_->StartReport(axis_check, "ann", Role::kSurveyor)), "");
  EXPECT_TRUE(Eventually([&] { return Part("reports")[0]["state"] == "done"; }));
  EXPECT_EQ(process_->ReportFile("1", "nothing"), nullptr);
  EXPECT_THAT(Audit(), HasSubstr("not a surveyor"));
}

TEST_F(BridgeProcessOnDds, ACommandThatNobodyHearsIsToldAtOnce) {
  EXPECT_THAT(
      FaultOf(process_->Ask({"guidance", "acknowledge", "roll_high", ""}, "ann", Role::kOperator)),
      HasSubstr("503"));
  EXPECT_THAT(Audit(), HasSubstr("\"outcome\":\"sent as "));
  EXPECT_THAT(Audit(), HasSubstr("\"outcome\":\"not sent: "));
  EXPECT_TRUE(Part("commands").empty());
}

TEST_F(BridgeProcessOnDds, AnAnswerThatComesAtOnceIsNotLost) {
  dds::Publisher<dds::CommandReply> replies(others_);
  const dds::Subscriber<dds::Command> commands(
      others_, [&](const dds::Command& command, const dds::SampleFacts&) {
        dds::CommandReply reply;
        reply.machine_id = command.machine_id;
        reply.request_id = command.request_id;
        reply.source = command.addressee;
        reply.outcome = dds::CommandOutcome::kDone;
        reply.text = "done";
        reply.published_at = clock_.Now();
        replies.Write(reply);
      });
  ASSERT_TRUE(
      Eventually([&] { return commands.matched_writers() > 0 && replies.matched_readers() > 0; }));
  for (int i = 0; i < 20; ++i) {
    ASSERT_EQ(FaultOf(process_->Ask(
                  {"guidance", "acknowledge", "roll_high", ""}, "ann", Role::kOperator)),
              "");
  }
  EXPECT_TRUE(Eventually([&] {
    const Json asked = Part("commands");
    return std::all_of(
        asked.begin(), asked.end(), [](const Json& one) { return one["state"] == "done"; });
  }));
}

}  // namespace
}  // namespace tbm::hmi
