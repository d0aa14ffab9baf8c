#include "pose/app/recorder.h"

#include <algorithm>
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>

#include "devices/replay/run_reader.h"
#include "tests/support/random.h"
#include "tests/support/recorded_run.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using std::chrono::milliseconds;

constexpr int kWidth = 1280;
constexpr int kHeight = 1024;

RecorderOptions Options(const std::string& folder) {
  RecorderOptions options;
  options.folder = folder;
  options.rig_yaml = test::ReadText(TBM_SOURCE_DIR "/pose/app/example/rig.yaml");
  options.free_min_bytes = 0;
  return options;
}

OwnedFrame FrameAt(std::int64_t ns, const std::vector<std::uint8_t>& pixels) {
  Frame frame;
  frame.sensed_at = {ns};
  frame.image = {pixels.data(), kWidth, kHeight, kWidth, 1, 255};
  OwnedFrame owned;
  owned.CopyFrom(frame);
  return owned;
}

// Noise, which no codec makes small: as PNG it is written slower than frames come every 2 ms.
std::vector<std::uint8_t> Noise() {
  test::Random random("Recorder.Noise");
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(kWidth) * kHeight);
  for (std::uint8_t& pixel : pixels) pixel = static_cast<std::uint8_t>(255.0 * random.Unit());
  return pixels;
}

// What a run holds has no gap, and what no run holds is counted.
TEST(Recorder, ADiskThatIsTooSlowLosesCountedFramesBetweenRunsAndNeverInsideOne) {
  constexpr int kFrames = 120;
  const test::TempFolder folder;
  const std::vector<std::uint8_t> pixels = Noise();
  RecorderOptions options = Options(folder / "runs");
  options.png = true;
  std::uint64_t dropped = 0;
  {
    Recorder recorder(options);
    OwnedFrame frame = FrameAt(0, pixels);
    for (int i = 1; i <= kFrames; ++i) {
      frame.frame.sensed_at = {i};
      if (recorder.WantsNewRun()) recorder.Begin({std::int64_t{i} * 1'000'000'000}, "");
      recorder.Add(frame, PoseReason::kNone);
      std::this_thread::sleep_for(milliseconds(2));
    }
    dropped = recorder.status().frames_dropped;
  }
  std::size_t recorded = 0;
  int runs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "runs")) {
    const auto run = ReadRun(entry.path());
    ASSERT_TRUE(run);
    ++runs;
    recorded += run->frames.size();
    for (std::size_t i = 1; i < run->frames.size(); ++i) {
      EXPECT_EQ(run->frames[i].sensed_at.ns, run->frames[i - 1].sensed_at.ns + 1) << entry.path();
    }
  }
  EXPECT_GE(dropped, 1u);
  EXPECT_GE(runs, 2);
  EXPECT_EQ(recorded + dropped, static_cast<std::size_t>(kFrames));
}

// From a gap on nothing is taken until the next run begins, however late that is.
TEST(Recorder, AfterAGapItWaitsForTheNextRun) {
  const test::TempFolder folder;
  const std::vector<std::uint8_t> pixels = Noise();
  RecorderOptions options = Options(folder / "runs");
  options.png = true;
  {
    Recorder recorder(options);
    OwnedFrame frame = FrameAt(0, pixels);
    for (int i = 1; i <= 120; ++i) {
      frame.frame.sensed_at = {i};
      if (i % 60 == 1 && recorder.WantsNewRun()) {
        recorder.Begin({std::int64_t{i} * 1'000'000'000}, "");
      }
      recorder.Add(frame, PoseReason::kNone);
      std::this_thread::sleep_for(milliseconds(2));
    }
    EXPECT_GE(recorder.status().frames_dropped, 1u);
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder / "runs")) {
    const auto run = ReadRun(entry.path());
    ASSERT_TRUE(run);
    for (std::size_t i = 1; i < run->frames.size(); ++i) {
      EXPECT_EQ(run->frames[i].sensed_at.ns, run->frames[i - 1].sensed_at.ns + 1) << entry.path();
    }
  }
}

// Each attempt makes the solver forget what its monitor has gathered.
TEST(Recorder, AFolderThatCannotBeWrittenIsNotTriedAgainWithEveryFrame) {
  const test::TempFolder folder;
  test::WriteText(folder / "runs", "a file where the folder should be");
  const std::vector<std::uint8_t> pixels(static_cast<std::size_t>(kWidth) * kHeight);
  const OwnedFrame frame = FrameAt(1, pixels);
  Recorder recorder(Options(folder / "runs"));
  int begun = 0;
  for (int i = 0; i < 20; ++i) {
    if (recorder.WantsNewRun()) {
      recorder.Begin({1'000'000'000}, "");
      ++begun;
    }
    recorder.Add(frame, PoseReason::kNone);
    std::this_thread::sleep_for(milliseconds(10));
  }
  EXPECT_EQ(begun, 1);
  EXPECT_EQ(recorder.status().writer.state, RecorderState::kFailed);
  EXPECT_GE(recorder.status().writer.frames_lost, 1);
}

}  // namespace
}  // namespace tbm
