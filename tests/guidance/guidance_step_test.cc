// The guidance without clock, DDS and files: messages in, messages out, and the same again from a
// journal.
#include "guidance/app/guidance_step.h"

#include <cmath>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/app/journal_replay.h"
#include "guidance/app/replay_command.h"
#include "guidance/journal/mcap_writer.h"
#include "idl/cpp/codec.h"
#include "idl/cpp/topics.h"
#include "tests/guidance/drive_messages.h"
#include "tests/support/temp_folder.h"

namespace tbm::test {
namespace {

using std::chrono::seconds;
using testing::HasSubstr;

const GuidedMachine& TheMachine() {
  static const GuidedMachine machine = ExampleMachine();
  return machine;
}

dds::Command Acknowledge(std::string_view code, Timestamp now) {
  dds::Command command;
  command.machine_id = std::string_view(TheMachine().machine.machine_id);
  command.request_id = "request-1";
  command.addressee = "guidance";
  command.verb = "acknowledge";
  command.argument = code;
  command.by = "O. Perator";
  command.issued_at = now;
  command.expires_at = now + seconds(5);
  return command;
}

class Step : public testing::Test {
 protected:
  const GuidanceStep::Output& DriveTo(double chainage_m) {
    drive_.Measure(chainage_m);
    for (const GuidanceMessage& message : messages_.From(drive_.inputs())) step_.Take(message);
    return step_.Step(drive_.now());
  }

