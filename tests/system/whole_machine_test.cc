// The processes as a user starts them: the simulated machine, the camera box, and a reader on DDS.
// Everything on loopback, in a DDS domain of the test's own.
#include <algorithm>
#include <array>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "devices/replay/run_reader.h"
#include "pose/base/clock.h"
#include "tests/idl/dds_support.h"
#include "tests/support/process.h"
#include "tests/support/recorded_run.h"
#include "tests/support/temp_folder.h"
#include "tests/system/example_config.h"
#include "tests/system/machine_watcher.h"

namespace tbm {
namespace {

using dds::test::Eventually;
using test::MachineWatcher;
using test::Process;
using ::testing::HasSubstr;
using namespace std::chrono_literals;

constexpr int kDomain = 160;

class WholeMachine : public ::testing::Test {
 protected:
  WholeMachine() { test::WriteExampleConfig(folder_, kDomain); }

  std::unique_ptr<Process> StartSimulator(const std::vector<std::string>& more = {}) {
    std::vector<std::string> command = {TBM_SIM,
                                        "--rig",
                                        folder_ / "rig.yaml",
                                        "--address",
                                        "127.0.0.1",
                                        "--rate",
                                        "10",
                                        "--target-port",
                                        folder_ / "tilt_target",
                                        "--camera-port",
                                        folder_ / "tilt_camera",
                                        "--truth",
                                        folder_ / "truth.csv"};
    command.insert(command.end(), more.begin(), more.end());
    auto simulator = std::make_unique<Process>(command);
    EXPECT_TRUE(Eventually([&] { return simulator->HasLine("ready"); }, 10s))
        << simulator->Output();
    return simulator;
  }
  std::unique_ptr<Process> StartBox(const std::vector<std::string>& environment = {}) {
    return std::make_unique<Process>(
        std::vector<std::string>{CAMERA_BOX, folder_ / "camera_box.yaml"}, environment);
  }
  std::string NewestRun() const {
    std::vector<std::string> runs;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "runs")) {
      runs.push_back(entry.path());
    }
    std::sort(runs.begin(), runs.end());
    return runs.empty() ? std::string() : runs.back();
  }

  test::TempFolder folder_;
};

TEST_F(WholeMachine, PosesOnDdsHoldAgainstTheSimulatorsTruth) {
  MachineWatcher watcher(kDomain);
  const auto simulator = StartSimulator();
  const auto box = StartBox();
  ASSERT_TRUE(Eventually([&] { return watcher.OkCount() >= 30; }, 20s)) << box->Output();
  box->Signal(SIGTERM);
  EXPECT_EQ(box->Wait(), 0) << box->Output();
  simulator->Signal(SIGTERM);
  EXPECT_EQ(simulator->Wait(), 0);

  const auto truth = test::ReadTruth(folder_.path());
  ASSERT_GT(truth.size(), 30u);
  int compared = 0;
  for (const dds::RelativePose& pose : watcher.Poses()) {
    if (pose.status == PoseStatus::kNone) continue;
    // Stamps differ by what the network takes; the target moves 1 mm in a second.
    const auto nearest =
        std::min_element(truth.begin(), truth.end(), [&](const auto& a, const auto& b) {
          return std::abs(a.stamp_ns - pose.sensed_at.ns) <
                 std::abs(b.stamp_ns - pose.sensed_at.ns);
        });
    ASSERT_LT(std::abs(nearest->stamp_ns - pose.sensed_at.ns), 60'000'000);
    const double error_m =
        (pose.points[0].p_in_camera - nearest->camera_from_target * Eigen::Vector3d(0.0, 0.0, -1.6))
            .norm();
    ASSERT_TRUE(pose.points[0].bound_m);
    EXPECT_LT(error_m, *pose.points[0].bound_m);
    EXPECT_LT(error_m, 0.004);
    ++compared;
  }
  EXPECT_GE(compared, 30);
}

TEST_F(WholeMachine, ADeadMachineIsSaidAndARestartedOneIsFoundAgain) {
  MachineWatcher watcher(kDomain);
  auto simulator = StartSimulator();
  const auto box = StartBox();
  ASSERT_TRUE(Eventually([&] { return watcher.OkCount() >= 5; }, 20s)) << box->Output();

  simulator->Signal(SIGKILL);
  simulator->Wait();
  for (const char* device : {"camera", "inclinometer_target", "inclinometer_camera"}) {
    EXPECT_TRUE(Eventually([&] { return !watcher.IsIn(device, dds::DeviceState::kStreaming); }, 5s))
        << device;
  }
  EXPECT_TRUE(Eventually(
      [&] { return box->Output().find("code=no_pose active=true") != std::string::npos; }, 5s))
      << box->Output();
  const std::size_t before = watcher.OkCount();
  simulator = StartSimulator();
  EXPECT_TRUE(Eventually([&] { return watcher.OkCount() >= before + 5; }, 30s)) << box->Output();
  EXPECT_TRUE(Eventually(
      [&] { return box->Output().find("code=no_pose active=false") != std::string::npos; }, 5s));
  box->Signal(SIGTERM);
  EXPECT_EQ(box->Wait(), 0);
}

