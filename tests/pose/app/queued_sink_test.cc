#include "pose/app/queued_sink.h"

#include <algorithm>
#include <atomic>
#include <future>
#include <thread>

#include <gtest/gtest.h>

namespace tbm {
namespace {

// Keeps sample numbers; can be made to wait in the middle of a write.
class SlowSink final : public MessageSink {
 public:
  void Publish(const dds::FrameFeatures& message) override {
    features.push_back(message.frame_number);
  }
  void Publish(const dds::RelativePose& message) override {
    if (is_blocked) gate.get_future().wait();
    is_blocked = false;
    poses.push_back(message.sample_number);
  }
  void Publish(const dds::TiltReading&) override {}
  void Publish(const dds::DeviceHealth&) override {}
  void Publish(const dds::Event&) override {}

  std::vector<std::uint64_t> poses;
  std::vector<std::uint64_t> features;
  std::atomic<bool> is_blocked{false};
  std::promise<void> gate;
};

TEST(QueuedSink, HandsEverythingOnInOrderBeforeItEnds) {
  SlowSink slow;
  {
    QueuedSink queued(slow);
    for (std::uint64_t i = 1; i <= 5; ++i) {
      dds::RelativePose pose;
      pose.sample_number = i;
      queued.Publish(pose);
      dds::FrameFeatures features;
      features.frame_number = i;
      queued.Publish(features);
    }
  }
  EXPECT_EQ(slow.poses, (std::vector<std::uint64_t>{1, 2, 3, 4, 5}));
  EXPECT_EQ(slow.features, (std::vector<std::uint64_t>{1, 2, 3, 4, 5}));
}

TEST(QueuedSink, NeverWaitsForASlowWriteAndKeepsTheNewest) {
  SlowSink slow;
  slow.is_blocked = true;
  {
    QueuedSink queued(slow);
    for (std::uint64_t i = 1; i <= 100; ++i) {
      dds::RelativePose pose;
      pose.sample_number = i;
      queued.Publish(pose);
    }
    EXPECT_GE(queued.dropped(), 90u);
    slow.gate.set_value();
  }
  EXPECT_EQ(slow.poses.back(), 100u);
  EXPECT_LE(slow.poses.size(), 10u);
}

// Two threads send while the queue's own thread hands on: every message arrives once and in order,
// or is counted as dropped.
TEST(QueuedSink, LosesNothingUncountedWhenTwoThreadsSend) {
  constexpr std::uint64_t kMessages = 5000;
  SlowSink slow;
  std::uint64_t dropped = 0;
  {
    QueuedSink queued(slow);
    std::thread poses([&] {
      dds::RelativePose pose;
      for (pose.sample_number = 1; pose.sample_number <= kMessages; ++pose.sample_number) {
        queued.Publish(pose);
      }
    });
    dds::FrameFeatures features;
    for (features.frame_number = 1; features.frame_number <= kMessages; ++features.frame_number) {
      queued.Publish(features);
      if (features.frame_number % 64 == 0) (void)queued.dropped();
    }
    poses.join();
    dropped = queued.dropped();
  }
  EXPECT_EQ(slow.poses.size() + slow.features.size() + dropped, 2 * kMessages);
  for (const auto* numbers : {&slow.poses, &slow.features}) {
    EXPECT_EQ(numbers->back(), kMessages);
    EXPECT_TRUE(std::is_sorted(numbers->begin(), numbers->end()));
    EXPECT_EQ(std::adjacent_find(numbers->begin(), numbers->end()), numbers->end());
  }
}

}  // namespace
}  // namespace tbm
