#include <csignal>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/devices/camera/gige_bench.h"
#include "tests/devices/camera/gv_proxy.h"

namespace tbm::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

const SystemClock kClock;

// Another program, ended by kill -9 at the latest when the test is over.
class Program {
 public:
  Program() = default;
  explicit Program(std::vector<std::string> words) { Start(std::move(words)); }
  ~Program() { Kill(); }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  void Start(std::vector<std::string> words) {
    Kill();
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    pid_ = fork();
    if (pid_ == 0) {
      execv(arguments[0], arguments.data());
      _exit(127);
    }
  }
  void Kill() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }
  // The exit code of a program that ends by itself.
  int Wait() {
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t pid_ = -1;
};

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
  // Outlives the client: closing a connection to a dead camera takes seconds.
  Program simulator(CameraSim());
  const auto camera = MakeCamera(GigeConfig(20.0), kClock);
  ASSERT_TRUE(NextFrame(*camera));
  ASSERT_GT(FramesFor(*camera, milliseconds(500)), 3);
  simulator.Kill();
  FramesFor(*camera, milliseconds(1000));
  EXPECT_EQ(camera->Health().state, CameraState::kSilent);
  simulator.Start(CameraSim());
  ASSERT_TRUE(NextFrame(*camera, seconds(20)));
  EXPECT_GT(FramesFor(*camera, milliseconds(1000)), 3);
  EXPECT_EQ(camera->Health().reconnects, 1u);
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
  Program simulator;
  const auto camera = MakeCamera(GigeConfig(20.0), kClock);
  const auto begun = std::chrono::steady_clock::now();
  const auto nothing = camera->WaitFrame(milliseconds(100));
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error(), CameraFailure::kUnreachable);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, seconds(2));
  EXPECT_EQ(camera->Health().state, CameraState::kClosed);
  EXPECT_EQ(camera->Health().failure, CameraFailure::kUnreachable);
  EXPECT_NE(camera->Health().detail.find(kCameraAddress), std::string::npos);
  simulator.Start(CameraSim());
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
    Program client({TBM_CAMERA_CLIENT, kCameraAddress});
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
  EXPECT_EQ(Program(CameraSim()).Wait(), 3);
}

TEST(CameraSim, RefusesAWrongCommandLine) {
  EXPECT_EQ(Program({TBM_CAMERA_SIM, "--rig", RigFile(), "--hide-led", "P9"}).Wait(), 2);
  EXPECT_EQ(Program({TBM_CAMERA_SIM, "--rig", "no_such_rig.yaml"}).Wait(), 2);
  EXPECT_EQ(Program({TBM_CAMERA_SIM}).Wait(), 2);
}

}  // namespace
}  // namespace tbm::test
