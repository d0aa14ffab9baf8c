// The process rail_line where something is wrong: files and folders before the run, clocks and
// instruments during it.
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/app/rail_line_process.h"
#include "guidance/app/rail_run.h"
#include "guidance/config/rail_line_file.h"
#include "tests/guidance/rail/rail_line_program.h"
#include "tests/support/process.h"

namespace tbm::test {
namespace {

using namespace std::chrono_literals;
using dds::test::Eventually;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

constexpr int kDomain = 200;

class RailLineFaults : public RailLineProgram {
 protected:
  // What the program says before it ends by itself, with 2.
  std::string Refusal(const std::string& more, const std::vector<std::string>& options = {}) {
    std::vector<std::string> command = {TBM_RAIL_LINE, Config(kDomain, 200.0, more)};
    command.insert(command.end(), options.begin(), options.end());
    Process process(command);
    EXPECT_EQ(process.Wait(), 2);
    Eventually([&] { return process.LineCount() > 0; });
    return process.Output();
  }
};

TEST_F(RailLineFaults, ABaseThatCannotBeReadIsNoticedBeforeTheRun) {
  for (const std::vector<std::string>& options : {std::vector<std::string>{}, {"--check"}}) {
    EXPECT_THAT(Refusal("settlement: {base: nowhere.csv}\n", options),
                HasSubstr("settlement.base: " + (folder_ / "nowhere.csv: cannot be opened")));
    WriteText(
        folder_ / "short.csv",
        "stamp_ns,distance_m,x_m,y_m,z_m,qw,qx,qy,qz,sigma_x_mm,sigma_y_mm,sigma_z_mm,status\n"
        "1,0,0,0,0,1,0,0,0,1,1,1,fixed\n2,0,0,0,0,1,0,0,0,1,1,1,fixed\n");
    EXPECT_THAT(Refusal("settlement: {base: short.csv}\n", options),
                HasSubstr("no part of it is as long as a step"));
  }
  EXPECT_FALSE(fs::exists(folder_ / "runs"));
}

TEST_F(RailLineFaults, ACalibrationOfTheFutureIsRefused) {
  EXPECT_THAT(Refusal("calibration: {date: 2190-01-01}\n", {"--check"}),
              HasSubstr("rail_line.yaml: calibration.date: lies in the future"));
}

TEST_F(RailLineFaults, OnlyOneProcessWorksInItsFolders) {
  Listener listener(kDomain);
  Process first({TBM_RAIL_LINE, Config(kDomain, 4.0, "publish: {hold_s: 0}\n")});
  ASSERT_TRUE(Eventually([&] { return listener.HasStatus(dds::RailPointStatus::kFixed); }, 20s));
  const std::string unborn = folder_ / "lines/rail_20200101_000000.unfinished";
  fs::create_directories(unborn);
  EXPECT_THAT(Refusal(""), HasSubstr("runs: another rail_line is at work in this folder"));
  EXPECT_TRUE(fs::exists(unborn)) << "it may be what the other is making";
  first.Signal(SIGTERM);
  EXPECT_EQ(first.Wait(), 0) << first.Output();
}

// Names that need quotes, or are no text at all, pass through record, line and report.
TEST_F(RailLineFaults, NamesOfTargetsMayBeOddEnough) {
  GeneratedRun run = *generated_;
  run.recording.targets[0].name = "north, \"upper\"";
  run.recording.targets[1].name = "\xfc\xff";
  // Not taken, and so named in the report.
  for (TargetImage& image : run.recording.images) {
    for (TargetPixel& pixel : image.pixels) {
      if (pixel.target < 2) pixel.pixel_px.x() += 300.0;
    }
  }
  fs::remove_all(folder_ / "played");
  WriteRun(folder_ / "played", run);
  Process process({TBM_RAIL_LINE, Config(kDomain, 200.0, "publish: {hold_s: 0}\n")});
  ASSERT_EQ(process.Wait(), 0) << process.Output();
  EXPECT_THAT(ReadText(OnlyOne("lines") + "/line.json"), HasSubstr("north, \\\"upper\\\""));
  EXPECT_EQ(ReadText(OnlyOne("runs") + "/centres.csv"), ReadText(folder_ / "played/centres.csv"));
}

// A survey that was moved as a whole: no rail has moved, and nobody says so.
TEST_F(RailLineFaults, AShiftOfTheWholeLineIsNoSettlement) {
  WriteRun(folder_ / "earlier", GenerateRail({.seed = 12}));
  WriteText(
      folder_ / "base.csv",
      Raised(LineOf(folder_ / "earlier", folder_ / "earlier.csv"), [](double) { return 0.004; }));
  Listener listener(kDomain);
  Process process({TBM_RAIL_LINE,
                   Config(kDomain,
                          200.0,
                          "settlement: {base: base.csv, alert_mm: [1, 3, 30]}\n"
                          "publish: {hold_s: 1}\n")});
  ASSERT_EQ(process.Wait(), 0) << process.Output();
  ASSERT_TRUE(Eventually([&] { return listener.HasRaised("datum_shift"); }));
  EXPECT_FALSE(listener.HasRaised("settlement_found"));
  EXPECT_THAT(listener.events["compared"],
              HasSubstr("the datum may have moved: the whole line is "));
  EXPECT_THAT(listener.events["datum_shift"], HasSubstr("size 2; "));
  ASSERT_FALSE(listener.settlements.empty());
  EXPECT_EQ(listener.settlements.begin()->second.highest_alert, 0);
}

TEST_F(RailLineFaults, WhyLinesCannotBeComparedIsSaid) {
  GeneratedRun aside = GenerateRail({.seed = 12});
  for (SurveyedTarget& target : aside.recording.targets) target.in_world_m.y() += 40.0;
  aside.setup.start.position_world_m.y() += 40.0;
  WriteRun(folder_ / "aside", aside);
  LineOf(folder_ / "aside", folder_ / "base.csv");
  Listener listener(kDomain);
  Process process({TBM_RAIL_LINE,
                   Config(kDomain, 200.0, "settlement: {base: base.csv}\npublish: {hold_s: 1}\n")});
  ASSERT_EQ(process.Wait(), 0) << process.Output();
  EXPECT_THAT(listener.events["not_compared"],
              HasSubstr("no part of the line is within half a metre, in plan, of "));
}

// As a SystemClock; somebody may set it.
class SetClock final : public Clock {
 public:
  Timestamp Now() const override { return system_.Now() + Duration(set_ns_.load()); }
  std::chrono::steady_clock::time_point Steady() const override { return system_.Steady(); }
  void Set(Duration span) { set_ns_ = span.count(); }

