#include "devices/replay/run_writer.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "devices/replay/image_file.h"
#include "devices/replay/run_reader.h"
#include "pose/base/angle.h"
#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;
using test::ReadText;
using test::TempFolder;
using test::WriteText;
using ::testing::SizeIs;

constexpr Timestamp kStart{1'790'000'000'000'000'000};  // 2026-09-21 14:13:20 UTC
constexpr ImageSize kSize{64, 32};

class RunWriterTest : public ::testing::Test {
 protected:
  RecorderOptions Options() {
    RecorderOptions options;
    options.folder = folder_ / "recordings";
    options.rig_yaml = SmallRig();
    options.free_min_bytes = 0;
    return options;
  }

  // The rig of the bad-file tests, with a camera of a few pixels.
  static std::string SmallRig() {
    std::string text = ReadText(TBM_SOURCE_DIR "/tests/data/config_bad/rig_good.yaml");
    for (const auto& [from, to] :
         {std::pair("1280", "64"), {"1024", "32"}, {"640.1", "32.0"}, {"511.3", "16.0"}}) {
      text.replace(text.find(from), std::string(from).size(), to);
    }
    return text;
  }

  OwnedImage Image() {
    OwnedImage image{kSize, 1, 255, std::vector<std::uint8_t>(64 * 32)};
    for (auto& byte : image.bytes) byte = static_cast<std::uint8_t>(random_.Bits());
    return image;
  }
  TiltReading Tilt(std::int64_t at_ms, TiltSensor sensor) {
    return {Timestamp{kStart.ns + at_ms * 1'000'000},
            sensor,
            {DegToRad(random_.Normal()), DegToRad(random_.Normal())}};
  }

  // Frames 200 ms apart, each with two readings before it.
  void Record(RunWriter& writer, int frames, std::int64_t from_ms = 0) {
    for (int i = 0; i < frames; ++i) {
      const std::int64_t at_ms = from_ms + i * 200;
      tilts_.push_back(Tilt(at_ms - 20, TiltSensor::kTarget));
      writer.AddTilt(tilts_.back());
      tilts_.push_back(Tilt(at_ms - 10, TiltSensor::kCamera));
      writer.AddTilt(tilts_.back());
      images_.push_back(Image());
      writer.AddFrame(Timestamp{kStart.ns + at_ms * 1'000'000}, images_.back().View());
    }
  }

  std::vector<std::string> Runs() {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_ / "recordings")) {
      names.push_back(entry.path().filename().string());
    }
    std::sort(names.begin(), names.end());
    return names;
  }

  TempFolder folder_;
  test::Random random_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  std::vector<OwnedImage> images_;
  std::vector<TiltReading> tilts_;
};

TEST_F(RunWriterTest, WhatIsRecordedReplaysBitForBit) {
  for (const bool png : {false, true}) {
    RecorderOptions options = Options();
    options.png = png;
    options.folder = folder_ / (png ? "png" : "pgm");
    images_.clear();
    tilts_.clear();
    RunWriter writer(options);
    EXPECT_TRUE(writer.WantsNewRun());
    ASSERT_TRUE(writer.Begin(kStart, "state of the solver\n"));
    Record(writer, 5);
    tilts_.push_back(Tilt(1100, TiltSensor::kTarget));
    writer.AddTilt(tilts_.back());
    const std::string folder = writer.status().run;
    EXPECT_EQ(fs::path(folder).filename(), "run_20260921_141320");
    writer.Close();

    const auto run = ReadRun(folder);
    ASSERT_TRUE(run.has_value()) << run.error()[0].Text();
    EXPECT_THAT(run->warnings, SizeIs(0));
    EXPECT_EQ(run->solver_state, "state of the solver\n");
    EXPECT_EQ(ReadText(folder + "/rig.yaml"), options.rig_yaml);
    ASSERT_EQ(run->frames.size(), 5u);
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_EQ(run->frames[i].sensed_at.ns,
                kStart.ns + static_cast<std::int64_t>(i) * 200'000'000);
      EXPECT_EQ(run->frames[i].tilts_known, 2 * (i + 1));
      const auto image = ReadFrame(*run, i);
      ASSERT_TRUE(image.has_value());
      EXPECT_EQ(image->bytes, images_[i].bytes);
    }
    ASSERT_EQ(run->tilts.size(), tilts_.size());
    for (std::size_t i = 0; i < tilts_.size(); ++i) {
      EXPECT_EQ(run->tilts[i].sensed_at, tilts_[i].sensed_at);
      EXPECT_EQ(run->tilts[i].sensor, tilts_[i].sensor);
      EXPECT_EQ(run->tilts[i].inclination.beta_rad, tilts_[i].inclination.beta_rad);
      EXPECT_EQ(run->tilts[i].inclination.gamma_rad, tilts_[i].inclination.gamma_rad);
    }
  }
}

