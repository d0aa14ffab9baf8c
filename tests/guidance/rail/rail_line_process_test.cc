// The program rail_line on a recorded run that is played as its instruments: what is said on DDS
// while it runs, the line that it leaves, and what it leaves when it is killed.
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <map>
#include <mutex>
#include <random>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/imu/stim_emulator.h"
#include "guidance/app/line_command.h"
#include "guidance/app/line_file.h"
#include "guidance/app/rail_recorder.h"
#include "guidance/app/rail_run.h"
#include "guidance/config/sha256.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/rail_messages.h"
#include "idl/cpp/subscriber.h"
#include "pose/base/angle.h"
#include "pose/base/clock.h"
#include "tests/guidance/rail/rail_generator.h"
#include "tests/idl/dds_support.h"
#include "tests/support/process.h"
#include "tests/support/recorded_run.h"
#include "tests/support/temp_folder.h"

namespace tbm::test {
namespace {

using namespace std::chrono_literals;
using dds::test::Eventually;
using dds::test::OnLoopback;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

constexpr int kDomain = 196;

std::string Rows(const Eigen::Quaterniond& rotation) {
  const Eigen::Matrix3d m = rotation.toRotationMatrix();
  std::string text;
  for (int i = 0; i < 9; ++i) text += fmt::format("{}{}", i > 0 ? ", " : "", m(i / 3, i % 3));
  return "[" + text + "]";
}

std::string RailYaml(const RailSetup& setup) {
  const RailCamera& camera = *setup.camera;
  const Eigen::Vector3d& p = camera.in_imu_m;
  const Eigen::Vector3d& start = setup.start.position_world_m;
  return fmt::format(
      "imu: {{rate_hz: 200, angle_random_walk_deg_sqrt_h: 0.2, velocity_random_walk_ug_sqrt_hz: 30,"
      " gyro_bias_deg_h: 30, accel_bias_mg: 1.0}}\n"
      "tilt: {{rotation: {}, sigma_deg: 0.003}}\n"
      "camera:\n"
      "  image_width: 2592\n"
      "  image_height: 1944\n"
      "  distortion_model: plumb_bob\n"
      "  camera_matrix: {{rows: 3, cols: 3, data: [5455, 0, 1295.5, 0, 5455, 971.5, 0, 0, 1]}}\n"
      "  distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}\n"
      "  residual_px: 0.1\n"
      "  rotation: {}\n"
      "  position_m: [{}, {}, {}]\n"
      "  sigma_rotation_deg: 0.005\n"
      "  sigma_position_mm: 0.1\n"
      "  sigma_time_offset_s: 0.005\n"
      "start: {{position_m: [{}, {}, {}], sigma_position_mm: 0.1, at_rest_s: {}}}\n",
      Rows(setup.tilt->housing_from_imu),
      Rows(camera.camera_from_imu),
      p.x(),
      p.y(),
      p.z(),
      start.x(),
      start.y(),
      start.z(),
      setup.start.at_rest_s);
}

std::string TargetsCsv(const std::vector<SurveyedTarget>& targets) {
  std::string text = "target,x_m,y_m,z_m,sigma_mm\n";
  for (const SurveyedTarget& target : targets) {
    const Eigen::Vector3d& p = target.in_world_m;
    text += fmt::format("{},{},{},{},{}\n", target.name, p.x(), p.y(), p.z(), 1e3 * target.sigma_m);
  }
  return text;
}

// The run as it would have been recorded.
void WriteRun(const std::string& folder, const GeneratedRun& run) {
  RailRecorder::Setup setup{RailYaml(run.setup), TargetsCsv(run.recording.targets), {}};
  for (const SurveyedTarget& target : run.recording.targets) setup.targets.push_back(target.name);
  RailRecorder recorder(folder, setup, Duration(std::chrono::seconds(1)));
  ASSERT_EQ(recorder.Begin(), std::nullopt);
  for (const ImuSample& one : run.recording.imu) recorder.Add(one);
  for (const TrolleyTilt& one : run.recording.tilts) recorder.Add(one);
  for (const TargetImage& one : run.recording.images) recorder.Add(one);
  ASSERT_EQ(recorder.Finish(), std::nullopt);
}

// The line that `tbm line` makes of a run's folder.
std::string LineOf(const std::string& run, const std::string& out) {
  std::ostringstream said;
  std::ostringstream complaints;
  EXPECT_EQ(RunLine({.run = run, .out = out}, Console{said, complaints}), ExitCode::kDone)
      << complaints.str();
  return ReadText(out);
}

// All that the process says, as it is heard.
class Listener {
 public:
  explicit Listener(int domain)
      : participant_(OnLoopback(domain, "listener")),
        states_(participant_,
                [this](const dds::TrolleyState& m, const dds::SampleFacts&) {
                  const std::lock_guard lock(mutex_);
                  states.push_back(m);
                }),
        lines_(participant_,
               [this](const dds::RailLinePiece& m, const dds::SampleFacts&) {
                 const std::lock_guard lock(mutex_);
                 pieces[m.piece] = m;
               }),
        settlements_(participant_,
                     [this](const dds::SettlementPiece& m, const dds::SampleFacts&) {
                       const std::lock_guard lock(mutex_);
                       settlements[m.piece] = m;
                     }),
        calibrations_(participant_,
                      [this](const dds::CalibrationStatus& m, const dds::SampleFacts&) {
                        const std::lock_guard lock(mutex_);
                        calibrations[std::string(m.subject)] = m;
                      }),
        alarms_(participant_,
                [this](const dds::AlarmStatus& m, const dds::SampleFacts&) {
                  const std::lock_guard lock(mutex_);
                  if (m.phase == dds::AlarmPhase::kUnacknowledged) {
                    raised[std::string(m.code)] = m;
                  }
                }),
        health_(participant_,
                [this](const dds::DeviceHealth& m, const dds::SampleFacts&) {
                  const std::lock_guard lock(mutex_);
                  health[std::string(m.device_id)] = m;
                }),
        replies_(participant_,
                 [this](const dds::CommandReply& m, const dds::SampleFacts&) {
                   const std::lock_guard lock(mutex_);
                   replies.push_back(m);
                 }),
        commands_(participant_) {}

