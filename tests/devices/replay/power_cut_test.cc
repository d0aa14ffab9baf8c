// The mains go while the box records: what reached the disk by then has to hold every frame older
// than a second, and to be readable.
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "devices/replay/run_reader.h"
#include "devices/replay/run_writer.h"
#include "tests/support/loop_disk.h"
#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using test::LoopDisk;
using test::Runs;
using test::TempFolder;

constexpr int kFramesPerSecond = 10;

// Until it is killed. `frames` is in memory shared with the test.
[[noreturn]] void RecordForEver(const std::string& folder, std::atomic<int>* frames) {
  RecorderOptions options;
  options.folder = folder;
  options.rig_yaml = test::ReadText(TBM_SOURCE_DIR "/tests/data/config_bad/rig_good.yaml");
  options.free_min_bytes = 0;
  options.sync_every_frames = kFramesPerSecond;
  RunWriter writer(options);
  if (!writer.Begin(Timestamp{1'790'000'000'000'000'000}, "")) std::_Exit(1);
  const std::vector<std::uint8_t> pixels(1280 * 1024, 7);
  const ImageView image{pixels.data(), 1280, 1024, 1280, 1, 255};
  for (int i = 0;; ++i) {
    const Timestamp at{1'790'000'000'000'000'000 + i * (1'000'000'000LL / kFramesPerSecond)};
    writer.AddTilt({at, TiltSensor::kTarget, {0.01, 0.02}});
    writer.AddTilt({at, TiltSensor::kCamera, {0.02, 0.01}});
    if (!writer.AddFrame(at, image)) std::_Exit(2);
    frames->store(i + 1);
    std::this_thread::sleep_for(1000ms / kFramesPerSecond);
  }
}

TEST(PowerCut, LosesAtMostTheLastSecondAndWhatRemainsIsReadable) {
  if (geteuid() != 0) GTEST_SKIP() << "mounting a disk needs root";
  const TempFolder folder;
  const std::string file = folder / "disk";
  ASSERT_TRUE(LoopDisk::Make(file, "160M"));
  const LoopDisk disk(file, folder / "mounted");
  if (!disk.is_mounted()) GTEST_SKIP() << "no loop device to be had";

  void* const shared = mmap(
      nullptr, sizeof(std::atomic<int>), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(shared, MAP_FAILED);
  auto* const frames = new (shared) std::atomic<int>(0);
  const pid_t writer = fork();
  if (writer == 0) RecordForEver(disk.place() + "/runs", frames);

  test::Random random("PowerCut");
  std::array<int, 5> frames_at_cut{};
  for (std::size_t cut = 0; cut < frames_at_cut.size(); ++cut) {
    std::this_thread::sleep_for(std::chrono::milliseconds(700 + random.Index(900)));
    kill(writer, SIGSTOP);
    frames_at_cut[cut] = frames->load();
    ASSERT_TRUE(Runs("cp '" + file + "' '" + (folder / ("cut" + std::to_string(cut))) + "'"));
    kill(writer, SIGCONT);
  }
  kill(writer, SIGKILL);
  int status = 0;
  waitpid(writer, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status)) << "the writer ended by itself with " << WEXITSTATUS(status);

  for (std::size_t cut = 0; cut < frames_at_cut.size(); ++cut) {
    const std::string name = "cut" + std::to_string(cut);
    const LoopDisk after(folder / name, folder / (name + "_mounted"));
    ASSERT_TRUE(after.is_mounted()) << name;
    const int written = frames_at_cut[cut];
    std::string run_folder;
    if (fs::exists(after.place() + "/runs")) {
      for (const auto& entry : fs::directory_iterator(after.place() + "/runs")) {
        run_folder = entry.path();
      }
    }
    if (written <= kFramesPerSecond) continue;
    ASSERT_NE(run_folder, "") << name;
    const auto run = ReadRun(run_folder);
    ASSERT_TRUE(run.has_value()) << name << ": " << run.error()[0].Text();
    EXPECT_GE(static_cast<int>(run->frames.size()), written - kFramesPerSecond) << name;
    for (std::size_t i = 0; i < run->frames.size(); ++i) {
      EXPECT_TRUE(ReadFrame(*run, i).has_value()) << name << ", frame " << i;
      ASSERT_TRUE(run->frames[i].tilts_known.has_value());
      EXPECT_LE(*run->frames[i].tilts_known, run->tilts.size());
    }
  }
}

}  // namespace
}  // namespace tbm
