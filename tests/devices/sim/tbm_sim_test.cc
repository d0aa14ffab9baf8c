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
#include "devices/total_station/make_total_station.h"
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

std::vector<std::vector<double>> ReadNumbers(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  std::vector<std::vector<double>> rows;
  while (std::getline(file, line)) {
    for (char& c : line) c = c == ',' ? ' ' : c;
    std::istringstream fields(line);
    std::vector<double> row;
    for (double value = 0.0; fields >> value;) row.push_back(value);
    if (row.size() == 15) rows.push_back(std::move(row));
  }
  return rows;
}

// In its tunnel the machine has a total station behind it, which sees the prism where machine.yaml
// and the rear shield's true place put it.
TEST(TbmSimInItsTunnel, TotalStationSeesThePrismsOfTheRearShield) {
  const TempFolder folder;
  const std::string example = TBM_SOURCE_DIR "/guidance/app/example/";
  WriteText(folder / "machine.yaml", ReadText(example + "machine.yaml"));
  WriteText(folder / "axis.xml", ReadText(example + "axis.xml"));
  WriteText(folder / "references.csv", "name,x_m,y_m,z_m\nR1,1000.0,5004.0,101.5\n");
  WriteText(folder / "rig.yaml", SmallRigYaml());
  const Process simulator({TBM_SIM,
                           "--machine",
                           folder / "machine.yaml",
                           "--chainage",
                           "2090",
                           "--truth",
                           folder / "truth.csv",
                           "--target-port",
                           folder / "target",
                           "--camera-port",
                           folder / "camera",
                           "--references",
                           folder / "references.csv",
                           "--station",
                           "1017.8,5017.7,101.6",
                           "--circle-zero-deg",
                           "20",
                           "--station-port",
                           "0",
                           "--hide",
                           "RS2",
                           "--angle-sigma-arcsec",
                           "0",
                           "--slope-sigma-mm",
                           "0",
                           "--refraction-k",
                           "0",
                           "--earth-radius-m",
                           "1e15"});
  TotalStationConfig config;
  const auto until = std::chrono::steady_clock::now() + seconds(20);
  const std::string shields = folder / "truth_shields.csv";
  while (ReadNumbers(shields).empty() && std::chrono::steady_clock::now() < until) usleep(50'000);
  for (const std::string& line : simulator.Lines()) {
    if (!line.starts_with("total_station address=127.0.0.1 port=")) continue;
    config.tcp_port = std::stoi(line.substr(line.find("port=") + 5));
    EXPECT_NE(line.find(" prisms=5 "), std::string::npos) << line;
  }
  const auto rows = ReadNumbers(shields);
  ASSERT_FALSE(rows.empty()) << simulator.Output();
  const std::vector<double>& row = rows.back();
  // Gripped: the rear shield stands.
  const Rigid3 site_from_rear{Eigen::Quaterniond(row[1], row[2], row[3], row[4]),
                              {row[5], row[6], row[7]}};
  EXPECT_NEAR(
      (site_from_rear.translation - Eigen::Vector3d(1057.85, 5068.94, 98.65)).norm(), 0.0, 0.05)
      << "90 m into the axis, give or take the wander";
  const SystemClock clock;
  SystemSleeper sleeper;
  const auto station = MakeTotalStation(config, clock, sleeper);
  ASSERT_TRUE(station->Connect(std::chrono::steady_clock::now() + seconds(5)));
  const Eigen::Vector3d pillar(1017.8, 5017.7, 101.6);
  const auto reading = [&](const Eigen::Vector3d& p_in_rear_shield) {
    const Eigen::Vector3d way = site_from_rear * p_in_rear_shield - pillar;
    return CircleReading{
        std::fmod(std::atan2(way.x(), way.y()) - DegToRad(20.0) + 2.0 * M_PI, 2.0 * M_PI),
        std::acos(way.z() / way.norm())};
  };
  const Eigen::Vector3d rs1(-4.2, 2.2, 0.6);
  CircleReading roughly = reading(rs1);
  roughly.horizontal_rad += 0.002;
  ASSERT_TRUE(station->TurnTo(roughly, Aim::kPrism));
  const auto seen = station->Measure();
  ASSERT_TRUE(seen);
  ASSERT_TRUE(seen->slope_m);
  EXPECT_NEAR(seen->circles.horizontal_rad, reading(rs1).horizontal_rad, 2e-6);
  EXPECT_NEAR(seen->circles.zenith_rad, reading(rs1).zenith_rad, 2e-6);
  EXPECT_NEAR(*seen->slope_m, (site_from_rear * rs1 - pillar).norm(), 1e-4);
  EXPECT_FALSE(station->TurnTo(reading({-4.2, -2.2, 0.6}), Aim::kPrism)) << "RS2 is hidden";
}

INSTANTIATE_TEST_SUITE_P(Protocols, TbmSim, ::testing::Values("modbus", "rion68", "bewis77"));

}  // namespace
}  // namespace tbm::test