  template <class Is>
  bool Has(const Is& is) {
    const std::lock_guard lock(mutex_);
    return is(*this);
  }
  bool HasStatus(dds::RailPointStatus status) {
    const std::lock_guard lock(mutex_);
    return std::any_of(
        states.begin(), states.end(), [&](const auto& m) { return m.status == status; });
  }
  bool HasReason(std::string_view reason) {
    const std::lock_guard lock(mutex_);
    return std::any_of(
        states.begin(), states.end(), [&](const auto& m) { return m.reason.view() == reason; });
  }
  void Ask(std::string_view verb) {
    const SystemClock clock;
    dds::Command command;
    command.machine_id = "trolley-1";
    const std::string id = fmt::format("request-{}", ++asked_);
    command.request_id = std::string_view(id);
    command.addressee = "rail_line";
    command.verb = verb;
    command.by = "S. Urveyor";
    command.issued_at = clock.Now();
    command.expires_at = clock.Now() + Duration(std::chrono::seconds(20));
    commands_.Write(command);
  }
  bool IsHeardByIt() const { return commands_.matched_readers() > 0; }

 private:
  dds::Participant participant_;
  std::mutex mutex_;  // guards the lists below while they grow
  int asked_ = 0;

 public:
  std::vector<dds::TrolleyState> states;
  std::map<int, dds::RailLinePiece> pieces;
  std::map<int, dds::SettlementPiece> settlements;
  std::map<std::string, dds::CalibrationStatus> calibrations;
  std::map<std::string, dds::AlarmStatus> raised;
  std::map<std::string, dds::DeviceHealth> health;
  std::vector<dds::CommandReply> replies;

