// The guidance process on DDS: what comes out for those who listen, and the journal it leaves.
#include "guidance/app/guidance_process.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <set>
#include <span>
#include <sstream>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/app/ask_command.h"
#include "guidance/app/replay_command.h"
#include "guidance/journal/mcap_reader.h"
#include "idl/cpp/codec.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "idl/cpp/topics.h"
#include "tests/guidance/drive_messages.h"
#include "tests/idl/dds_support.h"
#include "tests/support/temp_folder.h"

namespace tbm::test {
namespace {

using namespace std::chrono_literals;
using dds::test::Eventually;
using dds::test::OnLoopback;

constexpr int kDomain = 180;

// The camera box and the total station, as far as their topics go, now.
class Neighbours {
 public:
  explicit Neighbours(const GuidedMachine& machine)
      : drive_(machine, {}, "guidance process"), messages_(machine.machine) {
    drive_.Measure(2100.0);
  }

  // The round of readings, as if it had ended now.
  void Say() { SayAs({}); }
  // Of another machine, unless empty.
  void SayAs(std::string_view machine_id) {
    const Duration later = clock_.Now() - drive_.now();
    for (GuidanceMessage message : messages_.From(drive_.inputs())) {
      std::visit(
          [&](auto& one) {
            if constexpr (requires { one.sensed_at; }) one.sensed_at = one.sensed_at + later;
            if constexpr (requires { one.published_at; }) {
              one.published_at = one.published_at + later;
            }
            if (!machine_id.empty()) one.machine_id = machine_id;
            Write(one);
          },
          message);
      std::this_thread::sleep_for(1ms);
    }
  }

 private:
  void Write(const dds::RelativePose& m) { poses_.Write(m); }
  void Write(const dds::TiltReading& m) { tilts_.Write(m); }
  void Write(const dds::StationObservation& m) { observations_.Write(m); }
  void Write(const dds::StationSetUp& m) { set_ups_.Write(m); }
  void Write(const dds::Command&) {}

  SystemClock clock_;
  Drive drive_;
  DriveMessages messages_;
  dds::Participant participant_{OnLoopback(kDomain, "neighbours")};
  dds::Publisher<dds::RelativePose> poses_{participant_};
  dds::Publisher<dds::TiltReading> tilts_{participant_};
  dds::Publisher<dds::StationObservation> observations_{participant_};
  dds::Publisher<dds::StationSetUp> set_ups_{participant_};
};

// Whoever steers.
class Listener {
 public:
  dds::Guidance last() {
    const std::lock_guard lock(mutex_);
    return guidance_;
  }
  bool HasHeardOf(std::string_view stranger) {
    const std::lock_guard lock(mutex_);
    return std::any_of(events_.begin(), events_.end(), [&](const dds::Event& event) {
      return event.code.view() == "other_machine" &&
             event.text.view().find(stranger) != std::string_view::npos;
    });
  }
  std::vector<dds::AlarmStatus> alarms() {
    const std::lock_guard lock(mutex_);
    return alarms_;
  }
  std::string ShelvedBy(std::string_view code) {
    for (const dds::AlarmStatus& alarm : alarms()) {
      if (alarm.code.view() == code) return std::string(alarm.shelved_by);
    }
    return {};
  }

