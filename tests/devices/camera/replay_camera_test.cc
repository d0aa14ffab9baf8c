#include "devices/camera/replay_camera.h"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/devices/camera/small_machine.h"
#include "tests/support/fake_clock.h"
#include "tests/support/temp_folder.h"

namespace tbm::test {
namespace {

using ::testing::HasSubstr;

class ReplayCameraTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(folder_ / "frames");
    Write("rig.yaml", SmallRigYaml());
    Write("tilt.csv", "stamp_ns,sensor,beta_deg,gamma_deg\n1000000000,target,0.1,0.2\n");
    Write("frames/a.pgm", Pgm(320, 256, 17));
    Write("frames/cut.pgm", Pgm(320, 256, 17).substr(0, 1000));
    Write("frames/small.pgm", Pgm(32, 25, 17));
    Write("frames/b.pgm", Pgm(320, 256, 99));
    Write("frames.csv",
          "stamp_ns,file\n"
          "1000000000,frames/a.pgm\n"
          "1100000000,frames/absent.pgm\n"
          "1200000000,frames/cut.pgm\n"
          "1300000000,frames/small.pgm\n"
          "1400000000,frames/b.pgm\n");
  }
  void Write(const std::string& name, const std::string& content) const {
    WriteText(folder_ / name, content);
  }
  static std::string Pgm(int width, int height, char value) {
    return "P5\n" + std::to_string(width) + " " + std::to_string(height) + "\n255\n" +
           std::string(static_cast<std::size_t>(width * height), value);
  }
  CameraConfig Config(bool real_time) const {
    CameraConfig config;
    config.driver = CameraDriver::kReplay;
    config.run_folder = folder_.path();
    config.real_time = real_time;
    return config;
  }

  TempFolder folder_;
  FakeClock clock_;
};

TEST_F(ReplayCameraTest, GivesEveryRowInOrderWhateverHappenedToItsImage) {
  const auto camera = MakeCamera(Config(false), clock_);
  const std::vector<FrameFault> faults = {FrameFault::kNone,
                                          FrameFault::kFileMissing,
                                          FrameFault::kFileUnreadable,
                                          FrameFault::kFileSize,
                                          FrameFault::kNone};
  for (std::size_t i = 0; i < faults.size(); ++i) {
    const auto frame = camera->WaitFrame(Duration(0));
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->fault, faults[i]) << i;
    EXPECT_EQ(frame->image.pixels != nullptr, frame->complete()) << i;
    EXPECT_EQ(frame->sensed_at.ns, 1'000'000'000 + static_cast<std::int64_t>(i) * 100'000'000);
    EXPECT_EQ(frame->frame_number, i + 1);
    if (i == 0) {
      EXPECT_EQ(*static_cast<const std::uint8_t*>(frame->image.pixels), 17);
    }
    if (i == 1) {
      EXPECT_THAT(camera->Health().detail, HasSubstr("absent.pgm"));
    }
    if (i == 4) {
      EXPECT_EQ(*static_cast<const std::uint8_t*>(frame->image.pixels), 99);
    }
  }
  EXPECT_EQ(camera->WaitFrame(Duration(0)).error(), CameraFailure::kEndOfRun);
  EXPECT_EQ(camera->WaitFrame(Duration(0)).error(), CameraFailure::kEndOfRun);
  EXPECT_EQ(camera->Health().incomplete, 3u);
}

TEST_F(ReplayCameraTest, InRealTimeAFrameComesWhenItIsDue) {
  const auto camera = MakeCamera(Config(true), clock_);
  ASSERT_TRUE(camera->WaitFrame(Duration(0)));
  EXPECT_EQ(camera->WaitFrame(Duration(0)).error(), CameraFailure::kNoFrameInTime);
  clock_.Advance(std::chrono::milliseconds(99));
  EXPECT_EQ(camera->WaitFrame(Duration(0)).error(), CameraFailure::kNoFrameInTime);
  clock_.Advance(std::chrono::milliseconds(1));
  EXPECT_TRUE(camera->WaitFrame(Duration(0)));
}

TEST_F(ReplayCameraTest, ARunThatCannotBeReadSaysWhichFileAndStaysSo) {
  Write("frames.csv", "stamp_ns\n1000000000\n");
  const auto camera = MakeCamera(Config(false), clock_);
  EXPECT_EQ(camera->WaitFrame(Duration(0)).error(), CameraFailure::kBadRun);
  EXPECT_EQ(camera->WaitFrame(Duration(0)).error(), CameraFailure::kBadRun);
  EXPECT_THAT(camera->Health().detail, HasSubstr("frames.csv"));
  EXPECT_EQ(camera->Health().state, CameraState::kClosed);
}

}  // namespace
}  // namespace tbm::test
