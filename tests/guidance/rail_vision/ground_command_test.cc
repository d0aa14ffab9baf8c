#include "guidance/app/ground_command.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "guidance/app/line_command.h"
#include "guidance/app/rail_run.h"
#include "pose/base/angle.h"
#include "tests/guidance/rail_vision/ground_picture.h"
#include "tests/guidance/rail_vision/image_run.h"

namespace tbm {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

constexpr double kRest_s = 4.0;
constexpr double kRun_s = 12.0;
constexpr double kSpeed_m_s = 0.25;
// What rail.yaml says is 0.6 % too little.
constexpr double kHeight_m = 0.503;
constexpr double kToldHeight_m = 0.5;

// A level, straight rail along x; a smooth start, and it never stops. Targets ahead are seen at the
// beginning and at the end.
double PlaceAt(double t) {
  const double u = t - kRest_s;
  if (u <= 0.0) return 0.0;
  if (u >= 1.0) return kSpeed_m_s * (u - 0.5);
  return kSpeed_m_s * (u * u / 2.0 + (std::cos(2.0 * std::numbers::pi * u) - 1.0) /
                                         (4.0 * std::numbers::pi * std::numbers::pi));
}
double ForceAt(double t) {
  const double u = t - kRest_s;
  return u <= 0.0 || u >= 1.0 ? 0.0 : kSpeed_m_s * (1.0 - std::cos(2.0 * std::numbers::pi * u));
}

// It yaws to and fro: the camera, beside the unit, then moves otherwise than the unit does.
constexpr double kYaw_rad = 0.02;
constexpr double kYawTurn_rad_s = 2.0 * std::numbers::pi / 4.0;
double YawAt(double t) {
  return kYaw_rad * (1.0 - std::cos(kYawTurn_rad_s * std::max(0.0, t - kRest_s)));
}
double YawRateAt(double t) {
  return kYaw_rad * kYawTurn_rad_s * std::sin(kYawTurn_rad_s * std::max(0.0, t - kRest_s));
}
Eigen::Quaterniond AttitudeAt(double t) { return ExpRotation({0.0, 0.0, YawAt(t)}); }

test::GeneratedRun StraightRun(std::uint64_t seed) {
  constexpr double kRate_hz = 200.0;
  constexpr double kGravity_m_s2 = 9.80665;
  const Eigen::Vector3d imu_at(0.0, 0.0, kHeight_m);
  test::Random random("straight run", seed);
  test::GeneratedRun run;
  RailSetup& setup = run.setup;
  setup.imu.rate_hz = kRate_hz;
  setup.imu.noise.angle_random_walk_rad = DegToRad(0.2) / 60.0;
  setup.imu.noise.velocity_random_walk_m_s = 30e-6 * kGravity_m_s2;
  setup.tilt = TiltMounting{Eigen::Quaterniond::Identity(), DegToRad(0.003)};
  setup.start.position_world_m = imu_at + random.Normal3(1e-4);
  setup.start.at_rest_s = kRest_s - 0.5;
  setup.start.heading_rad = 0.0;
  setup.start.sigma_heading_rad = DegToRad(0.05);
  run.gyro_bias_rad_s = random.Normal3(DegToRad(30.0) / 3600.0);
  run.accel_bias_m_s2 = random.Normal3(1e-3 * kGravity_m_s2);

  RailGroundCamera ground;
  ground.model = test::GroundCamera();
  ground.camera_from_imu = test::LookingDown().conjugate();
  ground.in_imu_m = {0.2, -0.15, 0.0};
  ground.height_m = kToldHeight_m;
  ground.sigma_height_m = 0.005;
  setup.ground = ground;
  RailCamera camera;
  camera.model = test::TrolleyCamera();
  Eigen::Matrix3d ahead;
  ahead << 0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0;
  camera.camera_from_imu = Eigen::Quaterniond(ahead);
  camera.in_imu_m = {0.1, 0.0, 0.1};
  setup.camera = camera;
  for (int i = 0; i < 6; ++i) {
    run.recording.targets.push_back(
        {.name = "T" + std::to_string(i),
         .in_world_m = {6.0 + 0.2 * (i % 2), 0.5 * (i % 3) - 0.5, 0.3 + 0.3 * (i / 2)},
         .sigma_m = 3e-5,
         .by_mode = {}});
  }
  const double whole_s = kRest_s + kRun_s;
  for (int i = 1; i <= static_cast<int>(whole_s * kRate_hz); ++i) {
    const double t = i / kRate_hz;
    const Timestamp at{1'790'000'000'000'000'000 + std::llround(t * 1e9)};
    ImuSample sample;
    sample.ends_at = at;
    sample.interval_s = 1.0 / kRate_hz;
    const double root = std::sqrt(sample.interval_s);
    const double middle = t - 0.5 / kRate_hz;
    sample.gyro_rad_s = Eigen::Vector3d(0.0, 0.0, YawRateAt(middle)) + run.gyro_bias_rad_s +
                        random.Normal3(setup.imu.noise.angle_random_walk_rad / root);
    sample.accel_m_s2 =
        AttitudeAt(middle).conjugate() * Eigen::Vector3d(ForceAt(middle), 0.0, kGravity_m_s2) +
        run.accel_bias_m_s2 + random.Normal3(setup.imu.noise.velocity_random_walk_m_s / root);
    run.recording.imu.push_back(sample);
    const Eigen::Vector3d place = imu_at + Eigen::Vector3d(PlaceAt(t), 0.0, 0.0);
    run.truth.push_back({at, place, AttitudeAt(t)});
    if (i % 10 == 0 && t < kRest_s) {
      run.recording.tilts.push_back(
          {at, {random.Normal(setup.tilt->sigma_rad), random.Normal(setup.tilt->sigma_rad)}});
    }
    const bool sees_targets = t < kRest_s || t > whole_s - 1.0;
    if (i % 40 != 0 || !sees_targets) continue;
    TargetImage image{at, {}};
    for (std::size_t k = 0; k < run.recording.targets.size(); ++k) {
      const Eigen::Vector3d in_imu =
          AttitudeAt(t).conjugate() * (run.recording.targets[k].in_world_m - place);
      const auto seen = Project(camera.model, camera.camera_from_imu * (in_imu - camera.in_imu_m));
      image.pixels.push_back({static_cast<int>(k), seen->pixel_px + random.Normal2(0.05)});
    }
    run.recording.images.push_back(image);
  }
  return run;
}

class GroundCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    run_ = new test::ImageRun(StraightRun(1));
    run_->WriteRun();
    std::vector<test::ImageTarget> targets;
    for (const SurveyedTarget& target : run_->run().recording.targets) {
      targets.push_back({target.name, "", target.in_world_m});
    }
    run_->WriteTargets(targets);
    run_->WriteCentres();
    test::Scenery ground;
    ground.patches.push_back(test::GroundPatch(3));
    run_->WriteGroundFrames(ground, 0.2);
  }
  static void TearDownTestSuite() {
    delete run_;
    run_ = nullptr;
  }

  static std::string Ground(const std::string& out, ExitCode expected = ExitCode::kDone) {
    std::ostringstream told;
    std::ostringstream complained;
    EXPECT_EQ(RunGround({run_->path(), out, true}, {told, complained}), expected)
        << complained.str();
    return told.str() + complained.str();
  }
  static Json Truth() {
    std::ostringstream told;
    std::ostringstream complained;
    EXPECT_EQ(RunLine({run_->path(), *run_ / "line.csv", "smoothed", true}, {told, complained}),
              ExitCode::kDone)
        << complained.str();
    said_ = complained.str();
    return Json::parse(test::ReadText(*run_ / "line.json"));
  }

  static test::ImageRun* run_;
  static std::string said_;
};
test::ImageRun* GroundCommand::run_ = nullptr;
std::string GroundCommand::said_;

