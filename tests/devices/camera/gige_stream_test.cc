#include <algorithm>
#include <cmath>
#include <mutex>
#include <set>
#include <thread>

#include <gtest/gtest.h>

#include "tests/devices/camera/gige_bench.h"
#include "tests/devices/camera/gv_proxy.h"

namespace tbm::test {
namespace {

const SystemClock kClock;

TEST(GigeCamera, StreamsWholeImagesInOrder) {
  const auto simulator = StartSimulator(SmallWorld(1280, 1024));
  const auto camera = MakeCamera(GigeConfig(20.0), kClock);
  std::optional<std::uint32_t> first_sequence;
  std::uint64_t first_number = 0;
  for (int i = 0; i < 30; ++i) {
    const auto frame = NextFrame(*camera);
    ASSERT_TRUE(frame);
    if (i == 0) continue;  // may be incomplete
    EXPECT_TRUE(frame->complete());
    EXPECT_EQ(frame->image.width_px, 1280);
    EXPECT_EQ(frame->image.height_px, 1024);
    EXPECT_EQ(frame->image.max_value, 255u);
    const auto sequence = SequenceOf(*frame);
    ASSERT_TRUE(sequence);
    if (!first_sequence) {
      first_sequence = sequence;
      first_number = frame->frame_number;
    }
    EXPECT_EQ(frame->frame_number - first_number, *sequence - *first_sequence);
  }
  const CameraHealth health = camera->Health();
  EXPECT_EQ(health.state, CameraState::kStreaming);
  EXPECT_FALSE(health.failure);
  EXPECT_EQ(health.frames, 30u);
  EXPECT_GT(health.socket_buffer_bytes, 0);
  camera->Close();
  EXPECT_EQ(camera->Health().state, CameraState::kClosed);
}

// Aravis' fake camera begins at 65400 on purpose.
TEST(GigeCamera, FrameIdsThatWrapAreNoLoss) {
  const auto simulator = StartSimulator();
  const auto camera = MakeCamera(GigeConfig(100.0), kClock);
  std::optional<std::uint64_t> ahead;  // frame number minus the simulator's count
  int frames = 0;
  for (; frames < 180; ++frames) {
    const auto frame = NextFrame(*camera);
    ASSERT_TRUE(frame);
    if (!frame->complete()) continue;
    const auto sequence = SequenceOf(*frame);
    ASSERT_TRUE(sequence);
    if (!ahead) ahead = frame->frame_number - *sequence;
    EXPECT_EQ(frame->frame_number - *sequence, *ahead);
  }
  EXPECT_GT(simulator->frames_sent(), 150u);
}

TEST(GigeCamera, LossIsCountedFromFrameIds) {
  const auto simulator = StartSimulator();
  GvProxy proxy(kProxyAddress, kCameraAddress, "GigeCamera.loss");
  ASSERT_TRUE(proxy.is_up());
  CameraConfig config = GigeConfig(50.0, kProxyAddress);
  config.silent_after_ms = 2000;
  const auto camera = MakeCamera(config, kClock);
  // The first image after the start is often damaged, on a busy machine the next one too.
  std::optional<std::uint32_t> first;
  for (int i = 0; i < 5 && !first; ++i) {
    const auto before = NextFrame(*camera);
    ASSERT_TRUE(before);
    if (i > 0) first = SequenceOf(*before);
  }
  const std::uint64_t lost_before = camera->Health().lost;
  const std::uint64_t frames_before = camera->Health().frames;
  for (int hole = 0; hole < 3; ++hole) {
    proxy.is_black_hole = true;
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    proxy.is_black_hole = false;
    FramesFor(*camera, std::chrono::milliseconds(300));
  }
  const auto after = NextFrame(*camera);
  ASSERT_TRUE(first);
  ASSERT_TRUE(after);
  const auto last = SequenceOf(*after);
  ASSERT_TRUE(last);
  const CameraHealth health = camera->Health();
  const std::uint64_t sent = *last - *first;
  EXPECT_EQ(health.lost - lost_before, sent - (health.frames - frames_before));
  EXPECT_GT(health.lost, 30u);
  EXPECT_EQ(health.reconnects, 0u);
}

TEST(GigeCamera, OnePercentOfPacketsLostCostsNoImageWithResend) {
  const auto simulator = StartSimulator(SmallWorld(640, 512));
  GvProxy proxy(kProxyAddress, kCameraAddress, "GigeCamera.resend");
  CameraConfig config = GigeConfig(10.0, kProxyAddress);
  config.packet_size_bytes = 1400;
  const auto camera = MakeCamera(config, kClock);
  ASSERT_TRUE(NextFrame(*camera));
  proxy.drop = 0.01;
  int whole = 0;
  for (int i = 0; i < 40; ++i) {
    const auto frame = NextFrame(*camera);
    ASSERT_TRUE(frame);
    if (frame->complete()) ++whole;
  }
  EXPECT_GE(whole, 39);  // 240 packets a frame: without resend four of forty
  EXPECT_GT(proxy.dropped(), 50u);
  EXPECT_GT(camera->Health().resent_packets, 50u);
}

TEST(GigeCamera, WithoutResendAnImageWithHolesIsFlagged) {
  const auto simulator = StartSimulator();
  GvProxy proxy(kProxyAddress, kCameraAddress, "GigeCamera.incomplete");
  CameraConfig config = GigeConfig(20.0, kProxyAddress);
  config.packet_size_bytes = 1400;
  config.packet_resend = false;
  proxy.answers_resend = false;
  const auto camera = MakeCamera(config, kClock);
  FramesFor(*camera, std::chrono::milliseconds(300));
  EXPECT_EQ(camera->Health().incomplete, 0u);
  proxy.drop = 0.02;  // 60 packets a frame: seven frames of ten have a hole
  int flagged = 0;
  for (int i = 0; i < 40; ++i) {
    const auto frame = NextFrame(*camera);
    ASSERT_TRUE(frame);
    if (!frame->complete()) ++flagged;
  }
  EXPECT_GT(flagged, 10);
  EXPECT_EQ(camera->Health().incomplete, static_cast<std::uint64_t>(flagged));
  EXPECT_EQ(camera->Health().state, CameraState::kStreaming);
  proxy.drop = 0.0;
  FramesFor(*camera, std::chrono::milliseconds(500));
  const auto frame = NextFrame(*camera);
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->complete());
}

TEST(GigeCamera, ReorderedAndDuplicatedPacketsCostNothing) {
  const auto simulator = StartSimulator();
  GvProxy proxy(kProxyAddress, kCameraAddress, "GigeCamera.reorder");
  CameraConfig config = GigeConfig(20.0, kProxyAddress);
  config.packet_size_bytes = 1400;
  const auto camera = MakeCamera(config, kClock);
  ASSERT_TRUE(NextFrame(*camera));
  proxy.reorder = 0.01;
  proxy.duplicate = 0.02;
  std::optional<std::uint32_t> last;
  int whole = 0;
  for (int i = 0; i < 40; ++i) {
    const auto frame = NextFrame(*camera);
    ASSERT_TRUE(frame);
    if (!frame->complete()) continue;
    ++whole;
    const auto sequence = SequenceOf(*frame);
    ASSERT_TRUE(sequence);
    EXPECT_GT(*sequence, last.value_or(0));
    last = sequence;
  }
  EXPECT_GE(whole, 39);
}

// UDP's checksum does not see what happened before it: damaged pixels arrive as a whole frame.
TEST(GigeCamera, CorruptedPayloadDoesNotDisturbTheStream) {
  const auto simulator = StartSimulator();
  GvProxy proxy(kProxyAddress, kCameraAddress, "GigeCamera.corrupt");
  const auto camera = MakeCamera(GigeConfig(50.0, kProxyAddress), kClock);
  ASSERT_TRUE(NextFrame(*camera));
  proxy.corrupt = 0.2;
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(NextFrame(*camera));
  EXPECT_EQ(camera->Health().reconnects, 0u);
}

TEST(GigeCamera, TheExposureReachesTheCameraAndItsFrameSaysSo) {
  const auto simulator = StartSimulator();
  const auto camera = MakeCamera(GigeConfig(20.0), kClock);
  FramesFor(*camera, std::chrono::milliseconds(300));
  const auto long_frame = NextFrame(*camera);
  ASSERT_TRUE(long_frame);
  EXPECT_EQ(long_frame->exposure_us, 5000.0);
  const double long_peak_dn = MaxPixel(*long_frame);
  EXPECT_GT(long_peak_dn, 130.0);
  EXPECT_LT(long_peak_dn, 230.0);

  camera->RequestExposure(2000.0);
  std::optional<Frame> frame;
  for (int i = 0; i < 20 && !(frame && frame->exposure_us == 2000.0); ++i)
    frame = NextFrame(*camera);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->exposure_us, 2000.0);
  FramesFor(*camera, std::chrono::milliseconds(200));
  frame = NextFrame(*camera);
  ASSERT_TRUE(frame);
  EXPECT_NEAR(MaxPixel(*frame) / long_peak_dn, 0.4, 0.06);
  EXPECT_EQ(camera->Health().exposure_us, 2000.0);