  Drive drive_{TheMachine(), {}, "guidance step"};
  DriveMessages messages_{TheMachine().machine};
  GuidanceStep step_{TheMachine().machine, TheMachine().rig, TheMachine().axis, "abc"};
};

TEST_F(Step, SaysWhatTheCoreConcludedInTheWordsOfTheTopics) {
  const Drive::Epoch epoch = drive_.Measure(2100.0);
  for (const GuidanceMessage& message : messages_.From(drive_.inputs())) step_.Take(message);
  const GuidanceStep::Output& said = step_.Step(drive_.now());
  const Snapshot& core = epoch.snapshot;  // of another core that got the same
  const dds::Guidance& guidance = said.guidance;
  EXPECT_EQ(guidance.validity, dds::Validity::kValid);
  EXPECT_TRUE(guidance.reason.empty());
  EXPECT_EQ(guidance.steer_by.view(), "cutter_face");
  EXPECT_EQ(guidance.axis_sha256.view(), TheMachine().axis.file_sha256());
  EXPECT_EQ(guidance.machine_sha256.view(), "abc");
  EXPECT_EQ(guidance.sample_number, 1u);
  ASSERT_EQ(guidance.points.size(), TheMachine().machine.points.size());
  for (std::size_t i = 0; i < guidance.points.size(); ++i) {
    const dds::GuidedPoint& point = guidance.points[i];
    const Deviation& deviation = core.points[i].deviation;
    EXPECT_EQ(point.name.view(), TheMachine().machine.points[i].name);
    EXPECT_EQ(point.deviation_right_m, deviation.right_m);
    EXPECT_EQ(point.deviation_up_m, *deviation.up_m);
    EXPECT_EQ(point.deviation_right_sigma_m, deviation.right_sigma_m);
    EXPECT_EQ(point.deviation_up_sigma_m, deviation.up_sigma_m);
    EXPECT_EQ(point.chainage_m, deviation.chainage.m);
    EXPECT_EQ(point.official_chainage_m, deviation.official.m);
    EXPECT_EQ(point.position_in_site_m, core.points[i].p_in_site.p);
    EXPECT_TRUE(std::isnan(point.trend_right_per_m));  // nothing driven yet
  }
  EXPECT_EQ(guidance.lead_right_per_m, core.lead->right_per_m);
  EXPECT_EQ(guidance.lead_up_per_m, *core.lead->up_per_m);
  EXPECT_EQ(guidance.articulation_up_rad, core.joint->articulation.up_rad);
  EXPECT_EQ(guidance.stroke_m, *core.joint->stroke_m);
  EXPECT_EQ(guidance.ring_number, *core.ring_number);
  EXPECT_EQ(guidance.ahead.size(), 20u);
  EXPECT_EQ(guidance.ahead[9].deviation_right_sigma_m, core.ahead[9].right.sigma_m);
  ASSERT_EQ(guidance.sources.size(), 4u);
  EXPECT_EQ(guidance.sources[0].name.view(), "station");
  EXPECT_EQ(guidance.sources[0].freshness, dds::SourceFreshness::kFresh);
  EXPECT_EQ(said.front.site_from_shield, core.front.site_from_shield.b_from_a);
  EXPECT_EQ(said.rear.covariance, core.rear.site_from_shield.covariance);
  EXPECT_EQ(said.front.roll_rad, core.front.attitude.roll_rad);
  EXPECT_EQ(said.front.heading_sigma_rad, std::sqrt(core.front.attitude_covariance(0, 0)));
  EXPECT_EQ(said.alarms.size(), kGuidanceAlarmCount);
  // And the contract takes all of it.
  std::vector<std::byte> bytes;
  EXPECT_EQ(dds::EncodeCdr(guidance, &bytes), dds::BoundaryFault::kNone);
  EXPECT_EQ(dds::EncodeCdr(said.rear, &bytes), dds::BoundaryFault::kNone);
  EXPECT_EQ(dds::EncodeCdr(said.front, &bytes), dds::BoundaryFault::kNone);
  for (const dds::AlarmStatus& alarm : said.alarms) {
    EXPECT_EQ(dds::EncodeCdr(alarm, &bytes), dds::BoundaryFault::kNone);
  }
}

TEST_F(Step, WithoutAnyNeighbourItSaysWhatIsMissingAndBreaksNoContract) {
  const GuidanceStep::Output& said = step_.Step(drive_.now());
  EXPECT_EQ(said.guidance.validity, dds::Validity::kInvalid);
  EXPECT_EQ(said.guidance.reason.view(), "no_relative_pose");
  EXPECT_EQ(said.rear.reason.view(), "no_set_up");
  EXPECT_TRUE(std::isnan(said.guidance.lead_right_per_m));
  EXPECT_EQ(said.guidance.ring_number, -1);
  std::vector<std::byte> bytes;
  EXPECT_EQ(dds::EncodeCdr(said.guidance, &bytes), dds::BoundaryFault::kNone);
  EXPECT_EQ(dds::EncodeCdr(said.rear, &bytes), dds::BoundaryFault::kNone);
  EXPECT_EQ(dds::EncodeCdr(said.front, &bytes), dds::BoundaryFault::kNone);
}

TEST_F(Step, ListensToItsOwnMachineOnly) {
  drive_.Measure(2100.0);
  for (GuidanceMessage message : messages_.From(drive_.inputs())) {
    std::visit([](auto& one) { one.machine_id = "another"; }, message);
    step_.Take(message);
  }
  EXPECT_EQ(step_.Step(drive_.now()).rear.reason.view(), "no_set_up");
}

TEST_F(Step, OtherRolesReferencesAndStrangePrismsAreNoInputs) {
  dds::StationSetUp set_up;
  set_up.role = "proposed";
  EXPECT_FALSE(InputOf(set_up));
  dds::StationObservation seen;
  seen.status = dds::ObservationStatus::kGood;
  seen.position_in_site_m.setZero();
  seen.target = "RS1";
  EXPECT_TRUE(InputOf(seen, TheMachine().machine));
  seen.target = "RS9";
  EXPECT_FALSE(InputOf(seen, TheMachine().machine));
  seen.target = "RS1";
  seen.kind = dds::ObservedKind::kReference;
  EXPECT_FALSE(InputOf(seen, TheMachine().machine));
  seen.kind = dds::ObservedKind::kPrism;
  seen.status = dds::ObservationStatus::kNone;
  EXPECT_FALSE(InputOf(seen, TheMachine().machine));
}

TEST_F(Step, AnAlarmIsToldOnceAnsweredByNameAndRefusedWhenThereIsNone) {
  DriveTo(2100.0);
  const Timestamp lost = drive_.now() + seconds(600);  // nothing came for ten minutes
  step_.Step(lost);
  const GuidanceStep::Output& raised = step_.Step(lost + seconds(3));
  ASSERT_FALSE(raised.events.empty());
  EXPECT_TRUE(raised.events.front().active);
  step_.Take(Acknowledge("position_lost", lost + seconds(3)));
  const GuidanceStep::Output& answered = step_.Step(lost + seconds(4));
  ASSERT_EQ(answered.replies.size(), 1u);
  EXPECT_EQ(answered.replies[0].outcome, dds::CommandOutcome::kDone);
  EXPECT_EQ(answered.replies[0].request_id.view(), "request-1");
  const auto alarm = std::find_if(answered.alarms.begin(), answered.alarms.end(), [](auto& one) {
    return one.code.view() == "position_lost";
  });
  ASSERT_NE(alarm, answered.alarms.end());
  EXPECT_EQ(alarm->phase, dds::AlarmPhase::kAcknowledged);
  EXPECT_EQ(alarm->acknowledged_by.view(), "O. Perator");
  EXPECT_FALSE(alarm->cause.empty() || alarm->response.empty());
  for (const char* code : {"position_lost", "roll_high", "no_such_alarm"}) {
    step_.Take(Acknowledge(code, lost + seconds(5)));
    const GuidanceStep::Output& refused = step_.Step(lost + seconds(5));
    ASSERT_EQ(refused.replies.size(), 1u);
    EXPECT_EQ(refused.replies[0].outcome, dds::CommandOutcome::kRefused) << code;
  }
  step_.Take(Acknowledge("position_lost", lost - seconds(60)));
  EXPECT_THAT(std::string(step_.Step(lost + seconds(6)).replies.at(0).text.view()),
              HasSubstr("too late"));
  dds::Command for_others = Acknowledge("position_lost", lost + seconds(6));
  for_others.addressee = "total_station";
  step_.Take(for_others);
  EXPECT_TRUE(step_.Step(lost + seconds(7)).replies.empty());
}

TEST_F(Step, AShelvedAlarmSaysUntilWhenByWhomAndWhyAndGoesOnUnderneath) {
  DriveTo(2100.0);
  const Timestamp at = drive_.now();
  const auto ask = [&](std::string_view verb, std::string_view argument, Timestamp now) {
    dds::Command command = Acknowledge(argument, now);
    command.verb = verb;
    command.because = "the camera is being cleaned";
    step_.Take(command);
  };
  const auto told = [](const GuidanceStep::Output& said) {
    std::optional<dds::AlarmStatus> alarm;
    for (const dds::AlarmStatus& one : said.alarms) {
      if (one.code.view() == "position_lost") alarm = one;
    }
    return alarm;
  };
  // The second is judged after the first, within one step.
  ask("unshelve", "position_lost", at);
  ask("shelve", "position_lost 10", at);
  ask("unshelve", "position_lost", at);
  ask("shelve", "position_lost 20", at);
  ask("shelve", "position_lost 31", at);
  const GuidanceStep::Output& shelved = step_.Step(at + std::chrono::milliseconds(100));
  using enum dds::CommandOutcome;
  std::vector<dds::CommandOutcome> outcomes;
  for (const dds::CommandReply& reply : shelved.replies) outcomes.push_back(reply.outcome);
  EXPECT_EQ(outcomes, (std::vector{kRefused, kDone, kDone, kDone, kRefused}));
  ASSERT_TRUE(told(shelved)) << "at the change";
  const Timestamp until = at + std::chrono::milliseconds(100) + std::chrono::minutes(20);
  EXPECT_EQ(told(shelved)->shelved_until, until);
  EXPECT_EQ(told(shelved)->shelved_by.view(), "O. Perator");
  EXPECT_EQ(told(shelved)->shelved_because.view(), "the camera is being cleaned");
  std::vector<std::byte> bytes;
  EXPECT_EQ(dds::EncodeCdr(*told(shelved), &bytes), dds::BoundaryFault::kNone);
  // Nothing came for ten minutes.
  step_.Step(at + seconds(600));
  const GuidanceStep::Output& raised = step_.Step(at + seconds(603));
  EXPECT_EQ(told(raised)->phase, dds::AlarmPhase::kUnacknowledged);
  EXPECT_EQ(told(raised)->shelved_until, until);
  EXPECT_FALSE(raised.events.empty());
  step_.Step(until - std::chrono::milliseconds(1));
  const GuidanceStep::Output& over = step_.Step(until);
  ASSERT_TRUE(told(over)) << "at the change";
  EXPECT_EQ(told(over)->shelved_until, dds::kNever);
  EXPECT_TRUE(told(over)->shelved_by.empty() && told(over)->shelved_because.empty());
  EXPECT_EQ(told(over)->phase, dds::AlarmPhase::kUnacknowledged);
}

// A journal as the process writes it: files, then for each step its inputs, the step, what it said.
class JournalOfAShift : public Step {
 protected:
  JournalOfAShift() {
    Write(Bytes(writer_.Begin()));
    files_ = writer_.AddChannel(kFileTopic, "cdr", FileSchema());
    steps_ = writer_.AddChannel(kStepTopic, "cdr", StepSchema());
    AddFiles();
  }
  void AddFiles() {
    const GuidedMachine& machine = TheMachine();
    const Timestamp now = drive_.now();
    const auto add = [&](const char* role, const ReadFile& file) {
      const Bytes bytes = Encoded(FileRecord{role, file.path, file.content});
      writer_.AddMessage(files_, ++number_[files_], now, now, bytes);
    };
    add("machine", machine.machine_file);
    add("rig", machine.rig_file);
    add("axis", machine.axis_file);
  }
  template <class Message>
  void Add(const Message& message, Timestamp now) {
    const auto topic = dds::TopicOf<Message>();
    auto [channel, is_new] = channels_.try_emplace(std::string(topic.name), 0);
    if (is_new) {
      channel->second = writer_.AddChannel(
          topic.name,
          "cdr",
          {std::string(topic.type), "omgidl", std::string(dds::IdlTextOf(topic.type))});
    }
    std::vector<std::byte> bytes;
    ASSERT_EQ(dds::EncodeCdr(message, &bytes), dds::BoundaryFault::kNone);
    writer_.AddMessage(channel->second, ++number_[channel->second], now, now, bytes);
  }
  void AddStep(const std::vector<GuidanceMessage>& inputs, Timestamp now) {
    GuidanceStep& step = *recorded_;
    for (const GuidanceMessage& input : inputs) {
      std::visit([&](const auto& one) { Add(one, now); }, input);
      step.Take(input);
    }
    GuidanceStep::Output said = step.Step(now);
    const Bytes record = Encoded(StepRecord{now, said.guidance.sample_number});
    writer_.AddMessage(steps_, ++number_[steps_], now, now, record);
    said.guidance.published_at = now + seconds(1);  // sending takes its time, and is not compared
    said.guidance.points[0].deviation_right_m += tampered_m_;
    Add(said.guidance, now);
    Add(said.rear, now);
    Add(said.front, now);
    for (const dds::AlarmStatus& alarm : said.alarms) Add(alarm, now);
    Write(writer_.TakeChunk());
  }
  void DriveOn(int steps) {
    for (int i = 0; i < steps; ++i) {
      drive_.Measure(chainage_m_ += 1.5);
      AddStep(messages_.From(drive_.inputs()), drive_.now());
      AddStep({}, drive_.now() + std::chrono::milliseconds(200));
    }
  }
  std::string Finish() {
    Write(writer_.End());
    const std::string path = folder_.path() + "/journal.mcap";
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes_.data()),
               static_cast<std::streamsize>(bytes_.size()));
    return path;
  }
  void Write(const Bytes& bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }

