#include "pose/app/camera_box.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>

#include <gtest/gtest.h>

#include "devices/bus/sleeper.h"
#include "devices/inclinometer/make_inclinometers.h"
#include "devices/replay/run_reader.h"
#include "devices/sim/world.h"
#include "pose/rig/rig_file.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using std::chrono::milliseconds;

const std::string kRigFile = TBM_SOURCE_DIR "/pose/app/example/rig.yaml";

class ListSink final : public MessageSink {
 public:
  void Publish(const dds::FrameFeatures& message) override { Keep(message, &features); }
  void Publish(const dds::TiltReading& message) override { Keep(message, &tilts); }
  void Publish(const dds::RelativePose& message) override {
    Keep(message, &poses);
    std::this_thread::sleep_for(milliseconds(pose_takes_ms));
  }
  void Publish(const dds::DeviceHealth& message) override { Keep(message, &health); }
  void Publish(const dds::Event& message) override { Keep(message, &events); }

  std::size_t PoseCount() {
    const std::lock_guard lock(mutex_);
    return poses.size();
  }
  bool HasEvent(std::string_view code, bool active) {
    const std::lock_guard lock(mutex_);
    for (const dds::Event& event : events) {
      if (event.code.view() == code && event.active == active) return true;
    }
    return false;
  }

  bool HasAlarmOf(std::string_view source) {
    const std::lock_guard lock(mutex_);
    for (const dds::Event& event : events) {
      if (event.source.view() == source && event.severity == dds::Severity::kAlarm) {
        return event.active;
      }
    }
    return false;
  }
  bool IsLastEventOver(std::string_view source) {
    const std::lock_guard lock(mutex_);
    bool is_over = false;
    for (const dds::Event& event : events) {
      if (event.source.view() == source) is_over = !event.active;
    }
    return is_over;
  }
  bool HasPose(PoseReason reason) {
    const std::lock_guard lock(mutex_);
    for (const dds::RelativePose& pose : poses) {
      if (pose.reason == reason) return true;
    }
    return false;
  }
  int HealthCount(std::string_view device_id, dds::DeviceState state) {
    const std::lock_guard lock(mutex_);
    int count = 0;
    for (const dds::DeviceHealth& message : health) {
      count += message.device_id.view() == device_id && message.state == state;
    }
    return count;
  }

  std::atomic<int> pose_takes_ms{0};
  std::vector<dds::FrameFeatures> features;
  std::vector<dds::TiltReading> tilts;
  std::vector<dds::RelativePose> poses;
  std::vector<dds::DeviceHealth> health;
  std::vector<dds::Event> events;

 private:
  template <class Message>
  void Keep(const Message& message, std::vector<Message>* list) {
    const std::lock_guard lock(mutex_);
    list->push_back(message);
  }
  std::mutex mutex_;
};

// A camera that a test can unplug.
class UnpluggableCamera final : public Camera {
 public:
  UnpluggableCamera(std::unique_ptr<Camera> camera,
                    std::atomic<bool>* is_plugged,
                    std::atomic<bool>* is_closed)
      : camera_(std::move(camera)), is_plugged_(is_plugged), is_closed_(is_closed) {}

  Result<Frame, CameraFailure> WaitFrame(Duration timeout) override {
    if (*is_plugged_) return camera_->WaitFrame(timeout);
    std::this_thread::sleep_for(timeout);
    return Failure{CameraFailure::kUnreachable};
  }
  void RequestExposure(double exposure_us) override { camera_->RequestExposure(exposure_us); }
  CameraHealth Health() const override {
    CameraHealth health = camera_->Health();
    if (!*is_plugged_) {
      health.state = CameraState::kSilent;
      health.failure = CameraFailure::kUnreachable;
    }
    return health;
  }
  void Close() override {
    camera_->Close();
    *is_closed_ = true;
  }

 private:
  std::unique_ptr<Camera> camera_;
  std::atomic<bool>* is_plugged_;
  std::atomic<bool>* is_closed_;
};

// An inclinometer in which a test can put a fault: an InclinometerFailure, 0 for none.
class FaultyInclinometer final : public Inclinometer {
 public:
  FaultyInclinometer(std::unique_ptr<Inclinometer> sound, std::atomic<int>* fault)
      : sound_(std::move(sound)), fault_(fault) {}

