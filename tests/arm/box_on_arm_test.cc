// The camera box as it is deployed, on an emulated Cortex-A8: a GigE Vision camera and two Modbus
// inclinometers on this computer, readers on DDS of our own and of another vendor. All in a network
// namespace that has only loopback.
#include <cstdlib>
#include <filesystem>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "devices/app/gige_simulator.h"
#include "devices/inclinometer/modbus_emulator.h"
#include "devices/sim/world.h"
#include "pose/base/angle.h"
#include "pose/base/clock.h"
#include "pose/rig/rig_file.h"
#include "tests/devices/camera/own_network.h"
#include "tests/idl/dds_support.h"
#include "tests/support/process.h"
#include "tests/support/recorded_run.h"
#include "tests/support/temp_folder.h"
#include "tests/system/example_config.h"
#include "tests/system/machine_watcher.h"

namespace tbm {
namespace {

using dds::DeviceState;
using dds::test::Eventually;
using test::MachineWatcher;
using test::Process;
using ::testing::HasSubstr;
using namespace std::chrono_literals;

constexpr int kDomain = 161;
const std::string kArmTree = TBM_SOURCE_DIR "/build/arm/tree";
const std::string kSysroot = TBM_SOURCE_DIR "/build/arm/sysroot";

// Before any thread: what the emulated box sends by multicast must not leave this computer.
class OwnNetwork final : public ::testing::Environment {
 public:
  void SetUp() override {
    problem = test::EnterOwnNetwork();
    if (problem.empty() && std::system("ip route add 224.0.0.0/4 dev lo") != 0) {
      problem = "no multicast route in the new network namespace";
    }
  }
  static inline std::string problem;
};
const auto* const kOwnNetwork = ::testing::AddGlobalTestEnvironment(new OwnNetwork);

std::unique_ptr<ModbusEmulator> Inclinometer(const std::string& port,
                                             int address,
                                             TiltTruth truth,
                                             const Clock& clock) {
  SerialSettings line;
  line.path = port;
  line.baud = 115200;
  ModbusRegisterMap registers;
  registers.function = 4;
  registers.format = RegisterFormat::kInt32;
  registers.beta_register = 0;
  registers.gamma_register = 2;
  registers.rad_per_lsb = DegToRad(0.0001);
  return std::make_unique<ModbusEmulator>(
      line,
      std::vector<EmulatedModbusTilt>{{address, registers, std::move(truth), 21.0}},
      2ms,
      clock);
}

class BoxOnArm : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(OwnNetwork::problem, "");
    if (!std::filesystem::exists(kArmTree + "/bin/camera_box")) {
      GTEST_SKIP() << "no box to run: tools/arm/build makes it";
    }
    test::WriteExampleConfig(folder_, kDomain);

    const auto loaded = LoadRigFile(folder_ / "rig.yaml");
    ASSERT_TRUE(loaded.has_value());
    world_ =
        std::make_shared<const sim::World>(loaded->rig, sim::Motion{}, sim::Faults{}, clock_.Now());
    StartCamera();
    target_ = Inclinometer(folder_ / "tilt_target", 1, TruthOf(sim::TiltSensor::kTarget), clock_);
    camera_ = Inclinometer(folder_ / "tilt_camera", 2, TruthOf(sim::TiltSensor::kCamera), clock_);
    ASSERT_TRUE(target_->IsUp() && camera_->IsUp());
  }

  TiltTruth TruthOf(sim::TiltSensor sensor) const {
    return [world = world_, sensor](Timestamp when) { return world->TiltReading(sensor, when); };
  }
  void StartCamera() {
    auto started = GigeSimulator::Start({}, world_, {});
    ASSERT_TRUE(started.has_value()) << started.error();
    gige_ = std::move(started).value();
  }
  // The emulator takes two words more than the box: the folder of its libraries and the shim.
  std::unique_ptr<Process> StartBox(std::vector<std::string> before = {}) const {
    std::vector<std::string> command = std::move(before);
    for (const std::string& word : {std::string("qemu-arm"),
                                    std::string("-cpu"),
                                    std::string("cortex-a8"),
                                    std::string("-L"),
                                    kSysroot,
                                    std::string("-E"),
                                    "LD_PRELOAD=" + kArmTree + "/bin/libmulticast_shim.so",
                                    kArmTree + "/bin/camera_box",
                                    folder_ / "camera_box.yaml"}) {
      command.push_back(word);
    }
    return std::make_unique<Process>(command);
  }
  // Largest error of the shield head [m]; every pose has to be inside its own bound.
  double WorstError_m(const std::vector<dds::RelativePose>& poses) const {
    double worst_m = 0.0;
    for (const dds::RelativePose& pose : poses) {
      if (pose.status == PoseStatus::kNone) continue;
      const Eigen::Vector3d truth =
          world_->At(pose.sensed_at).camera_from_target * Eigen::Vector3d(0.0, 0.0, -1.6);
      const double error_m = (pose.points[0].p_in_camera - truth).norm();
      EXPECT_TRUE(pose.points[0].bound_m.has_value());
      EXPECT_LT(error_m, pose.points[0].bound_m.value_or(0.0));
      worst_m = std::max(worst_m, error_m);
    }
    return worst_m;
  }

  const SystemClock clock_{};
  test::TempFolder folder_;
  std::shared_ptr<const sim::World> world_;
  std::unique_ptr<GigeSimulator> gige_;
  std::unique_ptr<ModbusEmulator> target_;
  std::unique_ptr<ModbusEmulator> camera_;
};

