#include <filesystem>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "guidance/app/calibrate_command.h"
#include "guidance/app/line_command.h"
#include "guidance/config/rail_file.h"
#include "guidance/config/rail_file_text.h"
#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"
#include "tests/guidance/rail_vision/image_run.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::Outcome;
using test::Ran;
using test::ReadText;
using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

// A run driven for the purpose; its rail.yaml has the camera where somebody guessed it.
class CalibrateImu : public ::testing::Test {
 protected:
  void Drive(double turns_deg) {
    RailScene scene;
    scene.seed = 31;
    scene.has_spread_targets = true;
    scene.turns_deg = turns_deg;
    scene.speed_m_s = 0.1;
    scene.image_late_s = 0.005;
    truth_ = GenerateRail(scene);
    GeneratedRun guessed = truth_;
    RailCamera& camera = *guessed.setup.camera;
    camera.camera_from_imu =
        ExpRotation(DegToRad(0.6) * Eigen::Vector3d(1.0, -0.8, 0.5)) * truth_.camera_from_imu;
    camera.in_imu_m = truth_.camera_in_imu_m + Eigen::Vector3d(0.02, 0.015, -0.02);
    run_ = std::make_unique<test::ImageRun>(std::move(guessed));
    run_->WriteRun();
    // As the generator has it.
    rail_yaml_ = ReadText(*run_ / "rail.yaml");
    Replace("residual_px: 0.06", "residual_px: 0.1");
    test::WriteText(*run_ / "rail.yaml", rail_yaml_);
    std::vector<test::ImageTarget> targets;
    for (const SurveyedTarget& target : truth_.recording.targets) {
      targets.push_back({target.name, "", target.in_world_m});
    }
    run_->WriteTargets(targets);
    run_->WriteCentres();
  }
  void Replace(const std::string& from, const std::string& to) {
    const std::size_t at = rail_yaml_.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    rail_yaml_.replace(at, from.size(), to);
  }

  CalibrateImuRequest Request() const {
    CalibrateImuRequest request;
    request.run = run_->path();
    request.out = folder_ / "rail.yaml";
    return request;
  }
  Outcome Refused() const {
    const Outcome outcome = Ran(RunCalibrateImu, Request());
    EXPECT_EQ(outcome.code, ExitCode::kBadInput) << outcome.out;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "rail.yaml"));
    return outcome;
  }

  GeneratedRun truth_;
  std::unique_ptr<test::ImageRun> run_;
  std::string rail_yaml_;
  test::TempFolder folder_;
};

TEST_F(CalibrateImu, WritesTheRailFileWithTheCameraAsItIsBuilt) {
  Drive(10.0);
  const Outcome outcome = Ran(RunCalibrateImu, Request());
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  std::printf("%s", outcome.out.c_str());
  EXPECT_EQ(outcome.err, "");

  const auto setup = ParseRailSetup(ReadText(folder_ / "rail.yaml"), "rail.yaml");
  ASSERT_TRUE(setup);
  const RailCamera& found = *setup->camera;
  const double off_rad =
      LogRotation(truth_.camera_from_imu * found.camera_from_imu.conjugate()).norm();
  const double off_m = (truth_.camera_in_imu_m - found.in_imu_m).norm();
  const double off_s = std::abs(-0.005 - found.time_offset_s);
  EXPECT_LT(RadToDeg(off_rad), 0.05);
  EXPECT_LT(off_m, 0.018);
  EXPECT_LT(off_s, 1e-3);
  // Three axes each, beyond 4 sigma of the worst of them once in many thousand runs.
  EXPECT_LT(off_rad, 4.0 * found.sigma_rotation_rad);
  EXPECT_LT(off_m, 4.0 * found.sigma_position_m);
  EXPECT_LT(off_s, 4.0 * found.sigma_time_offset_s);
  // Where it stands is known to a tenth of a millimetre at the start.
  EXPECT_LT(found.sigma_position_m, 3e-4);
  EXPECT_GT(found.sigma_position_m, 5e-5);

  // Nothing else of the file has changed.
  const std::string text = ReadText(folder_ / "rail.yaml");
  EXPECT_THAT(text, StartsWith(rail_yaml_.substr(0, rail_yaml_.find("camera:"))));
  EXPECT_THAT(text, EndsWith(rail_yaml_.substr(rail_yaml_.find("start:"))));

  const auto report = nlohmann::json::parse(ReadText(folder_ / "rail.json"));
  EXPECT_EQ(report["covariance"].size(), 13u);
  EXPECT_NEAR(report["covariance"][6][6],
              found.sigma_time_offset_s * found.sigma_time_offset_s,
              1e-6 * found.sigma_time_offset_s);
  EXPECT_GT(report["images"], 100);
}