  // Runs the command, and gives what it printed.
  std::string Replay(ExitCode expected, const std::string& machine = {}) {
    std::ostringstream out;
    std::ostringstream err;
    const ReplayRequest request{{Finish()}, machine};
    EXPECT_EQ(RunReplay(request, {out, err}), expected) << out.str() << err.str();
    return out.str() + err.str();
  }

  TempFolder folder_;
  McapWriter writer_{"test"};
  Bytes bytes_;
  std::uint16_t files_ = 0;
  std::uint16_t steps_ = 0;
  std::map<std::string, std::uint16_t> channels_;
  std::map<std::uint16_t, std::uint32_t> number_;
  std::optional<GuidanceStep> recorded_{std::in_place,
                                        TheMachine().machine,
                                        TheMachine().rig,
                                        TheMachine().axis,
                                        TheMachine().machine_sha256};
  double chainage_m_ = 2060.0;
  double tampered_m_ = 0.0;
};

TEST_F(JournalOfAShift, ReplaysBitForBit) {
  DriveOn(60);
  const std::string text = Replay(ExitCode::kDone);
  EXPECT_THAT(text, HasSubstr("1 starts of the guidance, 120 steps taken again"));
  EXPECT_THAT(text, HasSubstr("bit for bit"));
}

TEST_F(JournalOfAShift, ReplaysAShelfUntilItEndsByItself) {
  const auto shelve = [&](std::string_view verb, std::string_view argument) {
    drive_.Measure(chainage_m_ += 1.5);
    std::vector<GuidanceMessage> inputs = messages_.From(drive_.inputs());
    dds::Command command = Acknowledge(argument, drive_.now());
    command.verb = verb;
    command.because = "the cable is being changed";
    inputs.push_back(command);
    AddStep(inputs, drive_.now());
  };
  const Timestamp began = drive_.now();
  shelve("shelve", "tilt_late 1");
  shelve("shelve", "roll_high 30");
  DriveOn(5);
  shelve("unshelve", "roll_high");
  while (drive_.now() - began < std::chrono::minutes(2)) DriveOn(1);
  EXPECT_THAT(Replay(ExitCode::kDone), HasSubstr("bit for bit"));
}

