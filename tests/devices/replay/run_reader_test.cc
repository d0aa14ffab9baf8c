#include "devices/replay/run_reader.h"

#include <cmath>
#include <filesystem>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::ReadText;
using test::TempFolder;
using test::WriteText;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

const std::string kBadFolder = TBM_SOURCE_DIR "/tests/data/config_bad/";
constexpr const char* kTiltHeader = "stamp_ns,sensor,beta_deg,gamma_deg\n";
constexpr const char* kFrameHeader = "stamp_ns,file\n";

struct BadFile {
  const char* name;
  int line;
  const char* column;
};

constexpr BadFile kBadFiles[] = {
    {"tilt_column_missing", 1, "gamma_deg"},
    {"tilt_column_twice", 1, "beta_deg"},
    {"tilt_word_for_number", 4, "beta_deg"},
    {"tilt_empty_number", 4, "beta_deg"},
    {"tilt_number_with_unit", 4, "beta_deg"},
    {"tilt_number_with_blank", 4, "gamma_deg"},
    {"tilt_decimal_comma", 1, "stamp_ns"},
    {"tilt_stamp_with_decimals", 2, "stamp_ns"},
    {"tilt_stamp_too_large", 4, "stamp_ns"},
    {"tilt_sensor_unknown", 4, "sensor"},
    {"tilt_field_missing", 4, ""},
    {"tilt_field_too_many", 4, ""},
    {"tilt_quote_open", 4, ""},
    {"tilt_empty_line_inside", 2, ""},
    {"tilt_empty", 0, ""},
    {"frames_column_missing", 1, "file"},
    {"frames_stamp_word", 2, "stamp_ns"},
    {"frames_path_outside", 2, "file"},
    {"frames_path_absolute", 2, "file"},
    {"frames_path_empty", 2, "file"},
    {"frames_tilts_known_goes_back", 3, "tilts_known"},
};

class RunReader : public ::testing::Test {
 protected:
  void SetUp() override {
    WriteText(run_ / "rig.yaml", ReadText(kBadFolder + "rig_good.yaml"));
    WriteText(run_ / "frames.csv", kFrameHeader);
    WriteText(run_ / "tilt.csv", kTiltHeader);
  }
  RecordedRun Read() {
    auto run = ReadRun(run_.path());
    EXPECT_TRUE(run.has_value()) << (run ? "" : run.error()[0].Text());
    return run ? std::move(run).value() : RecordedRun{};
  }
  TempFolder run_;
};

TEST_F(RunReader, ReadsFramesAndTilts) {
  WriteText(run_ / "frames.csv",
            "file,stamp_ns,exposure_ms\nframes/a.png,30,2\nframes/b.png,10,2\n");
  WriteText(run_ / "tilt.csv",
            std::string(kTiltHeader) + "20,camera,-2.5,2.25\n10,target,0.5,-0.125\n");
  const RecordedRun run = Read();
  EXPECT_THAT(run.warnings, SizeIs(0));
  ASSERT_EQ(run.frames.size(), 2u);
  EXPECT_EQ(run.frames[0].sensed_at.ns, 30);
  EXPECT_EQ(run.frames[1].sensed_at.ns, 10)
      << "kept as recorded; the solver says what it thinks of it";
  EXPECT_EQ(run.frames[1].file, "frames/b.png");
  EXPECT_EQ(run.frames[1].line, 3);
  ASSERT_EQ(run.tilts.size(), 2u);
  EXPECT_EQ(run.tilts[0].sensed_at.ns, 10) << "in the order of time";
  EXPECT_EQ(run.tilts[0].sensor, TiltSensor::kTarget);
  EXPECT_EQ(run.tilts[0].inclination.beta_rad, DegToRad(0.5));
  EXPECT_EQ(run.tilts[0].inclination.gamma_rad, DegToRad(-0.125));
  EXPECT_EQ(run.tilts[1].sensor, TiltSensor::kCamera);
}

TEST_F(RunReader, EachBadFileNamesItsLineAndColumn) {
  for (const BadFile& bad : kBadFiles) {
    SCOPED_TRACE(bad.name);
    const std::string name(bad.name);
    const std::string file = name.starts_with("tilt") ? "tilt.csv" : "frames.csv";
    SetUp();
    WriteText(run_ / file, ReadText(kBadFolder + "csv/" + name + ".csv"));
    const auto run = ReadRun(run_.path());
    ASSERT_FALSE(run.has_value());
    const FileFault& fault = run.error().front();
    EXPECT_EQ(fault.file, run_ / file);
    EXPECT_EQ(fault.line, bad.line);
    EXPECT_EQ(fault.column, bad.column);
    EXPECT_GT(fault.what.size(), 15u) << "says what would be right: " << fault.what;
  }
}

TEST_F(RunReader, EveryBadFileIsInTheList) {
  std::set<std::string> listed;
  for (const BadFile& bad : kBadFiles) listed.insert(std::string(bad.name) + ".csv");
  std::set<std::string> present;
  for (const auto& entry : std::filesystem::directory_iterator(kBadFolder + "csv")) {
    present.insert(entry.path().filename().string());
  }
  EXPECT_EQ(listed, present);
}

TEST_F(RunReader, FaultsOfAllFilesComeTogether) {
  WriteText(run_ / "rig.yaml", "camera: 5\n");
  WriteText(run_ / "frames.csv", "file\n");
  std::filesystem::remove(run_ / "tilt.csv");
  const auto run = ReadRun(run_.path());
  ASSERT_FALSE(run.has_value());
  std::string text;
  for (const FileFault& fault : run.error()) text += fault.Text() + "\n";
  EXPECT_THAT(text, HasSubstr("rig.yaml:1: camera"));
  EXPECT_THAT(text, HasSubstr("frames.csv:1: column stamp_ns"));
  EXPECT_THAT(text, HasSubstr("tilt.csv: cannot be opened"));
}

