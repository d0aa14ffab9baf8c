// All processes of tools/run as a user starts them: a simulated machine in its tunnel, camera box,
// total station, guidance, and somebody who listens. On loopback, in a DDS domain of the test's
// own.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/replay/csv.h"
#include "idl/cpp/subscriber.h"
#include "tests/idl/dds_support.h"
#include "tests/support/process.h"
#include "tests/system/example_config.h"

namespace tbm {
namespace {

using dds::test::Eventually;
using dds::test::OnLoopback;
using test::Process;
using ::testing::HasSubstr;
using namespace std::chrono_literals;

constexpr int kDomain = 182;

class Operator {
 public:
  dds::Guidance last() const {
    const std::lock_guard lock(mutex_);
    return said_.empty() ? dds::Guidance() : said_.back();
  }
  std::vector<dds::Guidance> said() const {
    const std::lock_guard lock(mutex_);
    return said_;
  }
  dds::AlarmPhase PhaseOf(std::string_view code) const {
    const std::lock_guard lock(mutex_);
    const auto found = alarms_.find(std::string(code));
    return found == alarms_.end() ? dds::AlarmPhase::kNormal : found->second;
  }
  bool Sees(dds::Validity validity, std::string_view reason) const {
    const dds::Guidance guidance = last();
    return guidance.validity == validity && guidance.reason.view() == reason;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<dds::Guidance> said_;
  std::map<std::string, dds::AlarmPhase> alarms_;
  dds::Participant participant_{OnLoopback(kDomain, "operator")};
  dds::Subscriber<dds::Guidance> guidance_{participant_,
                                           [this](const dds::Guidance& m, const dds::SampleFacts&) {
                                             const std::lock_guard lock(mutex_);
                                             said_.push_back(m);
                                           }};
  dds::Subscriber<dds::AlarmStatus> states_{
      participant_, [this](const dds::AlarmStatus& m, const dds::SampleFacts&) {
        const std::lock_guard lock(mutex_);
        alarms_[std::string(m.code.view())] = m.phase;
      }};
};

struct TrueShields {
  std::int64_t stamp_ns = 0;
  Rigid3 site_from_front;
};

std::vector<TrueShields> ReadTruth(const std::string& path) {
  std::vector<TrueShields> truth;
  std::istringstream lines(test::ReadText(path));
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream cells(line);
    std::array<double, 14> n{};
    TrueShields row;
    cells >> row.stamp_ns;
    for (double& number : n) cells >> number;
    if (!cells) break;  // the last line may be cut
    row.site_from_front = {Eigen::Quaterniond(n[7], n[8], n[9], n[10]), {n[11], n[12], n[13]}};
    truth.push_back(row);
  }
  return truth;
}

class WholeChain : public ::testing::Test {
 protected:
  WholeChain() {
    test::WriteExampleConfig(folder_, kDomain);
    const std::string guidance = TBM_SOURCE_DIR "/guidance/app/example/";
    for (const char* name : {"axis.xml", "references.csv"}) {
      test::WriteText(folder_ / name, test::ReadText(guidance + name));
    }
    // Periods of the tunnel made short, so that their consequences are seen within seconds.
    std::string machine = test::ReadText(guidance + "machine.yaml");
    machine = test::Replaced(machine,
                             "station: {period_s: 30, stale_after_s: 900}",
                             "station: {period_s: 8, stale_after_s: 30}");
    test::WriteText(folder_ / "machine.yaml", machine);
    test::WriteText(folder_ / "guidance.yaml",
                    InDomain(test::ReadText(guidance + "guidance.yaml")));
  }

  static std::string InDomain(const std::string& config) {
    return test::Replaced(config, "domain: 25", "domain: " + std::to_string(kDomain));
  }

  std::unique_ptr<Process> Start(const std::string& program, const std::string& config) {
    return std::make_unique<Process>(std::vector<std::string>{program, folder_ / config});
  }

  // The simulator on ports of its own choice, and the station's configuration for it.
  void StartWorld() {
    simulator_ = std::make_unique<Process>(std::vector<std::string>{TBM_SIM,
                                                                    "--machine",
                                                                    folder_ / "machine.yaml",
                                                                    "--station-port",
                                                                    "0",
                                                                    "--references",
                                                                    folder_ / "references.csv",
                                                                    "--station",
                                                                    "1017.832,5017.673,101.625",
                                                                    "--circle-zero-deg",
                                                                    "123.4",
                                                                    "--distance-ms",
                                                                    "200",
                                                                    "--recognition-ms",
                                                                    "100",
                                                                    "--turn-deg-per-s",
                                                                    "180",
                                                                    "--advance",
                                                                    "120",
                                                                    "--target-port",
                                                                    folder_ / "tilt_target",
                                                                    "--camera-port",
                                                                    folder_ / "tilt_camera",
                                                                    "--truth",
                                                                    folder_ / "truth.csv"});
    ASSERT_TRUE(Eventually([&] { return simulator_->HasLine("ready"); }, 10s))
        << simulator_->Output();
    const std::string said = simulator_->Output();
    const auto at = said.find("port=", said.find("total_station address="));
    ASSERT_NE(at, std::string::npos) << said;
    std::string station = test::ReadText(TBM_SOURCE_DIR "/devices/app/example/total_station.yaml");
    station = InDomain(station);
    station = test::Replaced(
        station, "tcp_port: 1212", "tcp_port: " + std::to_string(std::stoi(said.substr(at + 5))));
    station = test::Replaced(station, "cycle_period_s: 20", "cycle_period_s: 0");
    test::WriteText(folder_ / "total_station.yaml", station);
  }