  Result<TiltSample, InclinometerFailure> Read(
      std::chrono::steady_clock::time_point deadline) override {
    const int fault = *fault_;
    if (fault == 0) return sound_->Read(deadline);
    std::this_thread::sleep_for(milliseconds(20));
    return Failure{static_cast<InclinometerFailure>(fault)};
  }
  InclinometerHealth Health() const override {
    InclinometerHealth health = sound_->Health();
    const int fault = *fault_;
    if (fault == 0) return health;
    health.state = InclinometerState::kSilent;
    health.last_failure = static_cast<InclinometerFailure>(fault);
    return health;
  }

 private:
  std::unique_ptr<Inclinometer> sound_;
  std::atomic<int>* fault_;
};

class CameraBoxTest : public ::testing::Test {
 protected:
  CameraBoxTest() : rig_(LoadRigFile(kRigFile).value().rig) {
    config_.machine_id = "TBM-T";
    config_.camera.driver = CameraDriver::kSim;
    config_.camera.frame_rate_hz = 20.0;
    config_.target_inclinometer.name = "target";
    config_.camera_inclinometer.name = "camera";
    config_.target_inclinometer.poll_period = milliseconds(20);
    config_.camera_inclinometer.poll_period = milliseconds(20);
  }

  BoxParts MakeParts() {
    sim::Motion motion;
    motion.tilt_noise_factor = 0.0;
    world_ = std::make_shared<const sim::World>(rig_, motion, sim::Faults{}, clock_.Now());
    BoxParts parts;
    parts.camera = std::make_unique<UnpluggableCamera>(
        MakeCamera(config_.camera, clock_, world_), &is_plugged_, &is_closed_);
    InclinometerSources sources;
    sources.truths["target"] = [world = world_](Timestamp at) {
      return world->TiltReading(sim::TiltSensor::kTarget, at);
    };
    sources.truths["camera"] = [world = world_](Timestamp at) {
      return world->TiltReading(sim::TiltSensor::kCamera, at);
    };
    const std::array configs = {config_.target_inclinometer, config_.camera_inclinometer};
    auto inclinometers = MakeInclinometers(configs, sources, clock_, sleeper_);
    parts.target_inclinometer =
        std::make_unique<FaultyInclinometer>(std::move(inclinometers[0]), &target_tilt_fault_);
    parts.camera_inclinometer = std::move(inclinometers[1]);
    if (!config_.recording.folder.empty()) {
      RecorderOptions options;
      options.folder = config_.recording.folder;
      options.rig_yaml = test::ReadText(kRigFile);
      options.run_max_frames = 25;
      options.free_min_bytes = 0;
      parts.recorder = std::make_unique<Recorder>(options);
    }
    return parts;
  }

  // Runs the box until it has published `poses` (or 20 s are over), doing `meanwhile` first.
  void RunBox(CameraBox& box, std::size_t poses, const std::function<void()>& meanwhile = {}) {
    std::stop_source stop;
    std::jthread thread([&] { box.Run(stop.get_token()); });
    if (meanwhile) meanwhile();
    WaitFor([&] { return sink_.PoseCount() >= poses; });
    stop.request_stop();
  }
  static bool WaitFor(const std::function<bool()>& condition) {
    for (int i = 0; i < 400; ++i) {
      if (condition()) return true;
      std::this_thread::sleep_for(milliseconds(50));
    }
    return false;
  }

  Rig rig_;
  test::TempFolder folder_;
  BoxConfig config_;
  SystemClock clock_;
  SystemSleeper sleeper_;
  std::shared_ptr<const sim::World> world_;
  std::atomic<bool> is_plugged_{true};
  std::atomic<bool> is_closed_{false};
  std::atomic<int> target_tilt_fault_{0};
  ListSink sink_;
  std::vector<FrameResult> results_;
};

