#include "devices/camera/frame_id.h"

#include <gtest/gtest.h>

namespace tbm {
namespace {

TEST(FrameIdCounter, CountsUpByOneWithoutLoss) {
  FrameIdCounter counter;
  EXPECT_EQ(counter.Count(7).frame_number, 1u);
  const auto step = counter.Count(8);
  EXPECT_EQ(step.frame_number, 2u);
  EXPECT_EQ(step.lost, 0u);
}

TEST(FrameIdCounter, WrapsFrom65535To1WithoutLoss) {
  FrameIdCounter counter;
  counter.Count(65534);
  EXPECT_EQ(counter.Count(65535).lost, 0u);
  const auto step = counter.Count(1);
  EXPECT_EQ(step.lost, 0u);
  EXPECT_EQ(step.frame_number, 3u);
}

TEST(FrameIdCounter, CountsTheLossAcrossTheWrap) {
  FrameIdCounter counter;
  counter.Count(65533);
  const auto step = counter.Count(2);  // 65534, 65535 and 1 are missing
  EXPECT_EQ(step.lost, 3u);
  EXPECT_EQ(step.frame_number, 5u);
}

TEST(FrameIdCounter, EveryGapIsTheNumberOfIdsBetween) {
  for (std::uint64_t gap : {0u, 1u, 14u, 1000u, 32000u}) {
    for (std::uint64_t start : {1u, 30000u, 65000u, 65535u}) {
      FrameIdCounter counter;
      counter.Count(start);
      std::uint64_t id = start;
      for (std::uint64_t i = 0; i <= gap; ++i) id = id == 65535 ? 1 : id + 1;
      EXPECT_EQ(counter.Count(id).lost, gap) << start;
    }
  }
}

TEST(FrameIdCounter, ARepeatedOrEarlierFrameIsLateAndMovesNothing) {
  FrameIdCounter counter;
  counter.Count(10);
  counter.Count(12);
  EXPECT_TRUE(counter.Count(12).is_late);
  EXPECT_TRUE(counter.Count(11).is_late);
  const auto step = counter.Count(13);
  EXPECT_FALSE(step.is_late);
  EXPECT_EQ(step.frame_number, 4u);
}

TEST(FrameIdCounter, AfterAReconnectNothingIsCalledLost) {
  FrameIdCounter counter;
  counter.Count(100);
  counter.Restart();
  const auto step = counter.Count(1);
  EXPECT_EQ(step.lost, 0u);
  EXPECT_EQ(step.frame_number, 2u);
  EXPECT_FALSE(step.is_late);
}

TEST(FrameIdCounter, LongIdsDoNotWrap) {
  FrameIdCounter counter;
  counter.Count(65535);
  EXPECT_EQ(counter.Count(65536).lost, 0u);
  EXPECT_EQ(counter.Count(65540).lost, 3u);
}

}  // namespace
}  // namespace tbm