TEST_F(RunWriterTest, AnglesFromDegreesSurviveTheFile) {
  for (int i = 0; i < 100'000; ++i) {
    const double angle_rad = DegToRad(random_.Normal(i % 2 == 0 ? 1.0 : 40.0));
    ASSERT_EQ(DegToRad(DegThatReadsAs(angle_rad)), angle_rad);
  }
  EXPECT_TRUE(std::isnan(DegThatReadsAs(std::nan(""))));
  EXPECT_EQ(DegThatReadsAs(0.0), 0.0);
}

TEST_F(RunWriterTest, ReadingsThatSayNothingAreRecordedAsSuch) {
  RunWriter writer(Options());
  ASSERT_TRUE(writer.Begin(kStart, ""));
  writer.AddTilt({kStart, TiltSensor::kTarget, {std::nan(""), DegToRad(400.0)}});
  writer.Close();
  const auto run = ReadRun(writer.status().run);
  ASSERT_TRUE(run.has_value());
  ASSERT_THAT(run->tilts, SizeIs(1));
  EXPECT_TRUE(std::isnan(run->tilts[0].inclination.beta_rad));
  EXPECT_EQ(run->tilts[0].inclination.gamma_rad, DegToRad(400.0));
}

TEST_F(RunWriterTest, FaultyFramesReplayWithTheirReason) {
  RunWriter writer(Options());
  ASSERT_TRUE(writer.Begin(kStart, ""));
  EXPECT_TRUE(writer.AddFaultyFrame(kStart, PoseReason::kFrameMissing));
  EXPECT_TRUE(writer.AddFaultyFrame(kStart + Duration(1), PoseReason::kFrameUnreadable));
  writer.Close();
  const auto run = ReadRun(writer.status().run);
  ASSERT_TRUE(run.has_value());
  EXPECT_EQ(ReasonOf(ReadFrame(*run, 0).error().failure), PoseReason::kFrameMissing);
  EXPECT_EQ(ReasonOf(ReadFrame(*run, 1).error().failure), PoseReason::kFrameUnreadable);
}

TEST_F(RunWriterTest, ANewRunIsWantedAfterSoManyFramesOrMinutes) {
  RecorderOptions options = Options();
  options.run_max_frames = 3;
  RunWriter by_frames(options);
  ASSERT_TRUE(by_frames.Begin(kStart, ""));
  Record(by_frames, 2);
  EXPECT_FALSE(by_frames.WantsNewRun());
  Record(by_frames, 1, 400);
  EXPECT_TRUE(by_frames.WantsNewRun());

  options = Options();
  options.run_max_duration = std::chrono::milliseconds(400);
  RunWriter by_time(options);
  ASSERT_TRUE(by_time.Begin(kStart, ""));
  Record(by_time, 2);
  EXPECT_FALSE(by_time.WantsNewRun());
  Record(by_time, 1, 400);
  EXPECT_TRUE(by_time.WantsNewRun());
}