 private:
  std::mutex mutex_;
  dds::Guidance guidance_;
  std::vector<dds::AlarmStatus> alarms_;
  std::vector<dds::Event> events_;
  dds::Participant participant_{OnLoopback(kDomain, "listener")};
  dds::Subscriber<dds::Guidance> guidances_{
      participant_, [this](const dds::Guidance& m, const dds::SampleFacts&) {
        const std::lock_guard lock(mutex_);
        guidance_ = m;
      }};
  dds::Subscriber<dds::Event> told_{participant_,
                                    [this](const dds::Event& m, const dds::SampleFacts&) {
                                      const std::lock_guard lock(mutex_);
                                      events_.push_back(m);
                                    }};
  dds::Subscriber<dds::AlarmStatus> alarm_states_{
      participant_, [this](const dds::AlarmStatus& m, const dds::SampleFacts&) {
        const std::lock_guard lock(mutex_);
        std::erase_if(alarms_, [&](const auto& known) { return known.code == m.code; });
        alarms_.push_back(m);
      }};
};

// Whom the commands in the journal were addressed to.
std::set<std::string> AddresseesIn(const std::string& folder) {
  std::set<std::string> addressees;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string content((std::istreambuf_iterator<char>(file)), {});
    const auto read =
        ReadMcap(std::as_bytes(std::span(content)),
                 [&](const McapChannel& channel, const McapMessage& message) {
                   if (channel.topic != dds::kCommandTopic.name) return;
                   dds::Command command;
                   EXPECT_EQ(dds::DecodeCdr(message.data, &command), dds::BoundaryFault::kNone);
                   addressees.emplace(command.addressee);
                 });
    EXPECT_TRUE(read) << entry.path();
  }
  return addressees;
}

TEST(GuidanceProcess, GuidesFromItsNeighboursTopicsAndItsJournalReplaysBitForBit) {
  const GuidedMachine machine = ExampleMachine();
  TempFolder folder;
  GuidanceConfig config;
  config.journal_folder = folder / "journal";
  Listener listener;
  Neighbours neighbours(machine);
  std::uint64_t steps = 0;
  {
    const SystemClock clock;
    dds::Participant participant(OnLoopback(kDomain, "guidance"));
    GuidanceProcess process(config, machine, participant, clock);
    std::jthread thread([&](std::stop_token stop) { process.Run(stop); });

    // Alone it says so, five times a second, and raises its alarms.
    ASSERT_TRUE(Eventually([&] { return listener.last().sample_number > 5; }));
    EXPECT_EQ(listener.last().validity, dds::Validity::kInvalid);
    EXPECT_EQ(listener.last().reason.view(), "no_relative_pose");
    const auto phase_of = [&](std::string_view code) {
      for (const dds::AlarmStatus& alarm : listener.alarms()) {
        if (alarm.code.view() == code) return alarm.phase;
      }
      return dds::AlarmPhase::kNormal;
    };
    ASSERT_TRUE(
        Eventually([&] { return phase_of("position_lost") == dds::AlarmPhase::kUnacknowledged; }));

    AskRequest ask;
    ask.addressee = "guidance";
    ask.verb = "acknowledge";
    ask.argument = "position_lost";
    ask.by = "O. Perator";
    ask.network.domain_id = kDomain;
    std::ostringstream answer;
    EXPECT_EQ(RunAsk(ask, {answer, answer}), ExitCode::kDone) << answer.str();
    EXPECT_EQ(answer.str(), "guidance: done: acknowledged\n");
    EXPECT_EQ(RunAsk(ask, {answer, answer}), ExitCode::kBadInput);  // once is enough
    EXPECT_THAT(answer.str(), testing::HasSubstr("guidance: refused: there is nothing"));
    ask.verb = "shelve";
    ask.argument = "camera_late 60";
    EXPECT_EQ(RunAsk(ask, {answer, answer}), ExitCode::kBadInput) << "without a reason";
    ask.because = "the camera is being cleaned";
    EXPECT_EQ(RunAsk(ask, {answer, answer}), ExitCode::kDone) << answer.str();
    EXPECT_TRUE(Eventually([&] { return listener.ShelvedBy("camera_late") == "O. Perator"; }));
    ask.addressee = "nobody";
    ask.wait_s = 0.5;
    EXPECT_EQ(RunAsk(ask, {answer, answer}), ExitCode::kDds);
    EXPECT_THAT(answer.str(), testing::HasSubstr("nobody does not answer: does it run"));
    EXPECT_TRUE(
        Eventually([&] { return phase_of("position_lost") == dds::AlarmPhase::kAcknowledged; }));

    // Another machine's box on the same domain: ignored, and told once.
    neighbours.SayAs("TBM-2");
    ASSERT_TRUE(Eventually([&] { return listener.HasHeardOf("TBM-2"); }));

    // With them it knows where the machine is, and the alarm goes.
    ASSERT_TRUE(Eventually([&] {
      neighbours.Say();
      return listener.last().validity == dds::Validity::kValid &&
             phase_of("position_lost") == dds::AlarmPhase::kNormal;
    }));
    const dds::Guidance said = listener.last();
    EXPECT_NEAR(said.points[0].chainage_m, 2100.0, 0.05);
    EXPECT_LT(std::abs(said.points[0].deviation_right_m), 0.05);
    // A second camera box of the same name: neither is believed, and the numbers coast.
    {
      Neighbours rival(machine);
      ASSERT_TRUE(Eventually([&] {
        neighbours.Say();
        rival.Say();
        return listener.last().validity == dds::Validity::kDegraded;
      }));
      EXPECT_EQ(listener.last().reason.view(), "camera_coasting");
    }
    ASSERT_TRUE(Eventually(
        [&] {
          neighbours.Say();
          return listener.last().validity == dds::Validity::kValid;
        },
        15s));
    // When they fall silent the numbers coast and say so.
    ASSERT_TRUE(Eventually([&] { return listener.last().validity == dds::Validity::kDegraded; }));
    EXPECT_EQ(listener.last().reason.view(), "camera_coasting");
    steps = listener.last().sample_number;
  }
  EXPECT_THAT(AddresseesIn(config.journal_folder), testing::IsSupersetOf({"guidance", "nobody"}))
      << "also what others were asked to do";
  std::ostringstream out;
  std::ostringstream err;
  EXPECT_EQ(RunReplay({{config.journal_folder}, {}}, {out, err}), ExitCode::kDone)
      << out.str() << err.str();
  EXPECT_THAT(out.str(), testing::HasSubstr("bit for bit"));
  EXPECT_THAT(out.str(), testing::HasSubstr("1 starts of the guidance"));
  EXPECT_GT(steps, 20u);
}

}  // namespace
}  // namespace tbm::test
