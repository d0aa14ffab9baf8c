#include "guidance/app/targets_command.h"

#include <cstdlib>
#include <filesystem>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "guidance/app/line_command.h"
#include "tests/guidance/rail_vision/image_run.h"

namespace tbm {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

struct Said {
  ExitCode code = ExitCode::kDone;
  std::string out;
  std::string err;
};

Said Targets(const std::string& run, const std::string& out) {
  std::ostringstream told;
  std::ostringstream complained;
  const ExitCode code = RunTargets({run, out, true}, {told, complained});
  return {code, told.str(), complained.str()};
}

Said Line(const std::string& run, const std::string& out) {
  std::ostringstream told;
  std::ostringstream complained;
  const ExitCode code = RunLine({run, out, "smoothed", true}, {told, complained});
  return {code, told.str(), complained.str()};
}

const std::vector<test::ImageTarget> kTargets = {{"C0", "coded:0", {0.55, 10.6, 1.35}},
                                                 {"C1", "coded:1", {1.55, 10.7, 1.95}},
                                                 {"K0", "circle:60", {1.02, 10.6, 1.9}},
                                                 {"K1", "circle:60", {1.5, 10.9, 1.4}},
                                                 {"L0", "led", {0.6, 10.6, 2.0}}};

// The targets on their wall, and things that nobody surveyed.
test::Scenery Wall() {
  test::Scenery scenery;
  scenery.wall = 0.3;
  scenery.full_dn = [](double across, double) { return 170.0 - 40.0 * across; };
  const Eigen::Vector3d viewer(1.0, 13.0, 1.5);
  const auto facing = [&](const Eigen::Vector3d& at, double turn) {
    return test::Facing(at, viewer, {0.2 * turn, turn, 0.1});
  };
  scenery.patches = {test::CodedPatch(facing(kTargets[0].in_world_m, 0.2), 0.12, 0),
                     test::CodedPatch(facing(kTargets[1].in_world_m, -0.3), 0.12, 1),
                     test::CirclePatch(facing(kTargets[2].in_world_m, 0.3), 0.06),
                     test::CirclePatch(facing(kTargets[3].in_world_m, -0.2), 0.06),
                     test::CirclePatch(facing({1.15, 10.6, 1.5}, 0.2), 0.06),
                     test::CodedPatch(facing({0.9, 10.6, 1.25}, 0.2), 0.1, 7),
                     test::PlainPatch(facing({0.45, 10.6, 1.7}, 0.1), 0.05, 0.05, 0.9)};
  scenery.lamps = {{kTargets[4].in_world_m, 120.0, 1.3}, {{1.3, 10.6, 1.7}, 120.0, 1.3}};
  return scenery;
}

test::GeneratedRun Generated() {
  test::RailScene scene;
  scene.seed = 11;
  scene.rest_s = 4.0;
  scene.end_rest_s = 2.0;
  test::GeneratedRun run = test::GenerateRail(scene);
  run.setup.camera->model = test::TrolleyCamera();
  return run;
}

class TargetsCommand : public testing::Test {
 protected:
  // Painting takes seconds: one run for all.
  static void SetUpTestSuite() {
    run_ = new test::ImageRun(Generated());
    run_->WriteRun();
    run_->WriteFrames(Wall(), 0.2);
  }
  static void TearDownTestSuite() {
    delete run_;
    run_ = nullptr;
  }
  void SetUp() override {
    run_->WriteTargets(kTargets);
    std::filesystem::remove(*run_ / "centres.csv");
  }
  static test::ImageRun* run_;
};
test::ImageRun* TargetsCommand::run_ = nullptr;

// Of the image points, how many are more than a pixel from where the target truly is.
int WrongPoints(const test::ImageRun& run, const std::vector<test::ImageTarget>& targets) {
  std::istringstream rows(test::ReadText(run / "centres.csv"));
  std::string row;
  std::getline(rows, row);
  int wrong = 0;
  while (std::getline(rows, row)) {
    std::istringstream fields(row);
    std::string stamp, name, u, v;
    std::getline(fields, stamp, ',');
    std::getline(fields, name, ',');
    std::getline(fields, u, ',');
    std::getline(fields, v, ',');
    const auto truth = std::find_if(run.run().truth.begin(),
                                    run.run().truth.end(),
                                    [&](const auto& t) { return t.at.ns == std::stoll(stamp); });
    const auto target =
        std::find_if(targets.begin(), targets.end(), [&](const auto& t) { return t.name == name; });
    const RailCamera& camera = *run.run().setup.camera;
    const Eigen::Vector3d in_imu =
        truth->world_from_imu.conjugate() * (target->in_world_m - truth->position_world_m);
    const auto seen = Project(camera.model, camera.camera_from_imu * (in_imu - camera.in_imu_m));
    const Eigen::Vector2d pixel(std::stod(u), std::stod(v));
    if (!seen || (seen->pixel_px - pixel).norm() > 1.0) ++wrong;
  }
  return wrong;
}

TEST_F(TargetsCommand, FindsTheTargetsFromWhichTheLineIsMade) {
  Said said = Line(run_->path(), *run_ / "line.csv");
  EXPECT_THAT(said.err, HasSubstr("tbm targets"));
  said = Targets(run_->path(), *run_ / "centres.csv");
  ASSERT_EQ(said.code, ExitCode::kDone) << said.err;
  std::printf("%s", said.out.c_str());
  EXPECT_EQ(WrongPoints(*run_, kTargets), 0);
  const Json report = Json::parse(test::ReadText(*run_ / "centres.json"));
  EXPECT_EQ(report["unreadable"], 0);
  ASSERT_EQ(report["targets"].size(), kTargets.size());
  // Each in most of the images in which it is.
  EXPECT_GT(report["seen"], 0.7 * 5 * report["frames"].get<double>());

  said = Line(run_->path(), *run_ / "line.csv");
  ASSERT_EQ(said.code, ExitCode::kDone) << said.err;
  EXPECT_EQ(said.err, "");
  std::printf("%s", said.out.c_str());
  const Json truth = Json::parse(test::ReadText(*run_ / "line.json"))["truth"];
  for (const auto& largest_mm : truth["largest_mm"]) EXPECT_LT(largest_mm, 1.0);
  EXPECT_GT(truth["error_over_sigma"], 0.4);
  EXPECT_LT(truth["error_over_sigma"], 1.6);
}

// Whoever surveyed them looks for them in the report.
TEST_F(TargetsCommand, ListsTargetsThatAreInNoImage) {
  auto targets = kTargets;
  targets.push_back({"BEHIND", "coded:8", {1.0, 30.0, 1.5}});
  targets.push_back({"BESIDE", "circle:60", {9.0, 10.6, 1.5}});
  targets.push_back({"UNMARKED", "", {1.0, 10.6, 1.5}});
  run_->WriteTargets(targets);
  ASSERT_EQ(Targets(run_->path(), *run_ / "centres.csv").code, ExitCode::kDone);
  const Json report = Json::parse(test::ReadText(*run_ / "centres.json"));
  ASSERT_EQ(report["targets"].size(), kTargets.size() + 2);
  for (const Json& one : report["targets"]) {
    const std::string name = one["target"];
    if (name != "BEHIND" && name != "BESIDE") continue;
    EXPECT_EQ(one, (Json{{"target", name}, {"outside", report["frames"]}, {"seen", 0}}));
  }
}

TEST_F(TargetsCommand, LeavesOutTargetsWhoseNamesAreExchanged) {
  auto targets = kTargets;
  targets.push_back({"C7", "coded:7", {0.9, 10.6, 1.25}});
  auto exchanged = targets;
  std::swap(exchanged[0].in_world_m, exchanged[5].in_world_m);
  run_->WriteTargets(exchanged);
  const Said said = Targets(run_->path(), *run_ / "centres.csv");
  std::printf("%s%s", said.out.c_str(), said.err.c_str());
  // Of three names two are wrong: nothing tells which, and nothing is taken for true.
  if (said.code == ExitCode::kDone) {
    EXPECT_EQ(WrongPoints(*run_, targets), 0);
  } else {
    EXPECT_THAT(said.err, HasSubstr("names exchanged"));
  }
}

TEST_F(TargetsCommand, GivesTheSameBytesAgain) {
  ASSERT_EQ(Targets(run_->path(), *run_ / "centres.csv").code, ExitCode::kDone);
  const std::string once = test::ReadText(*run_ / "centres.csv");
  std::filesystem::remove(*run_ / "centres.csv");
  ASSERT_EQ(Targets(run_->path(), *run_ / "centres.csv").code, ExitCode::kDone);
  EXPECT_EQ(test::ReadText(*run_ / "centres.csv"), once);
}

TEST_F(TargetsCommand, SaysWhatIsMissing) {
  const auto complaint = [&](const std::string& file, const std::string& text) {
    const std::string good = test::ReadText(*run_ / file);
    test::WriteText(*run_ / file, text);
    const Said said = Targets(run_->path(), *run_ / "out.csv");
    test::WriteText(*run_ / file, good);
    EXPECT_EQ(said.code, ExitCode::kBadInput) << said.out;
    return said.err;
  };
  const std::string targets = "target,x_m,y_m,z_m,sigma_mm,kind\n";
  EXPECT_THAT(complaint("targets.csv", "target,x_m,y_m,z_m,sigma_mm\nA,1,2,3,0.1\n"),
              HasSubstr("targets.csv: has no column kind"));
  EXPECT_THAT(complaint("targets.csv", targets + "A,1,2,3,0.1,\nB,1,2,3,0.1,\n"),
              HasSubstr("targets.csv: has no column kind, or nothing in it"));
  EXPECT_THAT(complaint("targets.csv", targets + "A,1,2,3,0.1,prism\n"),
              testing::AllOf(HasSubstr("targets.csv:2: column kind"), HasSubstr("coded:NUMBER")));
  EXPECT_THAT(complaint("targets.csv", targets + "A,1,2,3,0.1,coded:3\nB,1,2,3,0.1,coded:3\n"),
              HasSubstr("targets.csv:3: column kind: 'coded:3' stands twice"));
  EXPECT_THAT(complaint("targets.csv", targets + "A,1,10,2,0.1,circle:60\n"),
              HasSubstr("start.heading_deg"));
  EXPECT_THAT(complaint("frames.csv", "stamp_ns,file\n1,\n"),
              HasSubstr("frames.csv:2: column file"));
  EXPECT_THAT(complaint("frames.csv", "stamp_ns,file\n"), HasSubstr("frames.csv: has no images"));
  EXPECT_THAT(complaint("frames.csv", "stamp_ns,file\n5,a\n4,b\n"), HasSubstr("frames.csv:3"));
}

TEST_F(TargetsCommand, PassesOverImagesThatCannotBeRead) {
  const std::string good = test::ReadText(*run_ / "frames.csv");
  std::string rows = good;
  const std::size_t at = rows.find("frames/", rows.size() / 2);
  rows.replace(at, 7, "framed/");
  test::WriteText(*run_ / "frames.csv", "stamp_ns,file\n1,frames/0000.pgm\n" + rows.substr(14));
  const Said said = Targets(run_->path(), *run_ / "centres.csv");
  test::WriteText(*run_ / "frames.csv", good);
  ASSERT_EQ(said.code, ExitCode::kDone) << said.err;
  EXPECT_THAT(said.err, HasSubstr("framed/"));
  EXPECT_THAT(said.out, HasSubstr("     1 images unreadable"));
  EXPECT_THAT(said.out, HasSubstr("     1 images where imu.csv has no samples"));
}

}  // namespace
}  // namespace tbm
