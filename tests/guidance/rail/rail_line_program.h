#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <random>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/imu/stim_emulator.h"
#include "guidance/app/csv_field.h"
#include "guidance/app/line_command.h"
#include "guidance/app/rail_recorder.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/rail_messages.h"
#include "idl/cpp/subscriber.h"
#include "pose/base/angle.h"
#include "pose/base/clock.h"
#include "tests/guidance/rail/rail_generator.h"
#include "tests/idl/dds_support.h"
#include "tests/support/temp_folder.h"

// The program rail_line as a test sees it: its files, and all that it says.
namespace tbm::test {

using dds::test::OnLoopback;

inline std::string RowsOf(const Eigen::Quaterniond& rotation) {
  const Eigen::Matrix3d m = rotation.toRotationMatrix();
  std::string text;
  for (int i = 0; i < 9; ++i) text += fmt::format("{}{}", i > 0 ? ", " : "", m(i / 3, i % 3));
  return "[" + text + "]";
}

inline std::string RailYaml(const RailSetup& setup) {
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
      "start: {{position_m: [{}, {}, {}], sigma_position_mm: 0.1, at_rest_s: {}{}}}\n",
      RowsOf(setup.tilt->housing_from_imu),
      RowsOf(camera.camera_from_imu),
      p.x(),
      p.y(),
      p.z(),
      start.x(),
      start.y(),
      start.z(),
      setup.start.at_rest_s,
      setup.start.heading_rad
          ? fmt::format(", heading_known: true, heading_deg: {}, sigma_heading_deg: {}",
                        RadToDeg(*setup.start.heading_rad),
                        RadToDeg(setup.start.sigma_heading_rad))
          : "");
}

inline std::string TargetsCsv(const std::vector<SurveyedTarget>& targets) {
  std::string text = "target,x_m,y_m,z_m,sigma_mm\n";
  for (const SurveyedTarget& target : targets) {
    const Eigen::Vector3d& p = target.in_world_m;
    text += fmt::format(
        "{},{},{},{},{}\n", CsvField(target.name), p.x(), p.y(), p.z(), 1e3 * target.sigma_m);
  }
  return text;
}

// The run as it would have been recorded.
inline void WriteRun(const std::string& folder, const GeneratedRun& run) {
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
inline std::string LineOf(const std::string& run, const std::string& out) {
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
        events_(participant_,
                [this](const dds::Event& m, const dds::SampleFacts&) {
                  const std::lock_guard lock(mutex_);
                  events[std::string(m.code)] += std::string(m.text) + "\n";
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
  bool HasRaised(std::string_view alarm) {
    const std::lock_guard lock(mutex_);
    return raised.contains(std::string(alarm));
  }
  bool HasSaid(std::string_view event) {
    const std::lock_guard lock(mutex_);
    return events.contains(std::string(event));
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
  std::map<std::string, std::string> events;  // all texts of a code
  std::map<std::string, dds::DeviceHealth> health;
  std::vector<dds::CommandReply> replies;

 private:
  dds::Subscriber<dds::TrolleyState> states_;
  dds::Subscriber<dds::RailLinePiece> lines_;
  dds::Subscriber<dds::SettlementPiece> settlements_;
  dds::Subscriber<dds::CalibrationStatus> calibrations_;
  dds::Subscriber<dds::AlarmStatus> alarms_;
  dds::Subscriber<dds::Event> events_;
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
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / where, ignored)) {
      found.push_back(entry.path());
    }
    return found;
  }

  TempFolder folder_;
  static inline const GeneratedRun* generated_ = nullptr;
};

// A line as it would be, had the rail been higher: by `up_m` of the distance.
inline std::string Raised(const std::string& line, const std::function<double(double)>& up_m) {
  std::istringstream rows(line);
  std::string text;
  std::string row;
  std::getline(rows, text);
  text += "\n";
  while (std::getline(rows, row)) {
    std::vector<std::string> fields;
    std::istringstream columns(row);
    for (std::string field; std::getline(columns, field, ',');) fields.push_back(field);
    fields.at(4) = fmt::format("{:.6f}", std::stod(fields.at(4)) + up_m(std::stod(fields.at(1))));
    text += fmt::format("{}\n", fmt::join(fields, ","));
  }
  return text;
}

// A unit that rests, as the generated trolley does at first; at a place on its port.
inline StimTruth AtRest(const GeneratedRun& run) {
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < 1000; ++i) {
    rate += 1e-3 * run.recording.imu[i].gyro_rad_s;
    force += 1e-3 * run.recording.imu[i].accel_m_s2;
  }
  return [=](Timestamp at) {
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
}

}  // namespace tbm::test