TEST_F(GroundCommand, HoldsTheLineWhereNoTargetIsSeen) {
  std::filesystem::remove(*run_ / "displacement.csv");
  const Json without = Truth();
  EXPECT_THAT(said_, HasSubstr("tbm ground"));
  std::printf("%s", Ground(*run_ / "displacement.csv").c_str());
  const Json with = Truth();
  EXPECT_EQ(said_, "");
  const char* axes = "xyz";
  for (std::size_t i = 0; i < 3; ++i) {
    std::printf("largest deviation %c: %.2f mm without the ground, %.2f mm with it\n",
                axes[i],
                without["truth"]["largest_mm"][i].get<double>(),
                with["truth"]["largest_mm"][i].get<double>());
  }
  std::printf("error over sigma %.2f without, %.2f with\n",
              without["truth"]["error_over_sigma"].get<double>(),
              with["truth"]["error_over_sigma"].get<double>());
  for (const std::size_t i : {0u, 1u}) {
    EXPECT_LT(with["truth"]["rms_mm"][i], 0.6 * without["truth"]["rms_mm"][i].get<double>());
  }
  EXPECT_LT(with["truth"]["error_over_sigma"], 1.6);
  const Json& kind = with["consistency"]["image_displacement"];
  EXPECT_GT(kind["accepted"], 0.9 * kind["given"].get<double>());
  EXPECT_LT(kind["nis_per_dof"], 1.6);
  EXPECT_GT(kind["nis_per_dof"], 0.5);
  // The height comes out of it.
  for (const Json& one : with["estimates"]) {
    if (one["what"] != "ground_height_scale") continue;
    std::printf(
        "height scale %.5f +- %.5f\n", one["value"].get<double>(), one["sigma"].get<double>());
    EXPECT_NEAR(one["value"], kHeight_m / kToldHeight_m - 1.0, 4.0 * one["sigma"].get<double>());
    EXPECT_LT(one["sigma"], 0.002);
  }
}

