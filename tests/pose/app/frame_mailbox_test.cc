#include "pose/app/frame_mailbox.h"

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

}  // namespace
}  // namespace tbm
