// The processes as a user starts them: a simulated total station on TCP, total_station, and a
// reader on DDS. Everything on loopback, in a DDS domain of the test's own.

#include <map>
#include <mutex>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/config/machine_file.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "pose/base/clock.h"
#include "tests/idl/dds_support.h"
#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using dds::test::Eventually;
using test::Process;
using test::ReadText;
using test::WriteText;
using testing::HasSubstr;
using namespace std::chrono_literals;

constexpr int kDomain = 170;

class StationWatcher {
 public:
  StationWatcher()
      : participant_(Config()),
        observations_(participant_, Keeping(all_observations_)),
        set_ups_(participant_,
                 [this](const dds::StationSetUp& m, const dds::SampleFacts&) {
                   const std::lock_guard lock(mutex_);
                   if (m.role.view() == "in_use") in_use_ = m;
                 }),
        alarms_(participant_,
                [this](const dds::AlarmStatus& m, const dds::SampleFacts&) {
                  const std::lock_guard lock(mutex_);
                  phases_[std::string(m.code.view())] = m.phase;
                }),
        health_(participant_,
                [this](const dds::DeviceHealth& m, const dds::SampleFacts&) {
                  const std::lock_guard lock(mutex_);
                  state_ = m.state;
                }),
        replies_(participant_, Keeping(all_replies_)),
        commands_(participant_) {}

  int Good() const {
    const std::lock_guard lock(mutex_);
    return static_cast<int>(std::ranges::count_if(all_observations_, [](const auto& one) {
      return one.status == dds::ObservationStatus::kGood && one.kind == dds::ObservedKind::kPrism &&
             one.has_position();
    }));
  }
  dds::StationSetUp in_use() const {
    const std::lock_guard lock(mutex_);
    return in_use_;
  }
  bool Is(dds::SetUpState state) const { return in_use().state == state; }
  bool IsRaised(const std::string& code) const {
    const std::lock_guard lock(mutex_);
    const auto known = phases_.find(code);
    return known != phases_.end() && known->second == dds::AlarmPhase::kUnacknowledged;
  }
  bool IsStreaming() const {
    const std::lock_guard lock(mutex_);
    return state_ == dds::DeviceState::kStreaming;
  }
  bool HasReply(const std::string& request, dds::CommandOutcome outcome) const {
    const std::lock_guard lock(mutex_);
    return std::ranges::any_of(all_replies_, [&](const auto& reply) {
      return reply.request_id.view() == request && reply.outcome == outcome;
    });
  }
  void Send(const std::string& request, const std::string& verb, const std::string& argument) {
    const Timestamp now = SystemClock().Now();
    dds::Command command;
    command.machine_id = "TBM-1";
    command.request_id = std::string_view(request);
    command.addressee = "total_station";
    command.verb = std::string_view(verb);
    command.argument = std::string_view(argument);
    command.by = "test";
    command.issued_at = now;
    command.expires_at = now + 30s;
    EXPECT_EQ(commands_.Write(command), dds::WriteOutcome::kWritten);
  }

 private:
  static dds::ParticipantConfig Config() {
    dds::ParticipantConfig config;
    config.domain_id = kDomain;
    config.name = "station_watcher";
    return config;
  }
  template <class M>
  typename dds::Subscriber<M>::Handler Keeping(std::vector<M>& list) {
    return [this, &list](const M& message, const dds::SampleFacts&) {
      const std::lock_guard lock(mutex_);
      list.push_back(message);
    };
  }

  mutable std::mutex mutex_;  // guards what is kept
  std::vector<dds::StationObservation> all_observations_;
  std::vector<dds::CommandReply> all_replies_;
  std::map<std::string, dds::AlarmPhase> phases_;
  dds::StationSetUp in_use_;
  dds::DeviceState state_ = dds::DeviceState::kClosed;
  dds::Participant participant_;
  dds::Subscriber<dds::StationObservation> observations_;
  dds::Subscriber<dds::StationSetUp> set_ups_;
  dds::Subscriber<dds::AlarmStatus> alarms_;
  dds::Subscriber<dds::DeviceHealth> health_;
  dds::Subscriber<dds::CommandReply> replies_;
  dds::Publisher<dds::Command> commands_;
};

class StationOnDds : public testing::Test {
 protected:
  StationOnDds() {
    const std::string machine_file = TBM_SOURCE_DIR "/guidance/app/example/machine.yaml";
    WriteText(folder_ / "machine.yaml", ReadText(machine_file));
    // The shield looks north: forward is north, left is west.
    std::string prisms =
        "prism,x_m,y_m,z_m\n"
        "R1,997,1960,51.5\nR2,1003,1975,50.5\nR3,997.5,1985,52.5\nR4,1003,2022,51\n";
    const auto machine = LoadMachineFile(machine_file);
    EXPECT_TRUE(machine);
    for (const NamedPrism& named : machine->machine.prisms) {
      const Eigen::Vector3d& p = named.prism.p_in_rear_shield;
      prisms +=
          fmt::format("{},{},{},{}\n", named.name, 1000.0 - p.y(), 2035.0 + p.x(), 50.5 + p.z());
    }
    WriteText(folder_ / "prisms.csv", prisms);
  }