 private:
  const SystemClock system_;
  std::atomic<std::int64_t> set_ns_ = 0;
};

// The process itself with a unit that rests on its port.
class RailLineOnAUnit : public RailLineProgram {
 protected:
  void Begin(const StimEmulatorSettings& settings, const std::string& more = "") {
    GeneratedRun at_rest = *generated_;
    at_rest.setup.start.at_rest_s = 3.0;
    const Eigen::Vector3d x = generated_->truth.front().world_from_imu * Eigen::Vector3d::UnitX();
    at_rest.setup.start.heading_rad = std::atan2(x.y(), x.x());
    at_rest.setup.start.sigma_heading_rad = DegToRad(1.0);
    std::string yaml = RailYaml(at_rest.setup);
    yaml.replace(yaml.find("rate_hz: 200"), 12, "rate_hz: 250");
    WriteText(folder_ / "trolley/rail.yaml", yaml);
    WriteText(folder_ / "rail_line.yaml",
              fmt::format("machine_id: trolley-1\nruns: runs\nlines: lines\n"
                          "devices:\n"
                          "  setup: trolley\n"
                          "  imu: {{model: stim300, port: {}, baud: 921600, sample_rate_hz: 250}}\n"
                          "{}dds: {{domain: {}}}\npublish: {{hold_s: 0.2}}\n",
                          folder_ / "imu",
                          more,
                          kDomain));
    unit_.emplace(SerialSettings{folder_ / "imu", 921600, Parity::kNone, 1},
                  settings,
                  AtRest(*generated_),
                  system_);
    ASSERT_TRUE(unit_->IsUp());
    const auto config = LoadRailLineConfig(folder_ / "rail_line.yaml");
    const auto run = ReadRailSetup(folder_ / "trolley");
    ASSERT_TRUE(config && run);
    config_ = *config;
    run_ = *run;
    folders_.emplace(config_.runs_folder, config_.lines_folder);
    ASSERT_EQ(folders_->Take(), std::nullopt);
    texts_.rail_yaml = yaml;
    process_.emplace(config_, run_, texts_, *folders_, participant_, clock_);
    thread_ = std::jthread([this](const std::stop_token& stop) { code_ = process_->Run(stop); });
  }
  ExitCode End() {
    thread_.request_stop();
    thread_.join();
    return code_;
  }
  RailLineOnAUnit() { fs::create_directories(folder_ / "trolley"); }
  ~RailLineOnAUnit() override {
    if (thread_.joinable()) End();
  }

