#include <fstream>
#include <optional>
#include <thread>

#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/devices/camera/gige_bench.h"
#include "tests/devices/camera/gv_proxy.h"
#include "tests/support/process.h"

namespace tbm::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

const SystemClock kClock;

std::string RigFile() {
  static const std::string path = [] {
    const std::string name =
        ::testing::TempDir() + "small_rig_" + std::to_string(getpid()) + ".yaml";
    std::ofstream(name) << SmallRigYaml();
    return name;
  }();
  return path;
}

std::vector<std::string> CameraSim() {
  return {TBM_CAMERA_SIM, "--rig", RigFile(), "--address", kCameraAddress, "--stamp-sequence"};
}

TEST(GigeCamera, AHoleInTheNetworkIsCalledSilenceAndHeals) {
  const auto simulator = StartSimulator();
  GvProxy proxy(kProxyAddress, kCameraAddress, "GigeCamera.hole");
  const auto camera = MakeCamera(GigeConfig(20.0, kProxyAddress), kClock);
  ASSERT_GT(FramesFor(*camera, milliseconds(500)), 3);
  for (const int hole_ms : {1500, 3500, 7000}) {
    proxy.is_black_hole = true;
    bool was_silent = false;
    const auto until = std::chrono::steady_clock::now() + milliseconds(hole_ms);
    while (std::chrono::steady_clock::now() < until) {
      const auto frame = camera->WaitFrame(milliseconds(100));
      was_silent |= !frame && frame.error() == CameraFailure::kSilent &&
                    camera->Health().state == CameraState::kSilent;
    }
    EXPECT_TRUE(was_silent) << hole_ms;
    proxy.is_black_hole = false;
    EXPECT_TRUE(NextFrame(*camera, seconds(20))) << hole_ms;
    EXPECT_GT(FramesFor(*camera, milliseconds(1000)), 3) << hole_ms;
    EXPECT_EQ(camera->Health().state, CameraState::kStreaming);
    if (hole_ms == 1500) {
      EXPECT_EQ(camera->Health().reconnects, 0u);
    }
  }
  EXPECT_GE(camera->Health().reconnects, 1u);
}

TEST(GigeCamera, ACameraThatDiesAndComesBackIsOpenedAgain) {
  std::optional<Process> simulator(std::in_place, CameraSim());
  const auto camera = MakeCamera(GigeConfig(20.0), kClock);
  ASSERT_TRUE(NextFrame(*camera));
  ASSERT_GT(FramesFor(*camera, milliseconds(500)), 3);
  simulator->Kill();
  FramesFor(*camera, milliseconds(1000));
  EXPECT_EQ(camera->Health().state, CameraState::kSilent);
  simulator.emplace(CameraSim());
  ASSERT_TRUE(NextFrame(*camera, seconds(20)));
  EXPECT_GT(FramesFor(*camera, milliseconds(1000)), 3);
  EXPECT_EQ(camera->Health().reconnects, 1u);
}

// Neither the one who waits for a frame nor the one who ends has to sit through the library's
// attempts to say goodbye to a camera that is not there any more.
TEST(GigeCamera, ADeadCameraHoldsUpNeitherWaitingNorClosing) {
  // Before and after the library has noticed.
  for (const auto dead : {milliseconds(300), milliseconds(7000)}) {
    Process simulator(CameraSim());
    auto camera = MakeCamera(GigeConfig(20.0), kClock);
    ASSERT_TRUE(NextFrame(*camera)) << simulator.Output();
    ASSERT_GT(FramesFor(*camera, milliseconds(500)), 3);
    simulator.Kill();
    const auto killed = std::chrono::steady_clock::now();
    while (std::chrono::steady_clock::now() - killed < dead) {
      const auto asked = std::chrono::steady_clock::now();
      (void)camera->WaitFrame(milliseconds(100));
      EXPECT_LT(std::chrono::steady_clock::now() - asked, seconds(1));
    }
    const auto asked = std::chrono::steady_clock::now();
    camera->Close();
    EXPECT_EQ(camera->Health().state, CameraState::kClosed);
    camera.reset();
    EXPECT_LT(std::chrono::steady_clock::now() - asked, seconds(2)) << dead.count();
  }
}

