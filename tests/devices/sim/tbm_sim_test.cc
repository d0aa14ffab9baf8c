#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "devices/inclinometer/make_inclinometers.h"
#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"
#include "tests/devices/camera/gige_bench.h"
#include "tests/support/process.h"
#include "tests/support/scene.h"
#include "tests/support/temp_folder.h"

namespace tbm::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

struct TrueRow {
  Timestamp sensed_at;
  Rigid3 camera_from_target;
};

std::vector<TrueRow> ReadTruth(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  std::vector<TrueRow> rows;
  while (std::getline(file, line)) {
    for (char& c : line) c = c == ',' ? ' ' : c;
    std::istringstream fields(line);
    TrueRow row;
    Eigen::Quaterniond& q = row.camera_from_target.rotation;
    Eigen::Vector3d t_mm;
    fields >> row.sensed_at.ns >> q.w() >> q.x() >> q.y() >> q.z() >> t_mm.x() >> t_mm.y() >>
        t_mm.z();
    row.camera_from_target.translation = 1e-3 * t_mm;
    if (fields) rows.push_back(row);
  }
  return rows;
}

// One command gives a whole machine whose parts agree: the camera's images, the inclinometers on
// their ports and truth.csv are of one world.
class TbmSim : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    WriteText(Path("rig.yaml"), SmallRigYaml());
    simulator_.emplace(std::vector<std::string>{TBM_SIM,
                                                "--rig",
                                                Path("rig.yaml"),
                                                "--truth",
                                                Path("truth.csv"),
                                                "--target-port",
                                                Path("target"),
                                                "--camera-port",
                                                Path("camera"),
                                                "--tilt-protocol",
                                                GetParam(),
                                                "--seed",
                                                "5"});
  }
  std::string Path(const char* name) const { return folder_ / name; }

  InclinometerConfig Tilt(const char* name, int address) const {
    InclinometerConfig config;
    config.name = name;
    config.driver = *InclinometerDriverFromWord(GetParam());
    config.port.path = Path(name);
    config.port.baud = 115200;
    config.address = address;
    config.registers.function = 4;
    config.registers.format = RegisterFormat::kInt32;
    config.registers.beta_register = 0;
    config.registers.gamma_register = 2;
    config.registers.rad_per_lsb = DegToRad(0.0001);
    return config;
  }

  TempFolder folder_;
  std::optional<Process> simulator_;
  const SystemClock clock_{};
};

TEST_P(TbmSim, CameraInclinometersAndTruthAreOfOneWorld) {
  const auto camera = MakeCamera(GigeConfig(10.0), clock_);
  const std::vector<InclinometerConfig> configs = {Tilt("target", 1), Tilt("camera", 2)};
  SystemSleeper sleeper;
  const auto tilts = MakeInclinometers(configs, {}, clock_, sleeper);
  ASSERT_TRUE(NextFrame(*camera, seconds(10)));

  const Rig rig = SmallRig();
  for (int i = 0; i < 10; ++i) {
    const auto frame = NextFrame(*camera);
    ASSERT_TRUE(frame);
    std::vector<Eigen::Vector3d> ups;
    for (const auto& tilt : tilts) {
      const auto sample = tilt->Read(std::chrono::steady_clock::now() + seconds(2));
      ASSERT_TRUE(sample) << FailureCode(sample.error());
      ups.push_back(*UpInTilt(sample->raw));
    }
    if (i < 5) continue;  // the camera's clock is being learned
    const std::vector<TrueRow> truth = ReadTruth(Path("truth.csv"));
    const TrueRow* nearest = nullptr;
    for (const TrueRow& row : truth) {
      if (std::abs((row.sensed_at - frame->sensed_at).count()) < 50'000'000) nearest = &row;
    }
    ASSERT_NE(nearest, nullptr);
    const Rigid3& camera_from_target = nearest->camera_from_target;

    // R u_T = u_C, both from the wire; 0.005 degree of noise on each of four outputs.
    const Eigen::Vector3d up_in_target = rig.target_tilt.tilt_from_body.transpose() * ups[0];
    const Eigen::Vector3d up_in_camera = rig.camera_tilt.tilt_from_body.transpose() * ups[1];
    EXPECT_LT((camera_from_target.rotation * up_in_target - up_in_camera).norm(), DegToRad(0.06));

    const auto* const pixels = static_cast<const std::uint8_t*>(frame->image.pixels);
    for (const Led& led : rig.leds) {
      const Eigen::Vector2d pixel = ExactPixel({320, 256, 755, 755, 160, 128, 0, 0, 0, 0, 0},
                                               camera_from_target * led.p_led_in_target);
      const auto at = std::lround(pixel.y()) * 320 + std::lround(pixel.x());
      EXPECT_GT(pixels[at], 100) << led.id;
    }
  }
}

TEST_P(TbmSim, EndsOnSigtermWithCodeZeroAndTakesItsPortsAway) {
  const auto until = std::chrono::steady_clock::now() + seconds(10);
  while (!std::filesystem::exists(Path("camera")) && std::chrono::steady_clock::now() < until) {
    usleep(20'000);
  }
  ASSERT_TRUE(std::filesystem::exists(Path("camera")));
  usleep(300'000);
  simulator_->Signal(SIGTERM);
  EXPECT_EQ(simulator_->Wait(), 0) << simulator_->Output();
  EXPECT_FALSE(std::filesystem::is_symlink(Path("camera")));
  EXPECT_FALSE(std::filesystem::is_symlink(Path("target")));
}

INSTANTIATE_TEST_SUITE_P(Protocols, TbmSim, ::testing::Values("modbus", "rion68", "bewis77"));

}  // namespace
}  // namespace tbm::test