  test::TempFolder folder_;
  std::unique_ptr<Process> simulator_;
};

// One long scene: starting it takes a set-up of the station, which is most of the time.
TEST_F(WholeChain, GuidesTruly_CoastsWhenTheStationIsGone_AndLeavesAJournalThatReplays) {
  Operator console;
  StartWorld();
  const auto box = Start(CAMERA_BOX, "camera_box.yaml");
  auto guidance = Start(GUIDANCE, "guidance.yaml");
  ASSERT_TRUE(Eventually([&] { return console.Sees(dds::Validity::kInvalid, "no_set_up"); }, 20s))
      << guidance->Output();
  auto station = Start(TOTAL_STATION, "total_station.yaml");
  ASSERT_TRUE(Eventually([&] { return console.Sees(dds::Validity::kValid, ""); }, 90s))
      << station->Output() << guidance->Output();
  const std::size_t from = console.said().size();
  ASSERT_TRUE(Eventually([&] { return console.said().size() > from + 150; }, 40s));

  // What it said against what was true.
  const std::vector<TrueShields> truth = ReadTruth(folder_ / "truth_shields.csv");
  ASSERT_GT(truth.size(), 100u);
  const Eigen::Vector3d cutter_in_front(0.8, 0.0, 0.0);
  int compared = 0;
  for (const dds::Guidance& said : console.said()) {
    const dds::GuidedPoint& cutter = said.points[0];
    if (cutter.validity != dds::Validity::kValid) continue;
    const auto nearest = std::min_element(truth.begin(), truth.end(), [&](auto& a, auto& b) {
      return std::abs(a.stamp_ns - said.valid_at.ns) < std::abs(b.stamp_ns - said.valid_at.ns);
    });
    if (std::abs(nearest->stamp_ns - said.valid_at.ns) > 60'000'000) continue;
    // The front shield advances by 2 mm a second; along it the stamps' difference stays below.
    const double error_m =
        (cutter.position_in_site_m - nearest->site_from_front * cutter_in_front).norm();
    EXPECT_LT(error_m, 4.0 * cutter.position_sigma_m + 0.0005);
    ++compared;
  }
  EXPECT_GE(compared, 100);
  EXPECT_LT(console.last().points[0].deviation_right_sigma_m, 0.006);

  // The station's process dies: numbers coast, say so, and end.
  station->Signal(SIGKILL);
  station->Wait();
  ASSERT_TRUE(
      Eventually([&] { return console.Sees(dds::Validity::kDegraded, "station_coasting"); }, 40s));
  ASSERT_TRUE(
      Eventually([&] { return console.Sees(dds::Validity::kInvalid, "station_stale"); }, 40s));
  EXPECT_TRUE(std::isnan(console.last().points[0].deviation_right_m));
  ASSERT_TRUE(Eventually(
      [&] { return console.PhaseOf("position_lost") == dds::AlarmPhase::kUnacknowledged; }, 10s));

  // It comes back with the set-up it had written down, checks its references, and all is well.
  station = Start(TOTAL_STATION, "total_station.yaml");
  ASSERT_TRUE(Eventually([&] { return console.Sees(dds::Validity::kValid, ""); }, 90s))
      << station->Output();
  EXPECT_EQ(console.last().set_up_number, 1u) << "the same set-up, not a new one";

  // The guidance dies in the middle of a step and is started again.
  guidance->Signal(SIGKILL);
  guidance->Wait();
  guidance = Start(GUIDANCE, "guidance.yaml");
  const std::size_t before = console.said().size();
  ASSERT_TRUE(Eventually(
      [&] {
        return console.said().size() > before + 20 && console.Sees(dds::Validity::kValid, "");
      },
      60s))
      << guidance->Output();
  guidance->Signal(SIGTERM);
  EXPECT_EQ(guidance->Wait(), 0) << guidance->Output();

  Process replay({TBM, "replay", folder_ / "journal"});
  EXPECT_EQ(replay.Wait(), 0) << replay.Output();
  EXPECT_THAT(replay.Output(), HasSubstr("2 starts of the guidance"));
  EXPECT_THAT(replay.Output(), HasSubstr("bit for bit"));

  station->Signal(SIGTERM);
  EXPECT_EQ(station->Wait(), 0);
  box->Signal(SIGTERM);
  EXPECT_EQ(box->Wait(), 0);
}

}  // namespace
}  // namespace tbm
