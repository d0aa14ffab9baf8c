#include "pose/app/frame_mailbox.h"

#include <array>
#include <atomic>
#include <thread>

#include <gtest/gtest.h>

#include "pose/app/tilt_inbox.h"

namespace tbm {
namespace {

using std::chrono::milliseconds;

struct Picture {
  std::vector<std::uint8_t> pixels;
  Frame frame;
  Picture(std::uint64_t number, int stride) : pixels(static_cast<std::size_t>(stride) * 4) {
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      pixels[i] = static_cast<std::uint8_t>(number + i % static_cast<std::size_t>(stride));
    }
    frame.image = {pixels.data(), 6, 4, stride, 1, 255};
    frame.frame_number = number;
  }
};

TEST(FrameMailbox, TheNewestWinsAndDropsAreCounted) {
  FrameMailbox mailbox;
  for (const std::uint64_t number : {1u, 2u, 3u}) mailbox.Put(Picture(number, 8).frame);
  const OwnedFrame* frame = mailbox.Take(milliseconds(0));
  ASSERT_NE(frame, nullptr);
  EXPECT_EQ(frame->frame.frame_number, 3u);
  EXPECT_EQ(mailbox.dropped(), 2u);
  EXPECT_EQ(mailbox.Take(milliseconds(0)), nullptr);
}

TEST(FrameMailbox, KeepsPixelsWithoutThePadding) {
  FrameMailbox mailbox;
  mailbox.Put(Picture(7, 16).frame);
  const OwnedFrame* frame = mailbox.Take(milliseconds(0));
  ASSERT_NE(frame, nullptr);
  EXPECT_EQ(frame->frame.image.stride_bytes, 6);
  for (std::size_t row = 0; row < 4; ++row) {
    for (std::size_t column = 0; column < 6; ++column) {
      EXPECT_EQ(frame->pixels[row * 6 + column], 7 + column);
    }
  }
}

// The frame that is being solved is never written to.
TEST(FrameMailbox, TheFrameInUseStaysWhileNewOnesCome) {
  FrameMailbox mailbox;
  mailbox.Put(Picture(1, 8).frame);
  const OwnedFrame* frame = mailbox.Take(milliseconds(0));
  ASSERT_NE(frame, nullptr);
  std::thread grabber([&] {
    for (std::uint64_t number = 2; number < 500; ++number) mailbox.Put(Picture(number, 8).frame);
  });
  for (int look = 0; look < 500; ++look) ASSERT_EQ(frame->pixels[0], 1);
  grabber.join();
  EXPECT_EQ(mailbox.Take(milliseconds(0))->frame.frame_number, 499u);
}

// Frames are whole and get newer, and every one is either taken or counted.
TEST(FrameMailbox, EveryFrameIsTakenWholeOrCounted) {
  constexpr std::uint64_t kFrames = 3000;
  FrameMailbox mailbox;
  std::thread grabber([&] {
    for (std::uint64_t number = 1; number <= kFrames; ++number)
      mailbox.Put(Picture(number, 8).frame);
  });
  std::uint64_t taken = 0;
  for (std::uint64_t last = 0; last < kFrames;) {
    const OwnedFrame* const frame = mailbox.Take(milliseconds(1000));
    ASSERT_NE(frame, nullptr);
    ASSERT_GT(frame->frame.frame_number, last);
    last = frame->frame.frame_number;
    ++taken;
    const auto first = static_cast<std::uint8_t>(last);
    for (std::size_t row = 0; row < 4; ++row) ASSERT_EQ(frame->pixels[row * 6], first);
    (void)mailbox.dropped();
  }
  grabber.join();
  EXPECT_EQ(taken + mailbox.dropped(), kFrames);
}

TEST(TiltInbox, WaitsUntilBothInclinometersAreYoungerThanTheFrame) {
  TiltInbox inbox;
  inbox.Put({{100}, TiltSensor::kTarget, {0.1, 0.2}});
  std::thread late([&] {
    std::this_thread::sleep_for(milliseconds(30));
    inbox.Put({{100}, TiltSensor::kCamera, {0.3, 0.4}});
  });
  TiltInbox::Readings readings;
  inbox.TakeAll({100}, std::chrono::seconds(10), &readings);
  late.join();
  ASSERT_EQ(readings.size(), 2u);
  EXPECT_EQ(readings[1].sensor, TiltSensor::kCamera);
}

TEST(TiltInbox, GivesUpWaitingForASilentOne) {
  TiltInbox inbox;
  inbox.Put({{100}, TiltSensor::kTarget, {0.1, 0.2}});
  TiltInbox::Readings readings;
  inbox.TakeAll({100}, milliseconds(5), &readings);
  EXPECT_EQ(readings.size(), 1u);
}

TEST(TiltInbox, TheOldestGivesWayAndIsCounted) {
  TiltInbox inbox;
  for (int i = 0; i < 300; ++i) inbox.Put({{i}, TiltSensor::kTarget, {}});
  TiltInbox::Readings readings;
  inbox.TakeAll({0}, milliseconds(0), &readings);
  ASSERT_EQ(readings.size(), TiltInbox::kCapacity);
  EXPECT_EQ(readings[0].sensed_at.ns, 300 - static_cast<int>(TiltInbox::kCapacity));
  EXPECT_EQ(inbox.dropped(), 300u - TiltInbox::kCapacity);
}

TEST(TiltInbox, EveryReadingOfBothInclinometersIsTakenInOrderOrCounted) {
  constexpr int kReadings = 5000;
  TiltInbox inbox;
  std::atomic<int> running = 2;
  const auto read = [&](TiltSensor sensor) {
    for (int i = 1; i <= kReadings; ++i) inbox.Put({{i}, sensor, {1e-3 * i, -1e-3 * i}});
    --running;
  };
  std::thread target(read, TiltSensor::kTarget);
  std::thread camera(read, TiltSensor::kCamera);
  std::array<std::int64_t, 2> last{};
  std::size_t taken = 0;
  TiltInbox::Readings readings;
  for (bool is_over = false; !is_over;) {
    is_over = running == 0;  // what comes below is then the rest
    inbox.TakeAll({kReadings}, milliseconds(0), &readings);
    for (const TiltReading& reading : readings) {
      std::int64_t& before = last[static_cast<std::size_t>(reading.sensor)];
      EXPECT_GT(reading.sensed_at.ns, before);
      before = reading.sensed_at.ns;
      EXPECT_EQ(reading.inclination.beta_rad, -reading.inclination.gamma_rad);
    }
    taken += readings.size();
  }
  target.join();
  camera.join();
  EXPECT_EQ(taken + inbox.dropped(), 2u * kReadings);
}

}  // namespace
}  // namespace tbm