  const SystemClock system_;
  SetClock clock_;
  std::optional<StimEmulator> unit_;
  RailLineConfig config_;
  RailRun run_;
  RailLineProcess::Texts texts_;
  std::optional<RunFolders> folders_;
  dds::Participant participant_{OnLoopback(kDomain, "rail_line")};
  std::optional<RailLineProcess> process_;
  ExitCode code_ = ExitCode::kDone;
  std::jthread thread_;
};

StimEmulatorSettings At250Hz() {
  StimEmulatorSettings settings;
  settings.scales.sample_rate_hz = 250.0;
  return settings;
}

// Seen by reading: samples after a step back lay between those before it, and the place stood still
// as FIXED.
TEST_F(RailLineOnAUnit, AClockThatIsSetMovesNoSampleAndIsTold) {
  Listener listener(kDomain);
  Begin(At250Hz());
  const auto newest = [&] {
    Timestamp at;
    listener.Has([&](const Listener& heard) {
      if (!heard.states.empty()) at = heard.states.back().valid_at;
      return true;
    });
    return at;
  };
  ASSERT_TRUE(Eventually([&] { return listener.HasStatus(dds::RailPointStatus::kFixed); }, 20s));
  const Timestamp before = newest();
  const auto begun_at = std::chrono::steady_clock::now();
  clock_.Set(-2s);
  std::this_thread::sleep_for(1s);
  // The place goes on as fast as time does.
  const auto is_in_time = [&] {
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begun_at;
    return std::abs(SecondsBetween(before, newest()) - passed.count()) < 0.3;
  };
  EXPECT_TRUE(Eventually(is_in_time, 20s));
  EXPECT_TRUE(Eventually([&] { return listener.HasRaised("clock_set"); }, 5s));
  EXPECT_EQ(End(), ExitCode::kDone);
  EXPECT_THAT(listener.events["clock_set"], HasSubstr("by -2.00 s"));
  const auto run = ReadRailRun(OnlyOne("runs"));
  ASSERT_TRUE(run) << run.error().front().Text();
  EXPECT_FALSE(listener.HasRaised("measurements_lost"));
}

TEST_F(RailLineOnAUnit, OneWithGyrosAloneIsAFaultWithItsReason) {
  Listener listener(kDomain);
  StimEmulatorSettings settings = At250Hz();
  settings.id = 0x90;  // rates, and nothing else
  Begin(settings);
  std::string detail;
  EXPECT_TRUE(Eventually(
      [&] {
        return listener.Has([&](const Listener& heard) {
          const auto imu = heard.health.find("imu");
          if (imu != heard.health.end()) detail = imu->second.detail.view();
          return imu != heard.health.end() && imu->second.state == dds::DeviceState::kFault &&
                 imu->second.samples_good == 0 && imu->second.errors > 100;
        });
      },
      20s));
  EXPECT_THAT(detail, HasSubstr("no specific force"));
  EXPECT_TRUE(Eventually([&] { return listener.HasRaised("imu_silent"); }, 5s));
  EXPECT_EQ(End(), ExitCode::kBadInput);
}

TEST_F(RailLineOnAUnit, AnInclinometerThatIsNotThereIsTold) {
  Listener listener(kDomain);
  Begin(At250Hz(),
        fmt::format("  inclinometer: {{driver: rion68, port: {}}}\n", folder_ / "nothing"));
  EXPECT_TRUE(Eventually([&] { return listener.HasRaised("inclinometer_silent"); }, 20s));
  EXPECT_FALSE(listener.HasRaised("targets_silent")) << "nobody expects any";
  EXPECT_EQ(End(), ExitCode::kDone);
  EXPECT_THAT(listener.events["inclinometer_silent"], HasSubstr("port_missing"));
}

}  // namespace
}  // namespace tbm::test