TEST_F(WholeMachine, WithADeadMachineItStillEndsWithinSeconds) {
  MachineWatcher watcher(kDomain);
  auto simulator = StartSimulator();
  const auto box = StartBox();
  ASSERT_TRUE(Eventually([&] { return watcher.OkCount() >= 5; }, 20s)) << box->Output();
  simulator->Kill();
  ASSERT_TRUE(Eventually([&] { return watcher.IsIn("camera", dds::DeviceState::kSilent); }, 5s));
  const auto asked = std::chrono::steady_clock::now();
  box->Signal(SIGTERM);
  EXPECT_EQ(box->Wait(), 0) << box->Output();
  EXPECT_LT(std::chrono::steady_clock::now() - asked, 3s);
}

// Like a power cut for the process: what it had recorded solves with the very same program, and DDS
// leaves nothing behind.
TEST_F(WholeMachine, ABoxThatIsKilledLeavesAReadableRecordingAndNoSharedMemory) {
  MachineWatcher watcher(kDomain);
  const auto simulator = StartSimulator();
  const auto box = StartBox();
  ASSERT_TRUE(Eventually([&] { return watcher.OkCount() >= 30; }, 20s)) << box->Output();
  box->Signal(SIGKILL);
  box->Wait();

  const std::string run = NewestRun();
  ASSERT_FALSE(run.empty());
  Process solve({TBM, "solve", run, "--out", folder_ / "poses.csv"});
  EXPECT_EQ(solve.Wait(), 0) << solve.Output();
  std::ifstream poses(folder_ / "poses.csv");
  std::string line;
  int ok = -1;  // the heading
  while (std::getline(poses, line)) ok += ok < 0 || line.find(",ok,") != std::string::npos ? 1 : 0;
  EXPECT_GE(ok, 20);
  for (const auto& entry : std::filesystem::directory_iterator("/dev/shm")) {
    EXPECT_THAT(entry.path().filename().string(), ::testing::Not(HasSubstr("fastrtps")));
  }

  // And the next one begins with the same recordings folder.
  const auto next = StartBox();
  const std::size_t before = watcher.OkCount();
  EXPECT_TRUE(Eventually([&] { return watcher.OkCount() >= before + 5; }, 30s)) << next->Output();
}

TEST_F(WholeMachine, ACameraThatComesLateIsWaitedFor) {
  MachineWatcher watcher(kDomain);
  const auto box = StartBox();
  std::this_thread::sleep_for(3s);
  const auto simulator = StartSimulator();
  EXPECT_TRUE(Eventually([&] { return watcher.OkCount() >= 5; }, 20s)) << box->Output();
}

// The real process with the real camera protocol, its civil clock set by hand: an hour forward, two
// hours back.
TEST_F(WholeMachine, SettingTheClockCostsAtMostAMoment) {
  const std::string library = "/usr/lib/x86_64-linux-gnu/faketime/libfaketime.so.1";
  if (!std::filesystem::exists(library)) GTEST_SKIP() << library << " is not there: libfaketime";
  test::WriteText(folder_ / "clock", "+0s\n");
  MachineWatcher watcher(kDomain);
  const auto simulator = StartSimulator();
  const auto box = StartBox({"LD_PRELOAD=" + library,
                             "FAKETIME_TIMESTAMP_FILE=" + (folder_ / "clock"),
                             "FAKETIME_NO_CACHE=1",
                             "FAKETIME_DONT_FAKE_MONOTONIC=1",
                             "DONT_FAKE_MONOTONIC=1"});
  ASSERT_TRUE(Eventually([&] { return watcher.OkCount() >= 20; }, 20s)) << box->Output();
  for (const char* offset : {"+3600s\n", "-3600s\n"}) {
    const std::size_t before = watcher.OkCount();
    const std::size_t all_before = watcher.Poses().size();
    // A file that is written over is empty for a moment.
    test::WriteText(folder_ / "clock.new", offset);
    std::filesystem::rename(folder_ / "clock.new", folder_ / "clock");
    ASSERT_TRUE(Eventually([&] { return watcher.OkCount() >= before + 20; }, 10s)) << box->Output();
    EXPECT_LE(watcher.Poses().size() - all_before - 20, 8u) << "frames without a good pose";
  }
  EXPECT_TRUE(
      Eventually([&] { return box->Output().find("code=clock_set") != std::string::npos; }));
  const auto poses = watcher.Poses();
  const double ahead_s =
      1e-9 * static_cast<double>(SystemClock().Now().ns - poses.back().sensed_at.ns);
  EXPECT_NEAR(ahead_s, 3600.0, 5.0) << "the stamps are those of the clock as it is set";
}