 private:
  dds::Subscriber<dds::TrolleyState> states_;
  dds::Subscriber<dds::RailLinePiece> lines_;
  dds::Subscriber<dds::SettlementPiece> settlements_;
  dds::Subscriber<dds::CalibrationStatus> calibrations_;
  dds::Subscriber<dds::AlarmStatus> alarms_;
  dds::Subscriber<dds::DeviceHealth> health_;
  dds::Subscriber<dds::CommandReply> replies_;
  dds::Publisher<dds::Command> commands_;
};

class RailLineProgram : public testing::Test {
 protected:
  static void SetUpTestSuite() { generated_ = new GeneratedRun(GenerateRail({.seed = 11})); }
  static void TearDownTestSuite() { delete generated_; }

  RailLineProgram() { WriteRun(folder_ / "played", *generated_); }

  std::string Config(int domain, double speed, const std::string& more = "") {
    WriteText(folder_ / "rail_line.yaml",
              fmt::format("machine_id: trolley-1\nruns: runs\nlines: lines\n"
                          "replay: {{run: played, speed: {}, image_delay_ms: 50}}\n"
                          "dds: {{domain: {}}}\n{}",
                          speed,
                          domain,
                          more));
    return folder_ / "rail_line.yaml";
  }
  // Of one kind, finished ones: the only one's path.
  std::string OnlyOne(const std::string& where) const {
    std::vector<std::string> found = All(where);
    EXPECT_EQ(found.size(), 1u) << where;
    return found.empty() ? "" : found.front();
  }
  std::vector<std::string> All(const std::string& where) const {
    std::vector<std::string> found;
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(folder_ / where, ignored)) {
      found.push_back(entry.path());
    }
    return found;
  }

  TempFolder folder_;
  static const GeneratedRun* generated_;
};
const GeneratedRun* RailLineProgram::generated_ = nullptr;

TEST_F(RailLineProgram, FollowsARunAndLeavesTheLineThatTbmLineMakes) {
  // An earlier line, which lay 4 mm higher.
  const std::string before = LineOf(folder_ / "played", folder_ / "now.csv");
  auto earlier = GenerateRail({.seed = 12});
  for (SurveyedTarget& target : earlier.recording.targets) target.in_world_m.z() += 0.004;
  earlier.setup.start.position_world_m.z() += 0.004;
  WriteRun(folder_ / "earlier", earlier);
  LineOf(folder_ / "earlier", folder_ / "base.csv");

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

  // 4 mm: found, and of the second size.
  ASSERT_FALSE(listener.settlements.empty());
  EXPECT_EQ(listener.settlements.begin()->second.highest_alert, 2);
  EXPECT_EQ(listener.settlements.begin()->second.base_sha256.view(),
            Sha256(ReadText(folder_ / "base.csv")));
  EXPECT_TRUE(listener.raised.contains("settlement_found"));
  EXPECT_TRUE(listener.raised.contains("calibration_due"));
  EXPECT_FALSE(listener.raised.contains("imu_silent"));
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

  // What the generated trolley's unit shows at rest.
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < 1000; ++i) {
    rate += 1e-3 * generated_->recording.imu[i].gyro_rad_s;
    force += 1e-3 * generated_->recording.imu[i].accel_m_s2;
  }
  const auto truth = [=](Timestamp at) {
    std::mt19937_64 engine(static_cast<std::uint64_t>(at.ns));
    std::normal_distribution<double> normal;
    const auto noise = [&](double sigma) {
      return Eigen::Vector3d(
          sigma * normal(engine), sigma * normal(engine), sigma * normal(engine));
    };
    StimReading reading;
    reading.rate_rad_s = rate + noise(9e-4);
    reading.specific_force_m_s2 = force + noise(4.6e-3);
    return reading;
  };
  const SystemClock clock;
  StimEmulatorSettings settings;
  settings.scales.sample_rate_hz = 250.0;
  StimEmulator unit({folder_ / "imu", 921600, Parity::kNone, 1}, settings, truth, clock);
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
}

}  // namespace
}  // namespace tbm::test