TEST_F(RunReader, KeepsReadingsThatSayNothingOrTooMuch) {
  WriteText(
      run_ / "tilt.csv",
      std::string(kTiltHeader) + "10,target,nan,0.5\n20,camera,0.25,-inf\n30,target,400,0.5\n");
  const RecordedRun run = Read();
  ASSERT_EQ(run.tilts.size(), 3u);
  EXPECT_TRUE(std::isnan(run.tilts[0].inclination.beta_rad));
  EXPECT_EQ(run.tilts[0].inclination.gamma_rad, DegToRad(0.5));
  EXPECT_TRUE(std::isinf(run.tilts[1].inclination.gamma_rad));
  EXPECT_EQ(run.tilts[2].inclination.beta_rad, DegToRad(400.0));
  ASSERT_THAT(run.warnings, SizeIs(2));
  EXPECT_THAT(run.warnings[0], HasSubstr("tilt.csv:2: column beta_deg"));
  EXPECT_THAT(run.warnings[1], HasSubstr("tilt.csv:3: column gamma_deg"));
}

TEST_F(RunReader, AFrameIsOneReasonNotTheEndOfTheRun) {
  WriteText(run_ / "frames.csv",
            std::string(kFrameHeader) + "1,absent.png\n2,cut.pgm\n3,small.pgm\n");
  WriteText(run_ / "cut.pgm", "P5\n1280 1024\n255\nabc");
  WriteText(run_ / "small.pgm", "P5\n2 2\n255\nabcd");
  const RecordedRun run = Read();
  EXPECT_EQ(ReadFrame(run, 0).error().failure, ImageFileFailure::kMissing);
  EXPECT_EQ(ReadFrame(run, 1).error().failure, ImageFileFailure::kUnreadable);
  EXPECT_EQ(ReadFrame(run, 2).error().failure, ImageFileFailure::kSize);
}

TEST_F(RunReader, ALastLineWithoutItsEndIsDroppedWithAWarning) {
  const std::string whole = std::string(kTiltHeader) + "10,target,0.5,0.25\n";
  const std::string last = "20,camera,0.5,0.2512";
  for (std::size_t size = 1; size <= last.size(); ++size) {
    WriteText(run_ / "tilt.csv", whole + last.substr(0, size));
    const RecordedRun run = Read();
    EXPECT_THAT(run.tilts, SizeIs(1)) << size;
    ASSERT_THAT(run.warnings, SizeIs(1)) << size;
    EXPECT_THAT(run.warnings[0], HasSubstr("tilt.csv:3"));
  }
}

TEST_F(RunReader, AZeroFilledTailIsDroppedWithAWarning) {
  WriteText(run_ / "tilt.csv",
            std::string(kTiltHeader) + "10,target,0.5,0.25\n" + std::string(100, '\0'));
  const RecordedRun run = Read();
  EXPECT_THAT(run.tilts, SizeIs(1));
  EXPECT_THAT(run.warnings, SizeIs(1));
}

TEST_F(RunReader, AFrameRowWithoutItsEndCountsWhenItsImageIsThere) {
  WriteText(run_ / "a.pgm", "");
  WriteText(run_ / "frames.csv", std::string(kFrameHeader) + "1,a.pgm\n2,a.pgm");
  EXPECT_THAT(Read().frames, SizeIs(2));
  WriteText(run_ / "frames.csv", std::string(kFrameHeader) + "1,a.pgm\n2,a.pg");
  const RecordedRun run = Read();
  EXPECT_THAT(run.frames, SizeIs(1));
  EXPECT_THAT(run.warnings, SizeIs(1));
}

TEST_F(RunReader, TheFeedLooksAheadAndGivesEachReadingOnce) {
  WriteText(run_ / "frames.csv", std::string(kFrameHeader) + "100,a\n90,b\n200,c\n");
  std::string tilts = kTiltHeader;
  for (int stamp = 0; stamp <= 300; stamp += 50) tilts += std::to_string(stamp) + ",target,0,0\n";
  WriteText(run_ / "tilt.csv", tilts);
  const RecordedRun run = Read();
  TiltFeed feed(run, Duration(50));
  EXPECT_THAT(feed.Before(0), SizeIs(4)) << "0, 50, 100, 150";
  EXPECT_THAT(feed.Before(1), SizeIs(0));
  const auto last = feed.Before(2);
  ASSERT_THAT(last, SizeIs(2));
  EXPECT_EQ(last[0].sensed_at.ns, 200);
}

TEST_F(RunReader, TheFeedFollowsWhatTheCameraBoxKnew) {
  WriteText(run_ / "frames.csv", "stamp_ns,file,tilts_known\n100,a,1\n200,b,1\n300,c,3\n");
  WriteText(run_ / "tilt.csv",
            std::string(kTiltHeader) + "90,target,0,0\n290,target,0,0\n280,camera,0,0\n");
  const RecordedRun run = Read();
  TiltFeed feed(run);
  EXPECT_THAT(feed.Before(0), SizeIs(1));
  EXPECT_THAT(feed.Before(1), SizeIs(0));
  const auto last = feed.Before(2);
  ASSERT_THAT(last, SizeIs(2));
  EXPECT_EQ(last[0].sensed_at.ns, 290) << "in the order of arrival, not of time";
}

TEST_F(RunReader, NoFolderIsSaidInOneSentence) {
  const auto run = ReadRun("/nowhere");
  ASSERT_FALSE(run.has_value());
  ASSERT_THAT(run.error(), SizeIs(1));
  EXPECT_THAT(run.error()[0].Text(), HasSubstr("/nowhere: is not a folder"));
}

}  // namespace
}  // namespace tbm