TEST_F(JournalOfAShift, ReplaysARestartOfTheProcess) {
  DriveOn(5);
  AddFiles();
  recorded_.emplace(
      TheMachine().machine, TheMachine().rig, TheMachine().axis, TheMachine().machine_sha256);
  DriveOn(5);
  EXPECT_THAT(Replay(ExitCode::kDone), HasSubstr("2 starts of the guidance, 20 steps"));
}

TEST_F(JournalOfAShift, ANumberThatWasChangedAfterwardsIsFound) {
  DriveOn(3);
  tampered_m_ = 0.00005;
  DriveOn(1);
  const std::string text = Replay(ExitCode::kInternal);
  EXPECT_THAT(text, HasSubstr("2 differ"));
  EXPECT_THAT(text, HasSubstr("cutter_face now -0.0500 mm to the right"));
}

TEST_F(JournalOfAShift, AMachineMeasuredAgainShowsWhatTheOperatorWouldHaveSeen) {
  DriveOn(3);
  std::string yaml = TheMachine().machine_file.content;
  const std::string old = "cutter_face: {shield: front, xyz_mm: [800.0, 0.0, 0.0]";
  const auto at = yaml.find(old);
  ASSERT_NE(at, std::string::npos);
  yaml.replace(at, old.size(), "cutter_face: {shield: front, xyz_mm: [800.0, 0.0, 5.0]");
  const std::string path = folder_.path() + "/machine.yaml";
  std::ofstream(path) << yaml;
  const std::string text = Replay(ExitCode::kDone, path);
  EXPECT_THAT(text, HasSubstr(" differ; of the point that one steers by"));
  EXPECT_THAT(text, testing::ContainsRegex("and (4.99|5.00)[0-9]* mm up"));
}

