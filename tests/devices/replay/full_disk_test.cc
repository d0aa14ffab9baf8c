#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/mount.h>
#include <unistd.h>

#include "devices/replay/run_reader.h"
#include "devices/replay/run_writer.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::TempFolder;

// A disk of one megabyte in memory; gone with the object.
class SmallDisk {
 public:
  SmallDisk() { is_mounted_ = mount("tmpfs", folder_.path().c_str(), "tmpfs", 0, "size=1m") == 0; }
  ~SmallDisk() {
    if (is_mounted_) umount2(folder_.path().c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  bool is_mounted() const { return is_mounted_; }
  std::string operator/(std::string_view name) const { return folder_ / name; }

 private:
  TempFolder folder_;
  bool is_mounted_ = false;
};

TEST(FullDisk, RecordingStopsCleanlyAndGoesOnWhenThereIsRoom) {
  const SmallDisk disk;
  if (!disk.is_mounted()) GTEST_SKIP() << "mounting a small disk needs root";
  RecorderOptions options;
  options.folder = disk / "recordings";
  options.rig_yaml = test::ReadText(TBM_SOURCE_DIR "/tests/data/config_bad/rig_good.yaml");
  options.free_min_bytes = 0;
  RunWriter writer(options);
  const std::vector<std::uint8_t> pixels(200 * 150, 77);
  const ImageView image{pixels.data(), 200, 150, 200, 1, 255};

  // Somebody else fills the disk while a run is open.
  ASSERT_TRUE(writer.Begin(Timestamp{1'790'000'000'000'000'000}, ""));
  ASSERT_TRUE(writer.AddFrame(Timestamp{1}, image));
  test::WriteText(disk / "other", std::string(600'000, 'x'));
  int recorded = 1;
  while (writer.AddFrame(Timestamp{recorded + 1}, image)) ++recorded;
  EXPECT_EQ(writer.status().state, RecorderState::kDiskFull);
  EXPECT_GT(recorded, 3);
  EXPECT_LT(recorded, 40);

  const auto run = ReadRun(writer.status().run);
  ASSERT_TRUE(run.has_value()) << run.error()[0].Text();
  EXPECT_EQ(run->frames.size(), static_cast<std::size_t>(recorded));
  EXPECT_TRUE(run->warnings.empty());
  for (const RecordedFrame& frame : run->frames) {
    EXPECT_TRUE(ReadImageFile(run->folder + "/" + frame.file).has_value());
  }
  for (const auto& entry : std::filesystem::recursive_directory_iterator(options.folder)) {
    EXPECT_NE(entry.path().extension(), ".part") << "nothing half written is left";
  }

  std::filesystem::remove(disk / "other");
  EXPECT_TRUE(writer.WantsNewRun());
  ASSERT_TRUE(writer.Begin(Timestamp{1'790'000'100'000'000'000}, ""));
  EXPECT_TRUE(writer.AddFrame(Timestamp{1000}, image));
}

TEST(FullDisk, RecordingLeavesTheRoomThatOthersNeed) {
  const SmallDisk disk;
  if (!disk.is_mounted()) GTEST_SKIP() << "mounting a small disk needs root";
  RecorderOptions options;
  options.folder = disk / "recordings";
  options.rig_yaml = test::ReadText(TBM_SOURCE_DIR "/tests/data/config_bad/rig_good.yaml");
  options.free_min_bytes = 300'000;
  RunWriter writer(options);
  const std::vector<std::uint8_t> pixels(200 * 150, 77);
  const ImageView image{pixels.data(), 200, 150, 200, 1, 255};
  ASSERT_TRUE(writer.Begin(Timestamp{1'790'000'000'000'000'000}, ""));
  int recorded = 0;
  while (recorded < 100 && writer.AddFrame(Timestamp{recorded + 1}, image)) ++recorded;
  EXPECT_EQ(writer.status().state, RecorderState::kDiskFull);
  EXPECT_GT(recorded, 10);
  constexpr std::uintmax_t kPage = 4096;  // what the last row may have taken
  EXPECT_GE(std::filesystem::space(options.folder).available + kPage, 300'000u);
  EXPECT_FALSE(writer.WantsNewRun()) << "twice the room must be free first";
}

TEST(FullDisk, BeginOnAFullDiskLeavesNothingBehind) {
  const SmallDisk disk;
  if (!disk.is_mounted()) GTEST_SKIP() << "mounting a small disk needs root";
  RecorderOptions options;
  options.folder = disk / "recordings";
  options.rig_yaml = std::string(2'000'000, '#');
  options.free_min_bytes = 0;
  RunWriter writer(options);
  EXPECT_FALSE(writer.Begin(Timestamp{1'790'000'000'000'000'000}, ""));
  EXPECT_EQ(writer.status().state, RecorderState::kDiskFull);
  EXPECT_TRUE(std::filesystem::is_empty(options.folder));
}

}  // namespace
}  // namespace tbm