// What a service manager hears.
TEST_F(WholeMachine, TheServiceManagerIsToldOfStartLifeAndEnd) {
  const std::string path = folder_ / "notify";
  const int listener = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  ASSERT_LT(path.size(), sizeof address.sun_path);
  path.copy(address.sun_path, path.size());
  ASSERT_EQ(bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  const timeval patience{5, 0};
  setsockopt(listener, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  const auto next = [&] {
    std::array<char, 256> text{};
    const ssize_t size = recv(listener, text.data(), text.size(), 0);
    return std::string(text.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  };
  // No camera, no inclinometer: the process is alive all the same.
  const auto box = StartBox({"NOTIFY_SOCKET=" + path});
  EXPECT_EQ(next(), "READY=1\nWATCHDOG=1");
  for (int i = 0; i < 4; ++i) EXPECT_EQ(next(), "WATCHDOG=1");
  box->Signal(SIGTERM);
  std::string last;
  for (int i = 0; i < 20 && last != "STOPPING=1"; ++i) last = next();
  EXPECT_EQ(last, "STOPPING=1");
  EXPECT_EQ(box->Wait(), 0);
  close(listener);
}

TEST_F(WholeMachine, TheSelfTestNamesTheLedThatIsOffAndThenTheMissingMachine) {
  const std::vector<std::string> command = {
      CAMERA_BOX, "--self-test", "--seconds", "2", folder_ / "camera_box.yaml"};
  {
    const auto simulator = StartSimulator({"--hide-led", "P3"});
    Process self_test(command);
    EXPECT_EQ(self_test.Wait(), 3);
    EXPECT_TRUE(
        Eventually([&] { return self_test.Output().find(". The box") != std::string::npos; }));
    EXPECT_THAT(self_test.Output(), HasSubstr("BAD    LED P3               not seen"));
    EXPECT_THAT(self_test.Output(), HasSubstr("good   LED P4"));
    EXPECT_THAT(self_test.Output(), HasSubstr("good   inclinometer target"));
    EXPECT_THAT(self_test.Output(), HasSubstr("a message of our own comes back"));
    EXPECT_THAT(self_test.Output(), HasSubstr("The box is not ready."));
  }
  Process self_test(command);
  EXPECT_EQ(self_test.Wait(), 3);
  EXPECT_TRUE(
      Eventually([&] { return self_test.Output().find(". The box") != std::string::npos; }));
  EXPECT_THAT(self_test.Output(), HasSubstr("BAD    camera               unreachable"));
  EXPECT_THAT(self_test.Output(), HasSubstr("BAD    inclinometer camera  port_missing"));
}

TEST_F(WholeMachine, ABadConfigurationEndsWithCodeTwoAndSaysAllThatIsWrong) {
  std::string config = test::ReadText(folder_ / "camera_box.yaml");
  config = test::Replaced(config, "frame_rate_hz: 10", "frame_rate_hz: fast");
  config = test::Replaced(config, "driver: modbus  ", "driver: modbux  ");
  test::WriteText(folder_ / "camera_box.yaml", config);
  const auto box = StartBox();
  EXPECT_EQ(box->Wait(), 2);
  ASSERT_TRUE(Eventually([&] { return box->LineCount() >= 2; }));
  EXPECT_THAT(box->Output(), HasSubstr("camera.frame_rate_hz"));
  EXPECT_THAT(box->Output(), HasSubstr("inclinometers.target.driver: 'modbux' is not one of"));
}

TEST_F(WholeMachine, AMissingRigFileEndsWithCodeTwo) {
  std::filesystem::remove(folder_ / "rig.yaml");
  const auto box = StartBox();
  EXPECT_EQ(box->Wait(), 2);
  EXPECT_TRUE(Eventually([&] { return box->Output().find("rig.yaml") != std::string::npos; }));
}

TEST_F(WholeMachine, WatchShowsLiveValuesInPlainLines) {
  const auto simulator = StartSimulator();
  const auto box = StartBox();
  Process watch({TBM, "watch", "--domain", std::to_string(kDomain)});
  EXPECT_TRUE(
      Eventually([&] { return watch.Output().find("shield_head") != std::string::npos; }, 20s))
      << watch.Output() << box->Output();
  EXPECT_THAT(watch.Output(), HasSubstr("ok"));
}

}  // namespace
}  // namespace tbm
