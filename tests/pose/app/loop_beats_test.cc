#include "pose/app/loop_beats.h"

#include <gtest/gtest.h>

namespace tbm {
namespace {

using namespace std::chrono_literals;
constexpr LoopBeats::SteadyTime kStart{1h};

TEST(LoopBeats, OneLoopThatHangsIsEnough) {
  LoopBeats beats;
  EXPECT_TRUE(beats.AllWithin(10s, kStart)) << "nothing has begun";
  beats.Beat(LoopBeats::kGrabber, kStart);
  beats.Beat(LoopBeats::kSolver, kStart);
  EXPECT_TRUE(beats.AllWithin(10s, kStart + 10s));
  beats.Beat(LoopBeats::kSolver, kStart + 11s);
  EXPECT_FALSE(beats.AllWithin(10s, kStart + 11s)) << "the grabber hangs";
  beats.Beat(LoopBeats::kGrabber, kStart + 12s);
  EXPECT_TRUE(beats.AllWithin(10s, kStart + 12s));
}

TEST(LoopBeats, ALoopThatHasEndedIsNotMissed) {
  LoopBeats beats;
  beats.Beat(LoopBeats::kGrabber, kStart);
  beats.End(LoopBeats::kGrabber);
  EXPECT_TRUE(beats.AllWithin(10s, kStart + 1h));
}

}  // namespace
}  // namespace tbm