// Its heartbeats are answered, so the library sees nothing wrong.
TEST(GigeCamera, ACameraThatAnswersButSendsNoFramesIsOpenedAgain) {
  const auto simulator = StartSimulator();
  GvProxy proxy(kProxyAddress, kCameraAddress, "GigeCamera.mute");
  const auto camera = MakeCamera(GigeConfig(20.0, kProxyAddress), kClock);
  ASSERT_TRUE(NextFrame(*camera));
  proxy.drop = 1.0;
  std::string why_lost;
  for (int i = 0; i < 100 && why_lost.empty(); ++i) {
    const auto frame = camera->WaitFrame(milliseconds(100));
    if (!frame && frame.error() == CameraFailure::kLost) why_lost = camera->Health().detail;
  }
  EXPECT_EQ(why_lost, "the camera answers but sends no frames");
  proxy.drop = 0.0;
  EXPECT_TRUE(NextFrame(*camera, seconds(20)));
  EXPECT_GE(camera->Health().reconnects, 1u);
}

TEST(GigeCamera, WithoutACameraItSaysSoAndOpensOnceThereIsOne) {
  std::optional<Process> simulator;
  const auto camera = MakeCamera(GigeConfig(20.0), kClock);
  const auto begun = std::chrono::steady_clock::now();
  const auto nothing = camera->WaitFrame(milliseconds(100));
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error(), CameraFailure::kUnreachable);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, seconds(2));
  EXPECT_EQ(camera->Health().state, CameraState::kClosed);
  EXPECT_EQ(camera->Health().failure, CameraFailure::kUnreachable);
  EXPECT_NE(camera->Health().detail.find(kCameraAddress), std::string::npos);
  simulator.emplace(CameraSim());
  EXPECT_TRUE(NextFrame(*camera, seconds(10)));
  EXPECT_EQ(camera->Health().reconnects, 0u);
  EXPECT_FALSE(camera->Health().failure);
}

TEST(GigeCamera, ASecondClientIsRefusedAndTheFirstNotDisturbed) {
  const auto simulator = StartSimulator();
  const auto first = MakeCamera(GigeConfig(20.0), kClock);
  ASSERT_TRUE(NextFrame(*first));
  std::atomic<bool> is_over = false;
  std::jthread grabber([&] {
    while (!is_over) (void)first->WaitFrame(milliseconds(100));
  });
  const auto second = MakeCamera(GigeConfig(20.0), kClock);
  const auto refused = second->WaitFrame(milliseconds(100));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error(), CameraFailure::kInUse);
  EXPECT_EQ(second->Health().state, CameraState::kClosed);
  is_over = true;
  grabber.join();
  EXPECT_EQ(first->Health().state, CameraState::kStreaming);
  EXPECT_EQ(first->Health().reconnects, 0u);
  EXPECT_GT(first->Health().frames, 20u);
}

TEST(GigeCamera, AfterAClientWasKilledTheNextOneGetsInWithinSeconds) {
  const auto simulator = StartSimulator();
  {
    Process client({TBM_CAMERA_CLIENT, kCameraAddress});
    const auto until = std::chrono::steady_clock::now() + seconds(10);
    while (simulator->frames_sent() < 5 && std::chrono::steady_clock::now() < until) {
      std::this_thread::sleep_for(milliseconds(50));
    }
    ASSERT_GE(simulator->frames_sent(), 5u);
  }
  const auto camera = MakeCamera(GigeConfig(20.0), kClock);
  const auto refused = camera->WaitFrame(milliseconds(100));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error(), CameraFailure::kInUse);
  EXPECT_TRUE(NextFrame(*camera, seconds(20)));
}

TEST(GigeCamera, ClosedInOrderItCanBeOpenedAgainAtOnce) {
  const auto simulator = StartSimulator();
  const auto camera = MakeCamera(GigeConfig(20.0), kClock);
  ASSERT_TRUE(NextFrame(*camera));
  camera->RequestExposure(3000.0);
  ASSERT_GT(FramesFor(*camera, milliseconds(400)), 2);
  camera->Close();
  const auto frame = NextFrame(*camera, seconds(2));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->exposure_us, 3000.0);  // remembered
  EXPECT_EQ(camera->Health().reconnects, 1u);
}

TEST(CameraSim, SaysClearlyThatItsAddressIsTaken) {
  const auto simulator = StartSimulator();
  EXPECT_EQ(Process(CameraSim()).Wait(), 3);
}

TEST(CameraSim, RefusesAWrongCommandLine) {
  EXPECT_EQ(Process({TBM_CAMERA_SIM, "--rig", RigFile(), "--hide-led", "P9"}).Wait(), 2);
  EXPECT_EQ(Process({TBM_CAMERA_SIM, "--rig", "no_such_rig.yaml"}).Wait(), 2);
  EXPECT_EQ(Process({TBM_CAMERA_SIM}).Wait(), 2);
}

}  // namespace
}  // namespace tbm::test