TEST_F(CalibrateImu, TheLineIsBetterWithIt) {
  Drive(10.0);
  const auto off_mm = [&] {
    const Outcome line =
        Ran(RunLine, LineRequest{run_->path(), folder_ / "line.csv", "smoothed", true});
    if (line.code != ExitCode::kDone) return 1e9;
    const auto truth = nlohmann::json::parse(ReadText(folder_ / "line.json"))["truth"];
    return truth["largest_mm"][0].get<double>() + truth["largest_mm"][1].get<double>() +
           truth["largest_mm"][2].get<double>();
  };
  const double guessed_mm = off_mm();
  CalibrateImuRequest request = Request();
  request.out = run_->path() + "/rail.yaml";
  EXPECT_THAT(Ran(RunCalibrateImu, request).err, HasSubstr("--force"));
  request.force = true;
  ASSERT_EQ(Ran(RunCalibrateImu, request).code, ExitCode::kDone);
  const double calibrated_mm = off_mm();
  std::printf("sum of the largest %.2f mm, was %.2f\n", calibrated_mm, guessed_mm);
  EXPECT_LT(calibrated_mm, 3.0);
  EXPECT_GT(guessed_mm, 3.0 * calibrated_mm);
}

TEST_F(CalibrateImu, NamesTheMotionThatIsMissing) {
  Drive(0.0);
  rail_yaml_ = ReadText(*run_ / "rail.yaml");
  Replace("sigma_position_mm: 0.1, ", "sigma_position_mm: 20, ");
  test::WriteText(*run_ / "rail.yaml", rail_yaml_);
  EXPECT_THAT(Refused().err,
              AllOf(HasSubstr("no calibration: the run does not tell"),
                    HasSubstr("the run does not tell the lever arm: turn it about two axes")));
}

TEST_F(CalibrateImu, SaysWhichFileIsWrong) {
  Drive(10.0);
  const auto refused_with = [&](const std::string& file, const std::string& text) {
    const std::string good = ReadText(*run_ / file);
    test::WriteText(*run_ / file, text);
    const std::string said = Refused().err;
    test::WriteText(*run_ / file, good);
    return said;
  };
  const std::size_t camera = rail_yaml_.find("camera:");
  const std::size_t start = rail_yaml_.find("start:");
  std::string start_line = rail_yaml_.substr(start);
  EXPECT_THAT(refused_with("rail.yaml", rail_yaml_.substr(0, camera) + start_line),
              AllOf(HasSubstr("warning: " + run_->path() + "/centres.csv: is not used"),
                    HasSubstr(run_->path() + "/")));
  start_line.replace(start_line.find("heading_known: false"),
                     20,
                     "heading_known: true, heading_deg: -90, sigma_heading_deg: 5");
  EXPECT_THAT(refused_with("rail.yaml", rail_yaml_.substr(0, camera) + start_line),
              HasSubstr("rail.yaml: has no section camera"));
  const std::string centres = ReadText(*run_ / "centres.csv");
  EXPECT_THAT(refused_with("centres.csv", centres.substr(0, centres.find('\n', 400) + 1)),
              HasSubstr("centres.csv: fewer than ten images"));
  std::string moving = rail_yaml_;
  moving.replace(moving.find("at_rest_s: "), 12, "at_rest_s: 1");
  EXPECT_THAT(refused_with("rail.yaml", moving), HasSubstr("start.at_rest_s"));
  // A root in braces has no line of its own for the camera.
  EXPECT_FALSE(WithSection("{imu: 1, camera: {a: 1}}\n", "camera", "camera:\n"));
}

TEST(WithSection, LeavesEveryOtherLineAsItIs) {
  const std::string before = "# head\r\nimu: {a: 1}   # one\n\n";
  const std::string after = "# about the start\n\nstart:\n  camera: 3\n";
  EXPECT_EQ(WithSection(before + "camera: # old\n  a: 1\n\n  # inside\n  b: [1,\n   2]\n" + after,
                        "camera",
                        "camera:\n  a: 2\n"),
            before + "camera:\n  a: 2\n" + after);
  EXPECT_EQ(WithSection(before + "camera:\n  a: 1", "camera", "camera: 2\n"),
            before + "camera: 2\n");
  EXPECT_FALSE(WithSection(before + after, "camera", ""));
}

}  // namespace
}  // namespace tbm