TEST_F(BoxOnArm, PosesArriveHoldAgainstTheTruthAndReachWhoComesLate) {
  MachineWatcher watcher(kDomain);
  const auto box = StartBox();
  ASSERT_TRUE(Eventually([&] { return watcher.OkCount() >= 30; }, 40s)) << box->Output();
  EXPECT_LT(WorstError_m(watcher.Poses()), 0.004);

  // Health is latched: who comes now has it at once, and poses with the next frames.
  const MachineWatcher late(kDomain);
  EXPECT_TRUE(Eventually([&] { return late.IsIn("camera", DeviceState::kStreaming); }, 10s));
  EXPECT_TRUE(Eventually([&] { return late.OkCount() >= 5; }, 10s));

  box->Signal(SIGTERM);
  EXPECT_EQ(box->Wait(), 0) << box->Output();
}

// Cyclone DDS, its types made from the same IDL files.
TEST_F(BoxOnArm, AnotherVendorReadsIt) {
  const auto box = StartBox();
  Process reader({TBM_CYCLONE_PEER, "read", std::to_string(kDomain)},
                 {"CYCLONEDDS_URI=<CycloneDDS><Domain><General><Interfaces><NetworkInterface "
                  "name=\"lo\" multicast=\"true\"/></Interfaces></General></Domain></CycloneDDS>"});
  for (const char* topic : {"features", "inclination", "pose", "health", "event"}) {
    EXPECT_TRUE(Eventually([&] { return reader.HasLine(std::string(topic) + ".end"); }, 30s))
        << topic << "\n"
        << reader.Output();
  }
  EXPECT_TRUE(reader.HasLine("pose.machine_id=TBM-1")) << reader.Output();
}

TEST_F(BoxOnArm, AKilledBoxIsFollowedByAnotherAndItsRecordingCanBeRead) {
  MachineWatcher watcher(kDomain);
  const auto box = StartBox();
  ASSERT_TRUE(Eventually([&] { return watcher.OkCount() >= 25; }, 40s)) << box->Output();
  box->Signal(SIGKILL);
  box->Wait();
  std::string run;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "runs")) {
    run = entry.path();
  }
  const auto recorded = ReadRun(run);
  ASSERT_TRUE(recorded.has_value());
  EXPECT_GE(recorded->frames.size(), 15u);

  const std::size_t before = watcher.OkCount();
  const auto next = StartBox();
  EXPECT_TRUE(Eventually([&] { return watcher.OkCount() >= before + 10; }, 40s)) << next->Output();
}

TEST_F(BoxOnArm, AnUnpluggedCameraAndASilentInclinometerAreSaidAndTakenBack) {
  MachineWatcher watcher(kDomain);
  const auto box = StartBox();
  ASSERT_TRUE(Eventually([&] { return watcher.OkCount() >= 5; }, 40s)) << box->Output();

  gige_.reset();
  EXPECT_TRUE(Eventually([&] { return !watcher.IsIn("camera", DeviceState::kStreaming); }, 10s));
  EXPECT_TRUE(Eventually(
      [&] { return box->Output().find("code=no_pose active=true") != std::string::npos; }, 10s))
      << box->Output();
  EXPECT_TRUE(watcher.IsIn("inclinometer_target", DeviceState::kStreaming));
  StartCamera();
  std::size_t before = watcher.OkCount();
  EXPECT_TRUE(Eventually([&] { return watcher.OkCount() >= before + 5; }, 30s)) << box->Output();

  target_->faults().SetLasting(EmulatorFault{EmulatorFaultKind::kDrop});
  EXPECT_TRUE(Eventually(
      [&] { return !watcher.IsIn("inclinometer_target", DeviceState::kStreaming); }, 10s));
  EXPECT_TRUE(Eventually(
      [&] { return watcher.Count(PoseStatus::kDegraded, PoseReason::kTiltStale) >= 5; }, 10s))
      << box->Output();
  target_->faults().SetLasting({});
  before = watcher.OkCount();
  EXPECT_TRUE(Eventually([&] { return watcher.OkCount() >= before + 5; }, 20s)) << box->Output();
  EXPECT_LT(WorstError_m(watcher.Poses()), 0.02) << "without a tilt it is worse, and says so";
}

// The recorder leaves 500 MB of any disk free.
TEST_F(BoxOnArm, AFullDiskEndsTheRecordingAndNothingElse) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can mount a small disk";
  std::filesystem::create_directory(folder_ / "runs");
  MachineWatcher watcher(kDomain);
  const auto box =
      StartBox({"unshare",
                "-m",
                "sh",
                "-c",
                "mount -t tmpfs -o size=506m none " + (folder_ / "runs") + " && exec \"$@\"",
                "sh"});
  ASSERT_TRUE(Eventually([&] { return watcher.IsIn("recorder", DeviceState::kSilent); }, 60s))
      << box->Output();
  const std::size_t before = watcher.OkCount();
  EXPECT_TRUE(Eventually([&] { return watcher.OkCount() >= before + 10; }, 10s)) << box->Output();
  EXPECT_TRUE(watcher.IsIn("camera", DeviceState::kStreaming));
  box->Signal(SIGTERM);
  EXPECT_EQ(box->Wait(), 0) << box->Output();
}

}  // namespace
}  // namespace tbm