TEST_F(JournalOfAShift, WithoutItsBeginningItSaysSo) {
  JournalReplay replay;
  DriveOn(2);
  const std::string path = Finish();
  std::uint64_t passed = 0;
  const auto content =
      ReadMcap(bytes_, [&](const McapChannel& channel, const McapMessage& message) {
        if (channel.topic == kFileTopic) return;
        ++passed;
        replay.Take(channel, message);
      });
  ASSERT_TRUE(content && passed > 100);
  EXPECT_EQ(replay.report().steps, 0u);
  EXPECT_GT(replay.report().skipped, 100u);
}

// After a disk error a chunk may stand in two files.
TEST_F(JournalOfAShift, WhatStandsTwiceIsTakenOnce) {
  DriveOn(2);
  const std::size_t from = bytes_.size();
  DriveOn(1);
  const Bytes again(bytes_.begin() + static_cast<std::ptrdiff_t>(from), bytes_.end());
  Write(again);
  DriveOn(2);
  const std::string text = Replay(ExitCode::kDone);
  EXPECT_THAT(text, HasSubstr("10 steps taken again"));
  EXPECT_THAT(text, HasSubstr("bit for bit"));
}

TEST_F(JournalOfAShift, InputsThatAreMissingAreCounted) {
  DriveOn(4);
  Finish();
  JournalReplay replay;
  int poses = 0;
  const auto content =
      ReadMcap(bytes_, [&](const McapChannel& channel, const McapMessage& message) {
        if (channel.topic == dds::kRelativePoseTopic.name && ++poses == 10) return;
        replay.Take(channel, message);
      });
  ASSERT_TRUE(content);
  EXPECT_EQ(replay.report().lost, 1u);
  EXPECT_GT(replay.report().different, 0u);
}

}  // namespace
}  // namespace tbm::test
