#include "devices/camera/camera_clock.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace tbm {
namespace {

constexpr std::int64_t kMs = 1'000'000;

using Steady = CameraClock::SteadyTime;
Steady At(std::int64_t ns) { return Steady(std::chrono::nanoseconds(ns)); }
std::int64_t Ns(Steady at) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(at.time_since_epoch()).count();
}

// A camera powered up at an odd moment, its crystal off, behind a network with jitter.
struct Camera {
  double drift_ppm = 0.0;
  std::int64_t smallest_delay_ns = kMs / 10;
  std::int64_t offset_ns = 1'789'999'123'456'789;

  std::int64_t Stamp(std::int64_t true_ns) const {
    const auto since = static_cast<double>(true_ns - offset_ns);
    return static_cast<std::int64_t>(since * (1.0 + drift_ppm * 1e-6));
  }
};

std::int64_t Delay(test::Random& random) {
  return static_cast<std::int64_t>(-std::log(1.0 - random.Unit()) * 3.0 * kMs);
}

TEST(CameraClock, TakesTheJitterOutAndStaysWithinItsBoundUnderDrift) {
  for (const double drift_ppm : {-100.0, 0.0, 100.0}) {
    test::Random random("CameraClock.jitter");
    const Camera camera{drift_ppm};
    CameraClock clock;
    double worst_ms = 0.0;
    for (int i = 0; i < 3000; ++i) {
      const std::int64_t true_ns = camera.offset_ns + 1000 * kMs + i * 100 * kMs;
      const Steady received = At(true_ns + camera.smallest_delay_ns + Delay(random));
      const Steady mapped = clock.ToHost(camera.Stamp(true_ns), received);
      EXPECT_LE(mapped, received);
      if (i < 64) continue;
      const double error_ms =
          static_cast<double>(Ns(mapped) - true_ns - camera.smallest_delay_ns) / kMs;
      worst_ms = std::max(worst_ms, std::abs(error_ms));
    }
    // 0.64 ms of drift within the window, and the smallest of 64 delays of 3 ms mean: 0.05 ms
    // typically, 0.3 ms with a probability of 2e-3.
    EXPECT_LT(worst_ms, 1.0) << drift_ppm;
  }
}

TEST(CameraClock, FollowsAStampSetForwardAtOnce) {
  CameraClock clock;
  for (int i = 0; i < 100; ++i) clock.ToHost(i * 100 * kMs, At(5000 * kMs + i * 100 * kMs));
  EXPECT_EQ(Ns(clock.ToHost(10'000 * kMs, At(12'000 * kMs))), 12'000 * kMs);
}

TEST(CameraClock, FollowsACameraThatStartsAnewAfterFiveFrames) {
  CameraClock clock;
  const auto frame = [&](int i, std::int64_t offset_ns) {
    return Ns(clock.ToHost(i * 100 * kMs, At(offset_ns + i * 100 * kMs))) - i * 100 * kMs;
  };
  for (int i = 0; i < 100; ++i) frame(i, 5000 * kMs);
  for (int i = 100; i < 104; ++i) EXPECT_EQ(frame(i, 9000 * kMs), 5000 * kMs);
  EXPECT_EQ(frame(104, 9000 * kMs), 9000 * kMs);
  EXPECT_EQ(frame(105, 9000 * kMs), 9000 * kMs);
}

TEST(CameraClock, OneLatePacketIsNoClockStep) {
  CameraClock clock;
  for (int i = 0; i < 100; ++i) {
    const std::int64_t delay_ns = i % 7 == 6 ? 300 * kMs : 0;
    const Steady mapped = clock.ToHost(i * 100 * kMs, At(5000 * kMs + i * 100 * kMs + delay_ns));
    EXPECT_EQ(Ns(mapped), 5000 * kMs + i * 100 * kMs);
  }
}

}  // namespace
}  // namespace tbm