  camera->RequestExposure(1e9);
  for (int i = 0; i < 20 && frame && frame->exposure_us == 2000.0; ++i) frame = NextFrame(*camera);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->exposure_us, 50'000.0);  // clamped
}

// The camera's stamps count from its own power-up; what comes out is this computer's time.
TEST(GigeCamera, StampsAreTheMiddleOfTheExposureOnThisComputersClock) {
  std::mutex mutex;
  std::set<std::int64_t> shown_ns;
  const auto simulator = StartSimulator(SmallWorld(), [&](const Shown& shown) {
    const std::lock_guard lock(mutex);
    shown_ns.insert(shown.sensed_at.ns);
  });
  CameraConfig config = GigeConfig(20.0);
  config.exposure_us = 40'000.0;
  const auto camera = MakeCamera(config, kClock);
  std::vector<double> errors_ms;
  for (int i = 0; i < 60; ++i) {
    const auto frame = NextFrame(*camera);
    ASSERT_TRUE(frame);
    if (i < 20) continue;
    const std::lock_guard lock(mutex);
    const auto after = shown_ns.lower_bound(frame->sensed_at.ns);
    ASSERT_NE(after, shown_ns.begin());
    std::int64_t nearest_ns = frame->sensed_at.ns - *std::prev(after);
    if (after != shown_ns.end()) nearest_ns = std::min(nearest_ns, *after - frame->sensed_at.ns);
    errors_ms.push_back(static_cast<double>(nearest_ns) * 1e-6);
  }
  std::nth_element(errors_ms.begin(), errors_ms.begin() + 20, errors_ms.end());
  // Half an exposure is 20 ms, and the nearest exposure of another frame 50 ms away: a stamp of the
  // exposure's begin or end would show. What is left is this computer's delay in sending.
  EXPECT_LT(errors_ms[20], 8.0);
}

}  // namespace
}  // namespace tbm::test
