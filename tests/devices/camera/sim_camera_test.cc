#include "devices/camera/sim_camera.h"

#include <cstring>
#include <vector>

#include <gtest/gtest.h>

#include "tests/devices/camera/small_machine.h"
#include "tests/support/fake_clock.h"

namespace tbm::test {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(100);

class SimCameraTest : public ::testing::Test {
 protected:
  SimCameraTest() {
    // From here every 100 ms an exposure ends.
    clock_.StepCivilTime(Duration(-(clock_.Now().ns % kPeriod.count())));
  }
  SimCamera Camera() const {
    return SimCamera(
        CameraConfig{},
        clock_,
        std::make_shared<sim::World>(SmallRig(), sim::Motion{}, sim::Faults{}, clock_.Now()),
        PlainView());
  }
  FakeClock clock_;
};

TEST_F(SimCameraTest, GivesEachExposureOnceWhenItHasEnded) {
  SimCamera camera = Camera();
  const Timestamp begin = clock_.Now();
  EXPECT_EQ(camera.WaitFrame(Duration(0)).error(), CameraFailure::kNoFrameInTime);
  for (int i = 1; i <= 3; ++i) {
    clock_.Advance(kPeriod);
    const auto frame = camera.WaitFrame(Duration(0));
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->sensed_at, begin + i * kPeriod - std::chrono::microseconds(2500));
    EXPECT_EQ(frame->frame_number, static_cast<std::uint64_t>(i));
    EXPECT_EQ(frame->image.width_px, 320);
    EXPECT_EQ(camera.WaitFrame(Duration(0)).error(), CameraFailure::kNoFrameInTime);
  }
  EXPECT_EQ(camera.Health().state, CameraState::kStreaming);
}

TEST_F(SimCameraTest, ACallerThatComesLateLosesFrames) {
  SimCamera camera = Camera();
  ASSERT_FALSE(camera.WaitFrame(Duration(0)));
  clock_.Advance(4 * kPeriod);
  const auto frame = camera.WaitFrame(Duration(0));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->frame_number, 4u);
  EXPECT_EQ(camera.Health().lost, 3u);
  EXPECT_EQ(camera.Health().frames, 1u);
}

TEST_F(SimCameraTest, AClockSetBackDoesNotStopIt) {
  SimCamera camera = Camera();
  clock_.Advance(kPeriod);
  ASSERT_FALSE(camera.WaitFrame(Duration(0)));
  clock_.Advance(kPeriod);
  ASSERT_TRUE(camera.WaitFrame(Duration(0)));
  clock_.StepCivilTime(-std::chrono::hours(1));
  ASSERT_FALSE(camera.WaitFrame(Duration(0)));
  clock_.Advance(kPeriod);
  EXPECT_TRUE(camera.WaitFrame(Duration(0)));
}

TEST_F(SimCameraTest, TheExposureScalesTheLightAndIsClamped) {
  SimCamera camera = Camera();
  ASSERT_FALSE(camera.WaitFrame(Duration(0)));
  const auto sum_at = [&](double exposure_us, double expected_us) {
    camera.RequestExposure(exposure_us);
    clock_.Advance(kPeriod);
    const auto frame = camera.WaitFrame(Duration(0));
    EXPECT_EQ(frame->exposure_us, expected_us);
    const auto* const pixels = static_cast<const std::uint8_t*>(frame->image.pixels);
    double sum = 0.0;
    for (int i = 0; i < 320 * 256; ++i) sum += pixels[i];
    return sum;
  };
  EXPECT_GT(sum_at(4000.0, 4000.0), 1.5 * sum_at(2000.0, 2000.0));
  sum_at(1e9, 50'000.0);
  sum_at(0.0, 20.0);
}

}  // namespace
}  // namespace tbm::test
