// A box without a battery in its clock starts in 1970 and is set by a time server later; a
// summer-time mistake sets it back by an hour. Neither may cost more than a moment.
#include <array>
#include <atomic>
#include <mutex>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/bus/sleeper.h"
#include "devices/inclinometer/make_inclinometers.h"
#include "devices/sim/world.h"
#include "pose/app/camera_box.h"
#include "pose/rig/rig_file.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

class SettableClock final : public Clock {
 public:
  Timestamp Now() const override { return SystemClock().Now() + Duration(set_by_ns); }
  std::chrono::steady_clock::time_point Steady() const override { return SystemClock().Steady(); }
  std::atomic<std::int64_t> set_by_ns{0};
};

class CountingSink final : public MessageSink {
 public:
  void Publish(const dds::FrameFeatures&) override {}
  void Publish(const dds::TiltReading&) override {}
  void Publish(const dds::DeviceHealth&) override {}
  void Publish(const dds::RelativePose& pose) override {
    const std::lock_guard lock(mutex_);
    poses_.push_back(pose);
  }
  void Publish(const dds::Event& event) override {
    const std::lock_guard lock(mutex_);
    if (event.code == "clock_set") texts_.emplace_back(event.text.view());
  }
  std::vector<dds::RelativePose> poses() {
    const std::lock_guard lock(mutex_);
    return poses_;
  }
  std::vector<std::string> texts() {
    const std::lock_guard lock(mutex_);
    return texts_;
  }

 private:
  std::mutex mutex_;
  std::vector<dds::RelativePose> poses_;
  std::vector<std::string> texts_;
};

TEST(ClockSet, ForwardAndBackCostsAtMostAMoment) {
  const Rig rig = LoadRigFile(TBM_SOURCE_DIR "/pose/app/example/rig.yaml").value().rig;
  SettableClock clock;
  SystemSleeper sleeper;
  BoxConfig config;
  config.machine_id = "TBM-T";
  config.camera.driver = CameraDriver::kSim;
  config.camera.frame_rate_hz = 20.0;
  config.target_inclinometer.name = "target";
  config.camera_inclinometer.name = "camera";
  config.target_inclinometer.poll_period = 20ms;
  config.camera_inclinometer.poll_period = 20ms;
  sim::Motion standstill;
  standstill.advance_m_per_s = 0.0;
  standstill.steer_m = 0.0;
  standstill.steer_angle_rad = 0.0;
  standstill.level_angle_rad = 0.0;
  standstill.tilt_noise_factor = 0.0;
  const auto world =
      std::make_shared<const sim::World>(rig, standstill, sim::Faults{}, clock.Now());
  BoxParts parts;
  parts.camera = MakeCamera(config.camera, clock, world);
  InclinometerSources sources;
  sources.truths["target"] = [world](Timestamp at) {
    return world->TiltReading(sim::TiltSensor::kTarget, at);
  };
  sources.truths["camera"] = [world](Timestamp at) {
    return world->TiltReading(sim::TiltSensor::kCamera, at);
  };
  auto tilts = MakeInclinometers(
      std::array{config.target_inclinometer, config.camera_inclinometer}, sources, clock, sleeper);
  parts.target_inclinometer = std::move(tilts[0]);
  parts.camera_inclinometer = std::move(tilts[1]);
  CountingSink sink;
  CameraBox box(config, rig, "hash", std::move(parts), clock, sink);
  std::jthread runner([&](const std::stop_token& stop) { box.Run(stop); });

  const auto wait_for_poses = [&](std::size_t more) {
    const std::size_t before = sink.poses().size();
    for (int i = 0; i < 400 && sink.poses().size() < before + more; ++i) {
      std::this_thread::sleep_for(25ms);
    }
  };
  wait_for_poses(10);
  std::int64_t set_by_ns = 0;
  for (const auto& step : std::array<Duration, 3>{3600s, -7200s, 1h + 700ms}) {
    const std::size_t before = sink.poses().size();
    set_by_ns += step.count();
    clock.set_by_ns = set_by_ns;
    wait_for_poses(24);
    const auto poses = sink.poses();
    int lost = 0;
    for (std::size_t i = before; i < poses.size(); ++i) lost += poses[i].status != PoseStatus::kOk;
    EXPECT_LE(lost, 6) << "set by " << 1e-9 * static_cast<double>(step.count()) << " s";
    EXPECT_EQ(poses.back().status, PoseStatus::kOk);
    EXPECT_LT(std::abs(1e-9 * static_cast<double>((clock.Now() - poses.back().sensed_at).count())),
              2.0)
        << "stamps follow the clock";
  }
  runner.request_stop();
  runner.join();
  ASSERT_EQ(sink.texts().size(), 3u);
  EXPECT_THAT(sink.texts()[0], HasSubstr("forward by 3600.0"));
  EXPECT_THAT(sink.texts()[1], HasSubstr("back by 7200.0"));
}

}  // namespace
}  // namespace tbm