TEST_F(RunWriterTest, TheOldestWholeRunsGoWhenTheRoomIsUsedUp) {
  RecorderOptions options = Options();
  options.total_max_bytes = 60'000;  // a frame has 2061 bytes
  fs::create_directories(options.folder + "/not_a_run");
  WriteText(options.folder + "/not_a_run/frames.csv", std::string(200'000, 'x'));
  RunWriter writer(options);
  int begun = 0;
  for (int i = 0; i < 100; ++i) {
    if (writer.WantsNewRun()) {
      ASSERT_TRUE(writer.Begin(kStart + std::chrono::seconds(i), ""));
      ++begun;
    }
    Record(writer, 1, i * 200);
    EXPECT_LE(writer.status().total_bytes, 60'000);
  }
  writer.Close();
  EXPECT_EQ(writer.status().frames_recorded, 100);
  EXPECT_GT(writer.status().runs_deleted, 5);
  std::vector<std::string> runs = Runs();
  EXPECT_EQ(std::erase(runs, "not_a_run"), 1u) << "only runs of its own making are deleted";
  EXPECT_EQ(static_cast<std::int64_t>(runs.size()), begun - writer.status().runs_deleted);
  std::int64_t bytes = 0;
  for (const std::string& run : runs) {
    const auto read = ReadRun(options.folder + "/" + run);
    ASSERT_TRUE(read.has_value()) << run;
    for (std::size_t i = 0; i < read->frames.size(); ++i)
      EXPECT_TRUE(ReadFrame(*read, i).has_value());
    for (const auto& entry : fs::recursive_directory_iterator(options.folder + "/" + run)) {
      if (entry.is_regular_file()) bytes += static_cast<std::int64_t>(entry.file_size());
    }
  }
  EXPECT_EQ(bytes, writer.status().total_bytes);
  const auto newest = ReadRun(options.folder + "/" + runs.back());
  EXPECT_EQ(newest->frames.back().sensed_at.ns, kStart.ns + 99 * 200'000'000LL);
}

TEST_F(RunWriterTest, TwoRunsInOneSecondHaveTwoNames) {
  RunWriter writer(Options());
  ASSERT_TRUE(writer.Begin(kStart, ""));
  ASSERT_TRUE(writer.Begin(kStart, ""));
  writer.Close();
  EXPECT_THAT(Runs(), ::testing::ElementsAre("run_20260921_141320", "run_20260921_141320_2"));
}

TEST_F(RunWriterTest, LeftoversOfAPowerCutAreSweptAway) {
  const RecorderOptions options = Options();
  fs::create_directories(options.folder + "/.new_run_20260921_141300/frames");
  fs::create_directories(options.folder + "/.deleting_run_20260921_141200/frames");
  RunWriter writer(options);
  ASSERT_TRUE(writer.Begin(kStart, ""));
  writer.Close();
  EXPECT_THAT(Runs(), ::testing::ElementsAre("run_20260921_141320"));
}

// A power cut leaves each CSV whole up to some byte. Whatever the byte, what stands before is read,
// and every frame that is read has its pixels.
TEST_F(RunWriterTest, CutAtEveryByteWhatWasWrittenBeforeStaysReadable) {
  RunWriter writer(Options());
  ASSERT_TRUE(writer.Begin(kStart, ""));
  Record(writer, 4);
  writer.Close();
  const std::string run = writer.status().run;
  for (const std::string name : {"frames.csv", "tilt.csv"}) {
    const std::string whole = ReadText(run + "/" + name);
    const std::size_t header_end = whole.find('\n') + 1;
    for (std::size_t size = header_end; size < whole.size(); ++size) {
      WriteText(run + "/" + name, whole.substr(0, size));
      const auto read = ReadRun(run);
      ASSERT_TRUE(read.has_value()) << name << " cut to " << size << ": " << read.error()[0].Text();
      const auto whole_rows = std::count(whole.begin() + static_cast<std::ptrdiff_t>(header_end),
                                         whole.begin() + static_cast<std::ptrdiff_t>(size),
                                         '\n');
      const std::size_t rows = name == "frames.csv" ? read->frames.size() : read->tilts.size();
      EXPECT_EQ(static_cast<std::ptrdiff_t>(rows), whole_rows) << name << " cut to " << size;
      EXPECT_EQ(read->warnings.empty(), name == "frames.csv" && whole[size - 1] == '\n');
      for (std::size_t i = 0; i < read->frames.size(); ++i) {
        EXPECT_TRUE(ReadFrame(*read, i).has_value());
      }
    }
    WriteText(run + "/" + name, whole);
  }
}

TEST_F(RunWriterTest, AFolderThatCannotBeMadeIsAStateNotACrash) {
  RecorderOptions options = Options();
  WriteText(folder_ / "file", "");
  options.folder = folder_ / "file";
  RunWriter writer(options);
  EXPECT_FALSE(writer.Begin(kStart, ""));
  EXPECT_EQ(writer.status().state, RecorderState::kFailed);
  EXPECT_FALSE(writer.status().what.empty());
  EXPECT_FALSE(writer.AddFrame(kStart, Image().View()));
  EXPECT_EQ(writer.status().frames_lost, 1);
}

TEST_F(RunWriterTest, TooLittleFreeRoomStopsBeforeTheDiskIsFull) {
  RecorderOptions options = Options();
  options.free_min_bytes = std::int64_t{1} << 60;
  RunWriter writer(options);
  EXPECT_FALSE(writer.Begin(kStart, ""));
  EXPECT_EQ(writer.status().state, RecorderState::kDiskFull);
  EXPECT_FALSE(writer.WantsNewRun()) << "there is no more room than before";
}

// A limit on the size of files stands in for the full disk where nobody may mount one: the row that
// does not fit is taken back, the run stays whole, and recording goes on when there is room.
TEST_F(RunWriterTest, AWriteThatDoesNotFitIsTakenBackAndRecordingGoesOnLater) {
  std::signal(SIGXFSZ, SIG_IGN);
  RunWriter writer(Options());
  ASSERT_TRUE(writer.Begin(kStart, ""));
  Record(writer, 20);
  rlimit old_limit = {};
  getrlimit(RLIMIT_FSIZE, &old_limit);
  rlimit limit = old_limit;
  limit.rlim_cur = 2100;  // an image of 2061 bytes fits, the tilt rows soon do not
  setrlimit(RLIMIT_FSIZE, &limit);
  Record(writer, 40, 20 * 200);
  EXPECT_EQ(writer.status().state, RecorderState::kDiskFull);
  EXPECT_GT(writer.status().frames_lost, 0);
  EXPECT_TRUE(writer.WantsNewRun());
  setrlimit(RLIMIT_FSIZE, &old_limit);

  const std::string first = writer.status().run;
  const auto run = ReadRun(first);
  ASSERT_TRUE(run.has_value()) << run.error()[0].Text();
  EXPECT_THAT(run->warnings, SizeIs(0)) << "the row that did not fit was taken back";
  EXPECT_EQ(static_cast<std::int64_t>(run->frames.size()), writer.status().frames_recorded);
  for (std::size_t i = 0; i < run->frames.size(); ++i) EXPECT_TRUE(ReadFrame(*run, i).has_value());

  ASSERT_TRUE(writer.Begin(kStart + std::chrono::seconds(60), ""));
  Record(writer, 1, 60'000);
  writer.Close();
  EXPECT_THAT(ReadRun(writer.status().run)->frames, SizeIs(1));
}

}  // namespace
}  // namespace tbm
