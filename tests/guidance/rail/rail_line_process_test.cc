// The program rail_line on a recorded run that is played as its instruments: what is said on DDS
// while it runs, the line that it leaves, and what it leaves when it is killed.
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/app/line_file.h"
#include "guidance/app/rail_run.h"
#include "guidance/config/sha256.h"
#include "tests/guidance/rail/rail_line_program.h"
#include "tests/support/process.h"

namespace tbm::test {
namespace {

using namespace std::chrono_literals;
using dds::test::Eventually;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

constexpr int kDomain = 196;

TEST_F(RailLineProgram, FollowsARunAndLeavesTheLineThatTbmLineMakes) {
  // An earlier line, which lay up to 4 mm higher, over a part of its length.
  const std::string before = LineOf(folder_ / "played", folder_ / "now.csv");
  WriteRun(folder_ / "earlier", GenerateRail({.seed = 12}));
  const std::string earlier = LineOf(folder_ / "earlier", folder_ / "earlier.csv");
  const double length_m = ReadLineFile(folder_ / "earlier.csv")->points.back().distance_m;
  WriteText(folder_ / "base.csv", Raised(earlier, [&](double m) {
              return 0.004 * std::exp(-0.5 * std::pow((m / length_m - 0.5) / 0.08, 2));
            }));

  Listener listener(kDomain);
  Process process({TBM_RAIL_LINE,
                   Config(kDomain,
                          6.0,
                          "settlement: {base: base.csv, alert_mm: [1, 3, 30]}\n"
                          "calibration: {date: 2020-01-31, due_after_days: 100}\n"
                          "publish: {step_m: 0.002, hold_s: 1.5}\n")});
  EXPECT_TRUE(Eventually([&] { return listener.HasReason("waiting_for_rest"); }, 15s));
  EXPECT_TRUE(Eventually([&] { return listener.HasStatus(dds::RailPointStatus::kFixed); }, 15s));
  EXPECT_TRUE(Eventually(
      [&] { return listener.Has([](const Listener& heard) { return !heard.pieces.empty(); }); },
      30s));
  Listener late(kDomain);  // who comes when all is done still gets the line
  EXPECT_TRUE(Eventually(
      [&] { return late.Has([](const Listener& heard) { return !heard.pieces.empty(); }); }, 10s));
  ASSERT_EQ(process.Wait(), 0) << process.Output();

  // The line is that of `tbm line`, of the run that was played and of the one that was kept.
  const std::string line = OnlyOne("lines");
  EXPECT_EQ(ReadText(line + "/line.csv"), before);
  const std::string kept = LineOf(OnlyOne("runs"), folder_ / "again.csv");
  EXPECT_EQ(ReadText(line + "/line.csv"), kept);
  EXPECT_EQ(ReadText(line + "/line.json"), ReadText(folder_ / "again.json"));

  // What stood on DDS is what stands in the file.
  const auto points = ReadLineFile(line + "/line.csv");
  ASSERT_TRUE(points);
  ASSERT_EQ(late.pieces.size(), static_cast<std::size_t>(late.pieces.begin()->second.pieces));
  ASSERT_GT(late.pieces.size(), 1u);
  int told = 0;
  for (const auto& [number, piece] : late.pieces) {
    EXPECT_EQ(piece.points_before, told);
    EXPECT_EQ(piece.line_sha256.view(), Sha256(before));
    told += static_cast<int>(piece.points.size());
  }
  EXPECT_EQ(told, late.pieces.begin()->second.points_in_all);
  const auto& last = late.pieces.rbegin()->second.points;
  EXPECT_EQ(last[last.size() - 1].position_world_m, points->points.back().position_world_m);

  // Live, within what it said of itself.
  double squares = 0.0;
  double count = 0.0;
  for (const dds::TrolleyState& state : listener.states) {
    if (state.status == dds::RailPointStatus::kNone) continue;
    const auto truth = std::lower_bound(generated_->truth.begin(),
                                        generated_->truth.end(),
                                        state.valid_at,
                                        [](const auto& row, Timestamp at) { return row.at < at; });
    ASSERT_NE(truth, generated_->truth.end());
    ASSERT_EQ(truth->at, state.valid_at);
    const Eigen::Vector3d off = state.position_world_m - truth->position_world_m;
    squares += off.cwiseQuotient(state.sigma_position_m).squaredNorm();
    count += 3.0;
  }
  EXPECT_GT(count, 30.0);
  EXPECT_LT(std::sqrt(squares / count), 3.0);
  EXPECT_EQ(listener.states.back().reason, "ended");

  // 4 mm: found where they are, and of the second size.
  ASSERT_FALSE(listener.settlements.empty());
  const dds::SettlementPiece& piece = listener.settlements.begin()->second;
  EXPECT_EQ(piece.highest_alert, 2);
  EXPECT_EQ(piece.base_sha256.view(), Sha256(ReadText(folder_ / "base.csv")));
  for (const dds::SettlementPoint& point : piece.points) {
    if (point.alert > 0) {
      EXPECT_NEAR(point.distance_m / length_m, 0.5, 0.2);
    }
  }
  EXPECT_THAT(std::string(listener.raised["settlement_found"].cause), HasSubstr("settlement "));
  EXPECT_FALSE(listener.raised.contains("datum_shift"));
  EXPECT_THAT(listener.events["compared"], HasSubstr(" places compared; settlement "));
  EXPECT_TRUE(listener.raised.contains("calibration_due"));
  EXPECT_FALSE(listener.raised.contains("imu_silent"));
  EXPECT_FALSE(listener.raised.contains("measurements_lost"));
  EXPECT_EQ(listener.calibrations.at("imu_mounting").state, dds::CalibrationState::kDue);
  EXPECT_EQ(listener.health.at("imu").samples_good, generated_->recording.imu.size());
  EXPECT_TRUE(listener.health.contains("targets") && listener.health.contains("inclinometer"));
}

TEST_F(RailLineProgram, EndsARunWhenAskedAndMakesTheLineOfWhatWasMeasured) {
  Listener listener(kDomain + 1);
  Process process({TBM_RAIL_LINE, Config(kDomain + 1, 4.0)});
  ASSERT_TRUE(Eventually([&] { return listener.HasStatus(dds::RailPointStatus::kFixed); }, 15s));
  ASSERT_TRUE(Eventually([&] { return listener.IsHeardByIt(); }, 5s));
  listener.Ask("fly");
  listener.Ask("end_run");
  ASSERT_EQ(process.Wait(), 0) << process.Output();
  EXPECT_TRUE(Eventually(
      [&] { return listener.Has([](const Listener& heard) { return heard.replies.size() == 2; }); },
      2s));
  EXPECT_EQ(listener.replies[0].outcome, dds::CommandOutcome::kRefused);
  EXPECT_EQ(listener.replies[1].outcome, dds::CommandOutcome::kAccepted);
  const auto points = ReadLineFile(OnlyOne("lines") + "/line.csv");
  ASSERT_TRUE(points);
  EXPECT_LT(points->points.size(), generated_->recording.imu.size());
  EXPECT_EQ(LineOf(OnlyOne("runs"), folder_ / "again.csv"),
            ReadText(OnlyOne("lines") + "/line.csv"));
}

TEST_F(RailLineProgram, SigtermEndsTheRunInOrder) {
  Listener listener(kDomain + 1);
  Process process({TBM_RAIL_LINE, Config(kDomain + 1, 4.0, "publish: {hold_s: 0}\n")});
  ASSERT_TRUE(Eventually([&] { return listener.HasStatus(dds::RailPointStatus::kFixed); }, 15s));
  process.Signal(SIGTERM);
  EXPECT_EQ(process.Wait(), 0) << process.Output();
  EXPECT_TRUE(fs::exists(OnlyOne("lines") + "/line.json"));
}

TEST_F(RailLineProgram, SigtermAlsoEndsTheHoldOfALine) {
  Listener listener(kDomain + 1);
  Process process({TBM_RAIL_LINE, Config(kDomain + 1, 200.0, "publish: {hold_s: 60}\n")});
  ASSERT_TRUE(Eventually([&] { return listener.HasSaid("line_made"); }, 30s));
  std::this_thread::sleep_for(1200ms);
  process.Signal(SIGTERM);
  const auto asked_at = std::chrono::steady_clock::now();
  EXPECT_EQ(process.Wait(), 0) << process.Output();
  EXPECT_LT(std::chrono::steady_clock::now() - asked_at, 20s);
}

TEST_F(RailLineProgram, KilledItLeavesNothingHalfWrittenAndTheNextOneRuns) {
  const std::string config = Config(kDomain + 1, 8.0, "publish: {hold_s: 0}\n");
  std::string unfinished;
  {
    Listener listener(kDomain + 1);
    Process process({TBM_RAIL_LINE, config});
    ASSERT_TRUE(Eventually([&] { return listener.HasStatus(dds::RailPointStatus::kFixed); }, 15s));
    process.Kill();
    unfinished = OnlyOne("runs");
    EXPECT_THAT(unfinished, testing::EndsWith(".unfinished"));
    EXPECT_TRUE(All("lines").empty());
  }
  // A line that was being made when the power went.
  fs::create_directories(folder_ / "lines/rail_20200101_000000.unfinished");
  WriteText(folder_ / "lines/rail_20200101_000000.unfinished/line.csv", "stamp_ns\n1");
  Process again({TBM_RAIL_LINE, config});
  ASSERT_EQ(again.Wait(), 0) << again.Output();
  EXPECT_THAT(again.Output(), HasSubstr("unfinished_run"));
  EXPECT_EQ(ReadText(OnlyOne("lines") + "/line.csv"),
            LineOf(folder_ / "played", folder_ / "line.csv"));
  EXPECT_EQ(All("runs").size(), 2u);  // what the dead one had measured is kept
  // And good for a line.
  EXPECT_TRUE(ReadRailRun(unfinished));
}

TEST_F(RailLineProgram, WithoutTheUnitThereIsNoPlaceAndAnAlarm) {
  GeneratedRun run = *generated_;
  const Timestamp begin = run.recording.imu.front().ends_at;
  std::erase_if(run.recording.imu, [&](const ImuSample& sample) {
    const double at_s = SecondsBetween(begin, sample.ends_at);
    return at_s > 11.0 && at_s < 16.0;
  });
  fs::remove_all(folder_ / "played");
  WriteRun(folder_ / "played", run);
  Listener listener(kDomain + 1);
  Process process({TBM_RAIL_LINE, Config(kDomain + 1, 4.0, "imu_silent_after_ms: 300\n")});
  EXPECT_TRUE(Eventually([&] { return listener.HasReason("imu_silent"); }, 15s));
  EXPECT_TRUE(Eventually(
      [&] {
        return listener.Has(
            [](const Listener& heard) { return heard.raised.contains("imu_silent"); });
      },
      5s));
  // It comes back, and so does the place; the line tells of the gap.
  ASSERT_EQ(process.Wait(), 0) << process.Output();
  EXPECT_THAT(ReadText(OnlyOne("lines") + "/line.csv"), HasSubstr(",gap\n"));
}

TEST_F(RailLineProgram, AStartThatIsNoneGivesNoLineAndSaysWhy) {
  GeneratedRun run = *generated_;
  run.setup.start.at_rest_s = 14.0;
  run.recording.tilts.clear();  // which is a warning, and no reason
  fs::remove_all(folder_ / "played");
  WriteRun(folder_ / "played", run);
  Listener listener(kDomain + 1);
  Process process({TBM_RAIL_LINE, Config(kDomain + 1, 20.0, "publish: {hold_s: 1}\n")});
  EXPECT_TRUE(Eventually(
      [&] {
        return listener.Has([](const Listener& heard) {
          return heard.raised.contains("start_failed") && heard.raised.contains("line_not_written");
        });
      },
      15s));
  EXPECT_EQ(process.Wait(), 2);
  EXPECT_TRUE(listener.HasReason("start_failed"));
  // Each says why, and not first what is odd beside it.
  EXPECT_THAT(std::string(listener.raised["start_failed"].cause), HasSubstr("the trolley moves 1"));
  EXPECT_THAT(std::string(listener.raised["line_not_written"].cause),
              HasSubstr("the trolley moves 1"));
  EXPECT_THAT(listener.events["start_failed"], HasSubstr("start.at_rest_s: 14"));
  EXPECT_THAT(listener.events["line_not_written"], HasSubstr("start.at_rest_s: 14"));
  EXPECT_THAT(listener.events["line_warning"], HasSubstr("tilt.csv: is not there"));
  EXPECT_THAT(process.Output(), HasSubstr("start.at_rest_s: 14"));
  EXPECT_TRUE(All("lines").empty());
}

// The instruments themselves: a unit on its port, and a camera box that finds the targets.
TEST_F(RailLineProgram, FollowsARealUnitAndTheTargetsOfACameraBox) {
  const int domain = kDomain + 2;
  fs::create_directories(folder_ / "trolley");
  GeneratedRun at_rest = *generated_;
  at_rest.setup.start.at_rest_s = 3.0;
  std::string yaml = RailYaml(at_rest.setup);
  yaml.replace(yaml.find("rate_hz: 200"), 12, "rate_hz: 250");
  WriteText(folder_ / "trolley/rail.yaml", yaml);
  WriteText(folder_ / "trolley/targets.csv", TargetsCsv(at_rest.recording.targets));
  WriteText(folder_ / "rail_line.yaml",
            fmt::format("machine_id: trolley-1\nruns: runs\nlines: lines\n"
                        "devices:\n"
                        "  setup: trolley\n"
                        "  imu: {{model: stim300, port: {}, baud: 921600, sample_rate_hz: 250}}\n"
                        "  target_pixels: frame_features\n"
                        "dds: {{domain: {}}}\npublish: {{hold_s: 0.5}}\n",
                        folder_ / "imu",
                        domain));

  const SystemClock clock;
  StimEmulatorSettings settings;
  settings.scales.sample_rate_hz = 250.0;
  StimEmulator unit(
      {folder_ / "imu", 921600, Parity::kNone, 1}, settings, AtRest(*generated_), clock);
  ASSERT_TRUE(unit.IsUp());

  Listener listener(domain);
  dds::Participant box(OnLoopback(domain, "camera box"));
  dds::Publisher<dds::FrameFeatures> features(box);
  Process process({TBM_RAIL_LINE, folder_ / "rail_line.yaml"});
  const TargetImage& image = generated_->recording.images.front();
  std::uint64_t frame = 0;
  const auto seen_when = [&](const std::function<bool()>& is_so) {
    const auto until = std::chrono::steady_clock::now() + 30s;
    while (!is_so() && std::chrono::steady_clock::now() < until) {
      dds::FrameFeatures message;
      message.machine_id = "trolley-1";
      message.sensed_at = clock.Now();
      message.published_at = clock.Now();
      message.frame_number = ++frame;
      message.exposure_s = 1e-3;
      message.background_dn = 10.0;
      message.noise_dn = 1.0;
      for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        if (image.pixels[i].target >= 32) continue;  // the topic has no name for it
        dds::Spot spot;
        spot.centre.pixel_px = image.pixels[i].pixel_px;
        spot.centre.sigma_px = 0.1;
        spot.led_index = image.pixels[i].target;
        message.spots.push_back(spot);
      }
      features.Write(message);
      std::this_thread::sleep_for(100ms);
    }
    return is_so();
  };
  EXPECT_TRUE(seen_when([&] {
    return listener.Has([](const Listener& heard) {
      return !heard.states.empty() && heard.states.back().status == dds::RailPointStatus::kFixed &&
             heard.states.back().target_age_s < 1.5;
    });
  })) << process.Output();
  const Eigen::Vector3d off =
      listener.states.back().position_world_m - generated_->truth.front().position_world_m;
  EXPECT_LT(off.norm(), 1e-3);
  EXPECT_TRUE(seen_when([&] {
    return listener.Has([](const Listener& heard) {
      return heard.health.contains("imu") &&
             heard.health.at("imu").state == dds::DeviceState::kStreaming;
    });
  }));