TEST_F(CameraBoxTest, PublishesPosesThatHoldAgainstTheSimulatedTruth) {
  CameraBox box(config_, rig_, "hash", MakeParts(), clock_, sink_);
  RunBox(box, 40);
  ASSERT_GE(sink_.poses.size(), 40u);
  int ok = 0;
  for (const dds::RelativePose& pose : sink_.poses) {
    if (pose.status == PoseStatus::kNone) continue;
    if (pose.status == PoseStatus::kOk) ++ok;
    const Rigid3 truth = world_->At(pose.sensed_at).camera_from_target;
    const Eigen::Vector3d head = truth * rig_.points[0].p_point_in_target;
    ASSERT_EQ(pose.points.size(), 1u);
    ASSERT_TRUE(pose.points[0].bound_m);
    EXPECT_LT((pose.points[0].p_in_camera - head).norm(), *pose.points[0].bound_m);
    EXPECT_LT((pose.points[0].p_in_camera - head).norm(), 0.004);
    EXPECT_EQ(pose.rig_hash.view(), "hash");
  }
  EXPECT_GE(ok, 36);  // the first frames may come before the first tilts
  EXPECT_GE(sink_.features.size(), 40u);
  EXPECT_EQ(sink_.features.back().spots.size(), 5u);
  EXPECT_GE(sink_.tilts.size(), 80u);
  for (std::size_t i = 1; i < sink_.poses.size(); ++i) {
    EXPECT_EQ(sink_.poses[i].sample_number, sink_.poses[i - 1].sample_number + 1);
  }
}

TEST_F(CameraBoxTest, RecordingsReplayBitForBit) {
  config_.recording.folder = folder_ / "runs";
  {
    CameraBox box(
        config_, rig_, "hash", MakeParts(), clock_, sink_, [this](const FrameResult& result) {
          results_.push_back(result);
        });
    RunBox(box, 60);
  }
  std::map<std::int64_t, const FrameResult*> live;
  for (const FrameResult& result : results_) live[result.sensed_at.ns] = &result;

  int compared = 0;
  int runs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(config_.recording.folder)) {
    ++runs;
    BoxConfig replay = config_;
    replay.recording.folder.clear();
    replay.camera.driver = CameraDriver::kReplay;
    replay.camera.run_folder = entry.path();
    replay.camera.real_time = false;
    ListSink sink;
    CameraBox box(replay, rig_, "hash", BoxParts{}, clock_, sink, [&](const FrameResult& result) {
      ASSERT_EQ(live.count(result.sensed_at.ns), 1u);
      const FrameResult& then = *live[result.sensed_at.ns];
      ASSERT_EQ(result.status, then.status);
      ASSERT_EQ(result.reason, then.reason);
      ASSERT_EQ(result.pose.has_value(), then.pose.has_value());
      if (!result.pose) return;
      const PoseEstimate& a = result.pose->pose;
      const PoseEstimate& b = then.pose->pose;
      EXPECT_EQ(a.camera_from_target.rotation.coeffs(), b.camera_from_target.rotation.coeffs());
      EXPECT_EQ(a.camera_from_target.translation, b.camera_from_target.translation);
      EXPECT_EQ(a.covariance, b.covariance);
      EXPECT_EQ(a.chi2, b.chi2);
      EXPECT_EQ(result.points[0].bound_m, then.points[0].bound_m);
      ++compared;
    });
    std::stop_source never;
    box.Run(never.get_token());
  }
  EXPECT_GE(runs, 2);  // it rotated
  EXPECT_GE(compared, 50);
}

TEST_F(CameraBoxTest, AnUnpluggedCameraIsSaidAndComesBack) {
  CameraBox box(config_, rig_, "hash", MakeParts(), clock_, sink_);
  std::stop_source stop;
  std::jthread thread([&] { box.Run(stop.get_token()); });
  ASSERT_TRUE(WaitFor([&] { return sink_.PoseCount() > 5; }));
  is_plugged_ = false;
  EXPECT_TRUE(WaitFor([&] { return sink_.HasEvent("no_pose", true); }));
  is_plugged_ = true;
  EXPECT_TRUE(WaitFor([&] { return sink_.HasEvent("no_pose", false); }));
  stop.request_stop();
  thread.join();
  bool was_silent = false;
  for (const dds::DeviceHealth& health : sink_.health) {
    was_silent |= health.device_id.view() == "camera" &&
                  health.state == dds::DeviceState::kSilent && !health.detail.empty();
  }
  EXPECT_TRUE(was_silent);
}