TEST_F(GroundCommand, SaysWhatIsMissing) {
  const auto complaint = [&](const std::string& file, const std::string& text) {
    const std::string good = test::ReadText(*run_ / file);
    test::WriteText(*run_ / file, text);
    const std::string said = Ground(*run_ / "out.csv", ExitCode::kBadInput);
    test::WriteText(*run_ / file, good);
    return said;
  };
  std::string yaml = test::ReadText(*run_ / "rail.yaml");
  const std::size_t from = yaml.find("ground_camera:");
  const auto with = [&](const std::string& good, const std::string& bad) {
    std::string changed = yaml;
    changed.replace(changed.find(good, from), good.size(), bad);
    return complaint("rail.yaml", changed);
  };
  EXPECT_THAT(complaint("rail.yaml", yaml.substr(0, from) + yaml.substr(yaml.find("start:"))),
              HasSubstr("rail.yaml: has no section ground_camera"));
  EXPECT_THAT(with("height_m: 0.5", "height_m: 0.01"), HasSubstr("ground_camera.height_m"));
  EXPECT_THAT(with("height_m: 0.5", "high_m: 0.5"),
              testing::AllOf(HasSubstr("ground_camera.height_m"), HasSubstr("high_m")));
  EXPECT_THAT(with("sigma_height_mm: 5", "sigma_height_mm: 0"),
              HasSubstr("ground_camera.sigma_height_mm"));
  EXPECT_THAT(with("rotation: [", "rotation: [2, "), HasSubstr("ground_camera.rotation"));
  EXPECT_THAT(with("image_width: 640", "image_width: 0"), HasSubstr("ground_camera.image_width"));
  EXPECT_THAT(complaint("ground_frames.csv", "stamp_ns,file\n"),
              HasSubstr("ground_frames.csv: has no images"));
}

TEST_F(GroundCommand, ReadsOnlyDisplacementsThatCanBe) {
  const std::string header = "from_ns,to_ns,dx_m,dy_m,sigma_m\n";
  const auto complaint = [&](const std::string& rows) {
    test::WriteText(*run_ / "displacement.csv", header + rows);
    const auto run = ReadRailRun(run_->path());
    std::filesystem::remove(*run_ / "displacement.csv");
    return run ? std::string() : run.error().front().Text();
  };
  EXPECT_EQ(complaint("1,5,0.1,0.0,0.001\n5,9,0.1,0.0,0.001\n"), "");
  EXPECT_THAT(complaint("5,5,0.1,0.0,0.001\n"), HasSubstr("displacement.csv:2: column from_ns"));
  EXPECT_THAT(complaint("1,5,0.1,0.0,0.001\n4,9,0.1,0.0,0.001\n"),
              HasSubstr("displacement.csv:3: column from_ns"));
  EXPECT_THAT(complaint("1,5,0.1,nan,0.001\n"), HasSubstr("displacement.csv:2: column dy_m"));
  EXPECT_THAT(complaint("1,5,0.1,0.0,0\n"), HasSubstr("displacement.csv:2: column sigma_m"));
  EXPECT_THAT(complaint("a,5,0.1,0.0,0.1\n"), HasSubstr("displacement.csv:2: column from_ns"));
}

}  // namespace
}  // namespace tbm