  std::unique_ptr<Process> StartSimulator(const std::vector<std::string>& more) {
    std::vector<std::string> command = {TBM_TOTAL_STATION_SIM,
                                        "--prisms",
                                        folder_ / "prisms.csv",
                                        "--station",
                                        "1000,2000,50",
                                        "--circle-zero-deg",
                                        "14.3",
                                        "--port",
                                        "0",
                                        "--distance-ms",
                                        "100",
                                        "--recognition-ms",
                                        "60",
                                        "--turn-deg-per-s",
                                        "400"};
    command.insert(command.end(), more.begin(), more.end());
    auto simulator = std::make_unique<Process>(command);
    EXPECT_TRUE(
        Eventually([&] { return simulator->Output().find("port=") != std::string::npos; }, 10s))
        << simulator->Output();
    const std::string output = simulator->Output();
    port_ = std::to_string(std::stoi(output.substr(output.find("port=") + 5)));
    return simulator;
  }
  std::unique_ptr<Process> StartStation() {
    WriteText(folder_ / "total_station.yaml",
              "machine: machine.yaml\nstate_file: station.state\n"
              "instrument: {driver: geocom_tcp, address: 127.0.0.1, silent_after_s: 2, tcp_port: " +
                  port_ +
                  "}\n"
                  "start: {xyz_m: [1000.1, 1999.9, 50.1], circle_zero_deg: 14.4}\n"
                  "rear_shield_start: {xyz_m: [1000.05, 2035, 50.5], heading_deg: 0}\n"
                  "references:\n"
                  "  - {name: R1, xyz_m: [997, 1960, 51.5], sigma_mm: 0.5}\n"
                  "  - {name: R2, xyz_m: [1003, 1975, 50.5], sigma_mm: 0.5}\n"
                  "  - {name: R3, xyz_m: [997.5, 1985, 52.5], sigma_mm: 0.5}\n"
                  "  - {name: R4, xyz_m: [1003, 2022, 51], sigma_mm: 0.5}\n"
                  "schedule: {cycle_period_s: 2, check_period_s: 6, doubt_period_s: 3, "
                  "retry_period_s: 2}\n"
                  "dds: {domain: " +
                  std::to_string(kDomain) + "}\n");
    return std::make_unique<Process>(
        std::vector<std::string>{TBM_TOTAL_STATION, folder_ / "total_station.yaml"});
  }

  test::TempFolder folder_;
  std::string port_;
};

TEST_F(StationOnDds, AKnockIsSuspectAndAlarmedWithinTheCheckPeriod) {
  StationWatcher watcher;
  const auto simulator = StartSimulator({"--knock", "5,2,0,10@22"});
  const auto began = std::chrono::steady_clock::now();
  auto station = StartStation();
  ASSERT_TRUE(Eventually([&] { return watcher.Is(dds::SetUpState::kGood); }, 25s))
      << station->Output();
  ASSERT_TRUE(Eventually([&] { return watcher.Good() >= 4; }, 20s)) << station->Output();
  EXPECT_TRUE(watcher.IsStreaming());
  const std::uint64_t number = watcher.in_use().set_up_number;

  // kill -9: the set-up is there again, and suspect until its references are found.
  station->Kill();
  station = StartStation();
  ASSERT_TRUE(
      Eventually([&] { return station->HasLine("source=total_station code=started"); }, 10s));
  ASSERT_TRUE(Eventually([&] { return watcher.Is(dds::SetUpState::kSuspect); }, 10s));
  EXPECT_EQ(watcher.in_use().set_up_number, number);

  ASSERT_TRUE(Eventually([&] { return watcher.IsRaised("station_moved"); }, 60s))
      << station->Output();
  EXPECT_GT(std::chrono::steady_clock::now(), began + 21s);
  ASSERT_TRUE(Eventually([&] { return watcher.Is(dds::SetUpState::kSuspect); }, 5s));
  EXPECT_EQ(watcher.in_use().reason.view(), "station_moved");
  watcher.Send("r1", "acknowledge", "station_moved");
  EXPECT_TRUE(Eventually([&] { return watcher.HasReply("r1", dds::CommandOutcome::kDone); }, 20s));
  watcher.Send("r2", "set_up", "");
  EXPECT_TRUE(Eventually([&] { return watcher.HasReply("r2", dds::CommandOutcome::kDone); }, 40s))
      << station->Output();
  EXPECT_TRUE(Eventually([&] { return watcher.Is(dds::SetUpState::kGood); }, 5s));
  EXPECT_EQ(watcher.in_use().set_up_number, number + 1);
  station->Signal(SIGTERM);
  EXPECT_EQ(station->Wait(), 0) << station->Output();
}

TEST_F(StationOnDds, RunsWithoutAnInstrumentAndRefusesABadFile) {
  port_ = "1";
  StationWatcher watcher;
  auto station = StartStation();
  ASSERT_TRUE(Eventually([&] { return watcher.IsRaised("station_silent"); }, 30s))
      << station->Output();
  EXPECT_EQ(watcher.in_use().state, dds::SetUpState::kNone);
  station->Signal(SIGTERM);
  EXPECT_EQ(station->Wait(), 0);

  Process check({TBM_TOTAL_STATION, folder_ / "total_station.yaml", "--check"});
  EXPECT_EQ(check.Wait(), 0);
  WriteText(folder_ / "bad.yaml", "machine: machine.yaml\n");
  Process bad({TBM_TOTAL_STATION, folder_ / "bad.yaml", "--check"});
  EXPECT_EQ(bad.Wait(), 2);
  EXPECT_TRUE(Eventually(
      [&] { return bad.Output().find("bad.yaml:1: state_file: missing") != std::string::npos; }));
  Process nothing({TBM_TOTAL_STATION});
  EXPECT_EQ(nothing.Wait(), 2);
}

}  // namespace
}  // namespace tbm