TEST_F(CameraBoxTest, ASilentInclinometerIsSaidAndComesBack) {
  CameraBox box(config_, rig_, "hash", MakeParts(), clock_, sink_);
  std::stop_source stop;
  std::jthread thread([&] { box.Run(stop.get_token()); });
  ASSERT_TRUE(WaitFor([&] { return sink_.PoseCount() > 5; }));
  target_tilt_fault_ = static_cast<int>(InclinometerFailure::kNoReply);
  EXPECT_TRUE(WaitFor([&] { return sink_.HasAlarmOf("inclinometer_target"); }));
  EXPECT_TRUE(WaitFor([&] { return sink_.HasPose(PoseReason::kTiltStale); }));
  target_tilt_fault_ = 0;
  EXPECT_TRUE(WaitFor([&] { return sink_.IsLastEventOver("inclinometer_target"); }));
  // Said once a second also when nothing changes.
  EXPECT_TRUE(WaitFor(
      [&] { return sink_.HealthCount("inclinometer_camera", dds::DeviceState::kStreaming) >= 3; }));
  stop.request_stop();
  thread.join();
  EXPECT_GE(sink_.HealthCount("inclinometer_target", dds::DeviceState::kSilent), 1);
  EXPECT_EQ(sink_.HealthCount("inclinometer_camera", dds::DeviceState::kSilent), 0);
  bool was_invalid = false;
  for (const dds::TiltReading& tilt : sink_.tilts) {
    was_invalid |= tilt.sensor.view() == "target" && tilt.validity == dds::Validity::kInvalid &&
                   tilt.reason.view() == "no_reply";
  }
  EXPECT_TRUE(was_invalid);
}

TEST_F(CameraBoxTest, ADeadChannelHasAReasonOfItsOwn) {
  CameraBox box(config_, rig_, "hash", MakeParts(), clock_, sink_);
  std::stop_source stop;
  std::jthread thread([&] { box.Run(stop.get_token()); });
  ASSERT_TRUE(WaitFor([&] { return sink_.PoseCount() > 5; }));
  target_tilt_fault_ = static_cast<int>(InclinometerFailure::kNotFinite);
  EXPECT_TRUE(WaitFor([&] { return sink_.HasPose(PoseReason::kTiltNotFinite); }));
  stop.request_stop();
}

// The solver takes three frame periods: the newest frame wins, the others are counted.
TEST_F(CameraBoxTest, FramesThatComeTooFastAreSkippedAndCounted) {
  sink_.pose_takes_ms = 150;
  CameraBox box(config_, rig_, "hash", MakeParts(), clock_, sink_);
  // Twice as many as an idle computer needs for it: on a busy one frames come slower.
  RunBox(box, 16);
  ASSERT_GE(sink_.features.size(), 16u);
  const dds::FrameFeatures& last = sink_.features.back();
  EXPECT_GE(last.frames_skipped, 5u);
  EXPECT_GE(last.frame_number, sink_.features.front().frame_number + 14);
  EXPECT_LE(last.frames_skipped, last.frames_received);
}

TEST_F(CameraBoxTest, StopsWithinASecondAndWithoutAnAlarm) {
  CameraBox box(config_, rig_, "hash", MakeParts(), clock_, sink_);
  std::stop_source stop;
  std::jthread thread([&] { box.Run(stop.get_token()); });
  ASSERT_TRUE(WaitFor([&] { return sink_.PoseCount() > 5; }));
  const auto asked = std::chrono::steady_clock::now();
  stop.request_stop();
  thread.join();
  EXPECT_TRUE(is_closed_) << "a camera left running goes on sending";
  EXPECT_LT(std::chrono::steady_clock::now() - asked, std::chrono::seconds(2));
  for (const dds::Event& event : sink_.events) {
    EXPECT_FALSE(event.active && event.severity == dds::Severity::kAlarm) << event.text.view();
  }
}

TEST_F(CameraBoxTest, ABadRunToReplayIsAnAlarmNotACrash) {
  config_.camera.driver = CameraDriver::kReplay;
  config_.camera.run_folder = folder_ / "nothing";
  CameraBox box(config_, rig_, "hash", BoxParts{}, clock_, sink_);
  std::stop_source never;
  box.Run(never.get_token());
  EXPECT_TRUE(sink_.HasEvent("bad_run", true));
}

}  // namespace
}  // namespace tbm