  // The box dies: the place still comes, and somebody is told.
  EXPECT_TRUE(Eventually([&] { return listener.HasRaised("targets_silent"); }, 20s));
  EXPECT_FALSE(listener.HasRaised("imu_silent"));
  EXPECT_TRUE(listener.Has([](const Listener& heard) {
    return heard.health.at("targets").state == dds::DeviceState::kSilent;
  }));

  unit.Unplug();
  EXPECT_TRUE(Eventually(
      [&] {
        return listener.Has([](const Listener& heard) {
          return heard.raised.contains("imu_silent") &&
                 heard.states.back().reason.view() == "imu_silent" &&
                 heard.health.at("imu").state == dds::DeviceState::kClosed;
        });
      },
      10s));
  process.Signal(SIGTERM);
  EXPECT_EQ(process.Wait(), 0) << process.Output();
  EXPECT_EQ(LineOf(OnlyOne("runs"), folder_ / "again.csv"),
            ReadText(OnlyOne("lines") + "/line.csv"));
  EXPECT_THAT(ReadText(OnlyOne("runs") + "/centres.csv"),
              testing::MatchesRegex("stamp_ns,target,u_px,v_px,sigma_px\n([^\n]+,0.1\n)+"));
}

}  // namespace
}  // namespace tbm::test
