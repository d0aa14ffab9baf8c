#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/rail_vision/find_targets.h"
#include "tests/guidance/rail_vision/target_scene.h"

namespace tbm {
namespace {

using test::Accuracy;
using test::Count;
using test::kCameraAt;
using test::Off;
using test::Painter;
using test::PoseSigma;
using test::Random;
using test::Scene;
using test::Show;

const Eigen::Vector3d kLeft(-0.7, 3.0, 1.6);
const Eigen::Vector3d kRight(0.2, 3.0, 1.6);
const Eigen::Vector3d kTurns(0.1, 0.2, 0.1);
// So little is known of the attitude that each of two boards might be where the other is seen.
constexpr double kWide_rad = 0.06;
constexpr double kNarrow_rad = 0.003;

std::vector<std::uint8_t> Painted(const Scene& scene, const std::string& name) {
  Random random(name);
  const auto pixels = Painter().Paint(scene.scenery, scene.camera_from_world, random);
  Show(name, pixels);
  return pixels;
}

// What became of the targets: how often seen, and why not.
std::map<std::string, int> Words(const TargetsInImage& image) {
  std::map<std::string, int> words;
  for (const TargetNotSeen& one : image.refused) ++words[std::string(Word(one.why))];
  if (!image.seen.empty()) words["seen"] = static_cast<int>(image.seen.size());
  return words;
}
using Expected = std::map<std::string, int>;

// Nothing is known, or only which side is up.
TargetsInImage FindAnywhere(const Scene& scene, const std::vector<std::uint8_t>& pixels) {
  const Eigen::Vector3d up = scene.camera_from_world.rotation * Eigen::Vector3d::UnitZ();
  return TargetFinder().Find(Painter().View(pixels), Painter().camera(), scene.targets, {{}, up});
}
TargetsInImage FindBy(const Scene& scene, const std::string& name, double turn_rad) {
  return scene.Find(Painted(scene, name), scene.camera_from_world, PoseSigma(turn_rad, 0.002));
}

void Move(const std::string& board, const Eigen::Vector3d& by_m, Scene* scene) {
  for (SoughtTarget& target : scene->targets) {
    if (target.mark.board == board) target.in_world_m += by_m;
  }
}

void KeepPoints(const std::vector<int>& points, Scene* scene) {
  std::erase_if(scene->targets, [&](const SoughtTarget& target) {
    return std::find(points.begin(), points.end(), target.mark.point) == points.end();
  });
}

int Wrong(const Scene& scene, const TargetsInImage& image) {
  Count count;
  count.Add(scene, image);
  return count.wrong;
}

TEST(FindBoards, TakesNoneOfTwoAlikeWhereNothingIsExpected) {
  Scene both;
  both.AddBoard("A", kLeft, 9, 6, 0.05, kTurns);
  both.AddBoard("B", kRight, 9, 6, 0.05, kTurns);
  EXPECT_EQ(Words(FindAnywhere(both, Painted(both, "two_boards"))), (Expected{{"ambiguous", 108}}));
  Scene hidden = both;
  hidden.scenery.patches.erase(hidden.scenery.patches.begin());
  EXPECT_EQ(Words(FindAnywhere(hidden, Painted(hidden, "one_of_two"))),
            (Expected{{"ambiguous", 108}}));
  // It may lie on its side.
  Scene on_side;
  on_side.AddBoard("A", kLeft, 9, 6, 0.05, kTurns);
  on_side.AddBoard("B", kRight, 6, 9, 0.05, kTurns);
  EXPECT_EQ(Words(FindAnywhere(on_side, Painted(on_side, "on_side"))),
            (Expected{{"ambiguous", 108}}));
  // Nobody surveyed the second one.
  Scene strange = both;
  strange.targets.resize(54);
  EXPECT_EQ(Words(FindAnywhere(strange, Painted(strange, "strange_board"))),
            (Expected{{"ambiguous", 54}}));
  Scene alone = strange;
  alone.scenery.patches.pop_back();
  const auto image = FindAnywhere(alone, Painted(alone, "alone"));
  EXPECT_EQ(Words(image), (Expected{{"seen", 54}}));
  EXPECT_EQ(Wrong(alone, image), 0);
  Scene unlike;
  unlike.AddBoard("A", kLeft, 9, 6, 0.05, kTurns);
  unlike.AddBoard("B", kRight, 8, 5, 0.05, kTurns);
  EXPECT_EQ(Words(FindAnywhere(unlike, Painted(unlike, "unlike"))), (Expected{{"seen", 94}}));
}

TEST(FindBoards, TakesNoneOfTwoAlikeInWideGates) {
  Scene both;
  both.AddBoard("A", kLeft, 9, 6, 0.05, kTurns);
  both.AddBoard("B", kRight, 9, 6, 0.05, kTurns);
  EXPECT_EQ(Words(FindBy(both, "two_boards", kWide_rad)), (Expected{{"ambiguous", 108}}));
  const auto image = FindBy(both, "two_boards", kNarrow_rad);
  EXPECT_EQ(Words(image), (Expected{{"seen", 108}}));
  EXPECT_EQ(Wrong(both, image), 0);
  // The one in view may be either.
  Scene hidden = both;
  hidden.scenery.patches.erase(hidden.scenery.patches.begin());
  EXPECT_EQ(Words(FindBy(hidden, "one_of_two", kWide_rad)), (Expected{{"ambiguous", 108}}));
  EXPECT_EQ(Words(FindBy(hidden, "one_of_two", kNarrow_rad)),
            (Expected{{"seen", 54}, {"not_found", 54}}));
  // Nobody surveyed the second one.
  Scene strange = both;
  strange.targets.resize(54);
  EXPECT_EQ(Words(FindBy(strange, "strange_board", kWide_rad)), (Expected{{"ambiguous", 54}}));
  EXPECT_EQ(Words(FindBy(strange, "strange_board", kNarrow_rad)), (Expected{{"seen", 54}}));
}

// The finder may come upon the wrong one first.
TEST(FindBoards, LooksBesideOneThatDoesNotFit) {
  for (const bool is_left : {true, false}) {
    Scene scene;
    scene.AddBoard("A", {-0.1, 3.0, 1.6}, 9, 6, 0.03, kTurns);
    const Eigen::Vector3d beside(is_left ? -0.65 : 0.45, 3.0, 1.6);
    scene.scenery.patches.push_back(
        test::BoardPatch(test::Facing(beside, kCameraAt, kTurns), 9, 6, 0.03));
    const auto image = FindBy(scene, "beside", 0.03);
    EXPECT_EQ(Words(image), (Expected{{"seen", 54}}));
    EXPECT_EQ(Wrong(scene, image), 0);
  }
}

// Each names itself, and nothing but the other contradicts it.
TEST(FindBoards, TakesNeitherOfTwoWhoseNamesAreExchanged) {
  Scene scene;
  scene.AddBoard("A", kLeft, 9, 6, 0.05, kTurns);
  scene.AddBoard("B", kRight, 8, 5, 0.05, kTurns);
  Move("A", kRight - kLeft, &scene);
  Move("B", kLeft - kRight, &scene);
  EXPECT_EQ(Words(FindBy(scene, "exchanged_boards", kWide_rad)), (Expected{{"ambiguous", 94}}));
}

// A board counts as much as a coded target does.
TEST(FindBoards, AgreesWithCodesByMajority) {
  Scene scene;
  scene.AddCode({-0.8, 3.0, 1.0}, 0.13, 0, kTurns);
  scene.AddBoard("A", kLeft, 9, 6, 0.05, kTurns);
  scene.AddCode({0.3, 3.0, 1.0}, 0.13, 1, kTurns);
  Scene moved = scene;
  Move("A", {0.3, 0.0, 0.0}, &moved);
  auto image = FindBy(moved, "moved_board", kWide_rad);
  EXPECT_EQ(Words(image), (Expected{{"seen", 2}, {"too_far", 54}}));
  EXPECT_EQ(Wrong(scene, image), 0);

  Scene moved_code = scene;
  moved_code.targets[0].in_world_m.x() += 0.3;
  image = FindBy(moved_code, "moved_code", kWide_rad);
  EXPECT_EQ(Words(image), (Expected{{"seen", 55}, {"too_far", 1}}));
  EXPECT_EQ(Wrong(scene, image), 0);

  // One against one.
  moved_code.targets.pop_back();
  EXPECT_EQ(Words(FindBy(moved_code, "one_to_one", kWide_rad)), (Expected{{"ambiguous", 55}}));
}

TEST(FindBoards, FindsABoardOfWhichSomePointsAreSurveyed) {
  for (const std::vector<int>& points :
       std::vector<std::vector<int>>{{0}, {30, 31}, {0, 9}, {8, 53}}) {
    Random random("some points");
    Scene scene;
    scene.AddBoard("A", {-0.3, 2.9, 1.7}, 9, 6, 0.055, {0.4, 0.6, 0.1});
    KeepPoints(points, &scene);
    const Rigid3 guess = Off(scene.camera_from_world, kNarrow_rad, 0.002, random);
    const auto image =
        scene.Find(Painted(scene, "some_points"), guess, PoseSigma(kNarrow_rad, 0.002));
    EXPECT_EQ(image.seen.size(), points.size()) << testing::PrintToString(points);
    EXPECT_EQ(Wrong(scene, image), 0);
  }
}

// This one looks the same turned by half a turn.
TEST(FindBoards, TakesNoEndForTheUpperOneByTheSurveysNoise) {
  Scene scene;
  scene.AddBoard("A", {-0.3, 2.9, 1.7}, 9, 7, 0.055, {0.0, 0.0, 0.0});
  const auto pixels = Painted(scene, "level_row");
  Scene row = scene;
  KeepPoints({28, 34}, &row);
  for (const double noise_m : {1e-4, -1e-4}) {
    row.targets[0].in_world_m.z() = row.targets[1].in_world_m.z() + noise_m;
    EXPECT_EQ(Words(FindAnywhere(row, pixels)), (Expected{{"ambiguous", 2}}));
  }
  Scene column = scene;
  KeepPoints({4, 58}, &column);
  const auto image = FindAnywhere(column, pixels);
  EXPECT_EQ(Words(image), (Expected{{"seen", 2}}));
  EXPECT_EQ(Wrong(column, image), 0);
  for (SoughtTarget& target : column.targets) target.sigma_m = 0.1;
  EXPECT_EQ(Words(FindAnywhere(column, pixels)), (Expected{{"ambiguous", 2}}));
}

TEST(FindBoards, FindsTheRestOfABoardThatIsPartlyHidden) {
  Random random("hidden board");
  Scene scene;
  scene.AddBoard("A", {-0.3, 2.9, 1.7}, 9, 7, 0.055, {0.1, 0.2, 0.1});
  scene.scenery.patches.push_back(test::PlainPatch(
      test::Facing({-0.1, 2.5, 1.55}, kCameraAt, {0.0, 0.0, 0.3}), 0.08, 0.07, 0.2));
  const auto pixels = Painter().Paint(scene.scenery, scene.camera_from_world, random);
  Show("hidden_board", pixels);
  const Rigid3 guess = Off(scene.camera_from_world, 0.0005, 0.001, random);
  Accuracy accuracy;
  accuracy.Add(scene, scene.Find(pixels, guess, PoseSigma(0.0005, 0.001)));
  accuracy.Print("hidden board");
  EXPECT_GE(accuracy.seen, 35);
  EXPECT_LT(accuracy.seen, 63);
  EXPECT_LT(accuracy.worst_px, 0.4);
}

}  // namespace
}  // namespace tbm
