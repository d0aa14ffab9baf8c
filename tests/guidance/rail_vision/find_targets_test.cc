#include "guidance/rail_vision/find_targets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/guidance/rail_vision/target_scene.h"

namespace tbm {
namespace {

using test::Accuracy;
using test::Count;
using test::kCameraAt;
using test::Off;
using test::Painter;
using test::Places;
using test::PoseSigma;
using test::Random;
using test::Scene;
using test::Scenery;
using test::Show;
using test::Turns;

struct Light {
  const char* name;
  double blur_px;
  double noise_dn;
  double slope;  // of the light across the image, of its mean
};
constexpr std::array<Light, 4> kLights{{{"even", 0.7, 1.5, 0.0},
                                        {"noisy", 0.7, 5.0, 0.0},
                                        {"blurred", 1.5, 1.5, 0.0},
                                        {"from one side", 0.8, 1.5, 0.7}}};

void Set(const Light& light, Scenery* scenery) {
  scenery->blur_px = light.blur_px;
  scenery->noise_dn = light.noise_dn;
  const double slope = light.slope;
  scenery->full_dn = [slope](double across, double down) {
    return 190.0 * (1.0 - slope * (0.6 * across + 0.4 * down));
  };
}

Accuracy Measure(const std::string& name,
                 const Light& light,
                 int scenes,
                 const std::function<void(Scene*, Random&)>& fill) {
  Accuracy accuracy;
  TargetFinder finder;
  for (int i = 0; i < scenes; ++i) {
    Random random(name + light.name, static_cast<std::uint64_t>(i));
    Scene scene;
    Set(light, &scene.scenery);
    fill(&scene, random);
    const auto pixels = Painter().Paint(scene.scenery, scene.camera_from_world, random);
    if (i == 0) Show(name + "_" + light.name, pixels);
    const Rigid3 guess = Off(scene.camera_from_world, 0.001, 0.003, random);
    const TargetsAhead ahead{
        test::ExpectedFrom(Painter().camera(), guess, PoseSigma(0.001, 0.003), scene.targets), {}};
    accuracy.Add(scene,
                 finder.Find(Painter().View(pixels), Painter().camera(), scene.targets, ahead));
  }
  accuracy.Print(name + ", " + light.name);
  return accuracy;
}

class InEveryLight : public testing::TestWithParam<Light> {};

TEST_P(InEveryLight, CirclesToAFractionOfAPixel) {
  const Accuracy accuracy = Measure("circle", GetParam(), 6, [](Scene* scene, Random& random) {
    for (const auto& at : Places(random, 8, 0.3)) {
      scene->AddCircle(at, random.Uniform(0.025, 0.055), Turns(random, 45.0));
    }
  });
  EXPECT_GE(accuracy.seen, 0.9 * accuracy.asked);
  EXPECT_LT(accuracy.Rms_px(), 0.08);
  EXPECT_LT(accuracy.worst_px, 0.25);
  EXPECT_GT(accuracy.ErrorOverSigma(), 0.5);
  EXPECT_LT(accuracy.ErrorOverSigma(), 1.3);
}

TEST_P(InEveryLight, CodedTargetsToAFractionOfAPixel) {
  const Accuracy accuracy = Measure("coded", GetParam(), 6, [](Scene* scene, Random& random) {
    int code = 0;
    for (const auto& at : Places(random, 8, 0.35)) {
      scene->AddCode(at, random.Uniform(0.09, 0.16), code++, Turns(random, 45.0));
    }
  });
  EXPECT_GE(accuracy.seen, 0.9 * accuracy.asked);
  EXPECT_LT(accuracy.Rms_px(), 0.08);
  EXPECT_LT(accuracy.worst_px, 0.25);
  EXPECT_GT(accuracy.ErrorOverSigma(), 0.5);
  EXPECT_LT(accuracy.ErrorOverSigma(), 1.4);
}

TEST_P(InEveryLight, BoardPointsToAFractionOfAPixel) {
  const Accuracy accuracy = Measure("board", GetParam(), 5, [](Scene* scene, Random& random) {
    scene->AddBoard("A",
                    {-0.3, random.Uniform(2.2, 2.9), 1.75},
                    9,
                    7,
                    random.Uniform(0.05, 0.07),
                    Turns(random, 30.0));
  });
  EXPECT_GE(accuracy.seen, 0.9 * accuracy.asked);
  EXPECT_LT(accuracy.Rms_px(), 0.08);
  EXPECT_LT(accuracy.worst_px, 0.4);
  EXPECT_GT(accuracy.ErrorOverSigma(), 0.5);
  EXPECT_LT(accuracy.ErrorOverSigma(), 1.4);
}

TEST_P(InEveryLight, LampsToAFractionOfAPixel) {
  const Accuracy accuracy = Measure("led", GetParam(), 6, [](Scene* scene, Random& random) {
    scene->scenery.wall = 0.1;
    for (const auto& at : Places(random, 10, 0.15)) {
      scene->AddLamp(at, random.Uniform(1.0, 2.0));
    }
  });
  EXPECT_GE(accuracy.seen, 0.9 * accuracy.asked);
  EXPECT_LT(accuracy.Rms_px(), 0.08);
  EXPECT_LT(accuracy.worst_px, 0.3);
  EXPECT_GT(accuracy.ErrorOverSigma(), 0.5);
  EXPECT_LT(accuracy.ErrorOverSigma(), 1.4);
}

INSTANTIATE_TEST_SUITE_P(FindTargets,
                         InEveryLight,
                         testing::ValuesIn(kLights),
                         [](const auto& light) {
                           std::string name = light.param.name;
                           std::replace(name.begin(), name.end(), ' ', '_');
                           return name;
                         });

// What else stands on a wall: discs and codes that nobody surveyed, lamps, plain plates.
void AddClutter(Scene* scene, const std::vector<Eigen::Vector3d>& places, Random& random) {
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Rigid3 at = test::Facing(places[i], kCameraAt, Turns(random, 40.0));
    if (i % 4 == 0) scene->scenery.patches.push_back(test::CirclePatch(at, 0.05));
    if (i % 4 == 1) scene->scenery.patches.push_back(test::CodedPatch(at, 0.12, 3));
    if (i % 4 == 2) scene->scenery.patches.push_back(test::PlainPatch(at, 0.06, 0.05, 0.95));
    if (i % 4 == 3) scene->scenery.lamps.push_back({places[i], 140.0, 1.4});
  }
}

TEST(FindTargets, TakesNothingElseForATarget) {
  TargetFinder finder;
  for (const double turn_deg : {0.05, 0.5, 2.0}) {
    Count count;
    for (int i = 0; i < 40; ++i) {
      Random random("clutter", static_cast<std::uint64_t>(i));
      Scene scene;
      const auto places = Places(random, 18, 0.25);
      const std::size_t surveyed = std::min<std::size_t>(8, places.size());
      for (std::size_t k = 0; k < surveyed; ++k) {
        if (k % 4 == 0) scene.AddCode(places[k], 0.12, static_cast<int>(k) / 4, {0.1, 0.2, 0.3});
        if (k % 4 == 1 || k % 4 == 2) scene.AddCircle(places[k], 0.05, Turns(random, 40.0));
        if (k % 4 == 3) scene.AddLamp(places[k], 1.4);
      }
      AddClutter(
          &scene, {places.begin() + static_cast<std::ptrdiff_t>(surveyed), places.end()}, random);
      // Every third target stands somebody in front of.
      for (std::size_t k = 0; k < surveyed; k += 3) {
        const Eigen::Vector3d before = places[k] + 0.3 * (kCameraAt - places[k]).normalized();
        scene.scenery.patches.push_back(
            test::PlainPatch(test::Facing(before, kCameraAt, {0.0, 0.0, 0.4}), 0.09, 0.09, 0.3));
        std::erase_if(scene.scenery.lamps,
                      [&](const test::Lamp& lamp) { return lamp.in_world_m == places[k]; });
      }
      const auto pixels = Painter().Paint(scene.scenery, scene.camera_from_world, random);
      if (i == 0) Show("clutter", pixels);
      const double turn_rad = DegToRad(turn_deg);
      const Rigid3 guess = Off(scene.camera_from_world, turn_rad, 0.005, random);
      const TargetsAhead ahead{
          test::ExpectedFrom(Painter().camera(), guess, PoseSigma(turn_rad, 0.005), scene.targets),
          {}};
      count.Add(scene,
                finder.Find(Painter().View(pixels), Painter().camera(), scene.targets, ahead));
    }
    std::printf("attitude to %.2f deg: seen %d of %d (a third hidden), wrong %d\n",
                turn_deg,
                count.seen,
                count.expected,
                count.wrong);
    EXPECT_EQ(count.wrong, 0);
    EXPECT_GE(count.seen, (turn_deg < 1.0 ? 0.5 : 0.3) * count.expected);
  }
}

// Which way a circle is tilted its picture does not say: what that moves its middle by is the same
// in every picture, and no mean of many makes it smaller.
TEST(FindTargets, GivesNoCircleWhoseTiltStaysInTheMean) {
  constexpr int kImages = 16;
  Scene scene;
  const Eigen::Vector3d tilt(0.5, 0.5, 0.0);
  scene.AddCircle({-0.6, 3.0, 1.5}, 0.03, tilt);
  scene.AddCircle({0.0, 3.0, 1.5}, 0.055, tilt);
  scene.AddCircle({0.6, 3.0, 1.5}, 0.09, tilt);
  std::vector<Eigen::Vector2d> sums(scene.targets.size(), Eigen::Vector2d::Zero());
  std::vector<double> variances(scene.targets.size(), 0.0);
  std::vector<int> seen(scene.targets.size(), 0);
  std::vector<int> tilted(scene.targets.size(), 0);
  for (int i = 0; i < kImages; ++i) {
    Random random("tilted circles", static_cast<std::uint64_t>(i));
    const Eigen::Vector3d at = kCameraAt + Eigen::Vector3d(0.01 * i, 0.0, -0.007 * i);
    scene.camera_from_world = test::LookingAt(at, {0.0, 3.0, 1.5});
    const auto pixels = Painter().Paint(scene.scenery, scene.camera_from_world, random);
    const auto image = scene.Find(pixels, scene.camera_from_world, PoseSigma(0.001, 0.003));
    for (const TargetSeen& one : image.seen) {
      sums[one.target] += one.pixel_px - scene.TruthOf(one.target);
      variances[one.target] += one.sigma_px * one.sigma_px;
      ++seen[one.target];
    }
    for (const TargetNotSeen& one : image.refused) {
      tilted[one.target] += one.why == TargetRefusal::kTilted ? 1 : 0;
    }
  }
  EXPECT_THAT(seen, testing::ElementsAre(kImages, kImages, 0));
  EXPECT_THAT(tilted, testing::ElementsAre(0, 0, kImages));
  for (std::size_t k = 0; k < 2; ++k) {
    std::printf("circle %zu: mean of %d off by %.3f px, by its sigmas %.3f px\n",
                k,
                seen[k],
                sums[k].norm() / seen[k],
                std::sqrt(variances[k]) / seen[k]);
    EXPECT_LT(sums[k].norm() / seen[k], 0.06);
  }
}

// One scene with eight targets of which the file exchanges two.
TEST(FindTargets, RefusesTargetsWhoseNamesAreExchanged) {
  TargetFinder finder;
  int wrong = 0;
  int refused = 0;
  for (int i = 0; i < 20; ++i) {
    Random random("exchanged", static_cast<std::uint64_t>(i));
    Scene scene;
    int code = 0;
    for (const auto& at : Places(random, 6, 0.35)) {
      scene.AddCode(at, 0.13, code++, Turns(random, 30.0));
    }
    const auto pixels = Painter().Paint(scene.scenery, scene.camera_from_world, random);
    auto targets = scene.targets;
    std::swap(targets[1].in_world_m, targets[4].in_world_m);
    // So little is known that both might be where they are seen.
    const Rigid3 guess = Off(scene.camera_from_world, 0.05, 0.05, random);
    const TargetsAhead ahead{
        test::ExpectedFrom(Painter().camera(), guess, PoseSigma(0.05, 0.05), targets), {}};
    const auto image = finder.Find(Painter().View(pixels), Painter().camera(), targets, ahead);
    for (const TargetSeen& one : image.seen) wrong += one.target == 1 || one.target == 4 ? 1 : 0;
    for (const TargetNotSeen& one : image.refused) {
      if (one.target != 1 && one.target != 4) continue;
      EXPECT_EQ(one.why, TargetRefusal::kTooFar);
      ++refused;
    }
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(refused, 40);
}

// Of two that contradict one another at least one is wrong, and nothing says which.
TEST(FindTargets, TakesNeitherOfTwoNamesThatDisagree) {
  Random random("two names");
  Scene scene;
  scene.AddCode({-0.2, 3.0, 1.5}, 0.13, 0, Turns(random, 30.0));
  scene.AddCode({0.2, 3.0, 1.5}, 0.13, 1, Turns(random, 30.0));
  const auto pixels = Painter().Paint(scene.scenery, scene.camera_from_world, random);
  auto targets = scene.targets;
  std::swap(targets[0].in_world_m, targets[1].in_world_m);
  const TargetsAhead ahead{
      test::ExpectedFrom(
          Painter().camera(), scene.camera_from_world, PoseSigma(0.05, 0.05), targets),
      {}};
  TargetFinder finder;
  const auto image = finder.Find(Painter().View(pixels), Painter().camera(), targets, ahead);
  EXPECT_TRUE(image.seen.empty());
  ASSERT_EQ(image.refused.size(), 2u);
  EXPECT_EQ(image.refused[0].why, TargetRefusal::kAmbiguous);
}

std::map<std::size_t, TargetRefusal> WhyNot(const Scene& scene,
                                            const Rigid3& guess,
                                            double turn_rad,
                                            const std::string& name) {
  Random random(name);
  const auto pixels = Painter().Paint(scene.scenery, scene.camera_from_world, random);
  Show(name, pixels);
  const TargetsAhead ahead{
      test::ExpectedFrom(Painter().camera(), guess, PoseSigma(turn_rad, 0.002), scene.targets), {}};
  TargetFinder finder;
  std::map<std::size_t, TargetRefusal> why_not;
  for (const TargetNotSeen& one :
       finder.Find(Painter().View(pixels), Painter().camera(), scene.targets, ahead).refused) {
    why_not[one.target] = one.why;
  }
  return why_not;
}

TEST(FindTargets, SaysWhyNot) {
  Scene scene;
  scene.AddCircle({-0.6, 3.0, 1.8}, 0.08, {0.2, 0.1, 0.0});   // 0: nobody in its way
  scene.AddCircle({-0.1, 3.0, 1.8}, 0.08, {0.2, 0.1, 0.0});   // 1: hidden
  scene.AddCircle({0.8, 3.0, 1.8}, 0.012, {0.0, 0.0, 0.0});   // 2: four pixels
  scene.AddCode({0.3, 3.0, 1.3}, 0.044, 6, {0.0, 0.0, 0.0});  // 3: fifteen pixels
  scene.AddCircle({1.36, 3.0, 1.5}, 0.08, {0.0, 0.0, 0.0});   // 4: half out of the image
  scene.AddCircle({3.0, 3.0, 1.5}, 0.08, {0.0, 0.0, 0.0});    // 5: out of the image
  scene.scenery.patches.push_back(
      test::PlainPatch(test::Facing({-0.1, 2.9, 1.79}, kCameraAt, {0.0, 0.0, 0.0}), 0.1, 0.1, 0.3));
  EXPECT_EQ(WhyNot(scene, scene.camera_from_world, 0.008, "why_not"),
            (std::map<std::size_t, TargetRefusal>{{1, TargetRefusal::kNotFound},
                                                  {2, TargetRefusal::kTooSmall},
                                                  {3, TargetRefusal::kTooSmall},
                                                  {4, TargetRefusal::kAtEdge}}));
}

TEST(FindTargets, RefusesToChooseBetweenTwo) {
  Scene circles;
  circles.AddCircle({0.35, 3.0, 1.8}, 0.08, {0.2, 0.1, 0.0});
  circles.scenery.patches.push_back(
      test::CirclePatch(test::Facing({0.35, 3.0, 1.66}, kCameraAt, {0.2, 0.1, 0.0}), 0.08));
  EXPECT_EQ(WhyNot(circles, circles.camera_from_world, 0.012, "two_circles").at(0),
            TargetRefusal::kAmbiguous);
  // What is known better tells them apart.
  EXPECT_TRUE(WhyNot(circles, circles.camera_from_world, 0.003, "two_circles").empty());

  Scene codes;
  codes.AddCode({-0.6, 3.0, 1.3}, 0.12, 5, {0.1, 0.1, 0.0});
  codes.scenery.patches.push_back(
      test::CodedPatch(test::Facing({-0.42, 3.0, 1.3}, kCameraAt, {0.1, 0.1, 0.0}), 0.12, 5));
  EXPECT_EQ(WhyNot(codes, codes.camera_from_world, 0.02, "two_codes").at(0),
            TargetRefusal::kAmbiguous);
  EXPECT_TRUE(WhyNot(codes, codes.camera_from_world, 0.003, "two_codes").empty());
  // Looking elsewhere than is thought: what names itself is seen, and refused.
  PoseError e = PoseError::Zero();
  e[1] = 0.15;
  EXPECT_EQ(WhyNot(codes, Moved(codes.camera_from_world, e), 0.002, "elsewhere").at(0),
            TargetRefusal::kTooFar);

  Scene lamps;
  lamps.AddLamp({0.0, 3.0, 1.8}, 1.4);
  lamps.AddLamp({0.05, 3.0, 1.8}, 1.4);
  lamps.scenery.wall = 0.1;
  auto why_not = WhyNot(lamps, lamps.camera_from_world, 0.01, "two_lamps");
  EXPECT_EQ(why_not.at(0), TargetRefusal::kAmbiguous);
  EXPECT_EQ(why_not.at(1), TargetRefusal::kAmbiguous);
  // One of them is out, and which one the other does not say.
  lamps.scenery.lamps.pop_back();
  why_not = WhyNot(lamps, lamps.camera_from_world, 0.01, "one_of_two_lamps");
  EXPECT_EQ(why_not.at(0), TargetRefusal::kAmbiguous);
  EXPECT_EQ(why_not.at(1), TargetRefusal::kAmbiguous);
}

TEST(FindTargets, FindsOnlyWhatNamesItselfWhereNothingIsExpected) {
  Random random("nothing expected");
  Scene scene;
  scene.AddCode({-0.8, 3.0, 1.8}, 0.12, 7, {0.2, 0.1, 0.3});
  scene.AddCircle({0.8, 3.0, 1.8}, 0.08, {0.2, 0.1, 0.0});
  scene.AddLamp({0.8, 3.0, 1.1}, 1.4);
  scene.AddBoard("A", {-0.3, 2.9, 1.7}, 9, 7, 0.055, {0.1, 0.2, 0.1});
  const auto pixels = Painter().Paint(scene.scenery, scene.camera_from_world, random);
  Show("nothing_expected", pixels);
  TargetFinder finder;
  const auto view = Painter().View(pixels);
  // Which end of this board is up the picture does not tell.
  auto image = finder.Find(view, Painter().camera(), scene.targets, {});
  ASSERT_EQ(image.seen.size(), 1u);
  EXPECT_EQ(image.seen[0].target, 0u);
  ASSERT_EQ(image.refused.size(), 65u);
  EXPECT_EQ(image.refused[0].why, TargetRefusal::kNoExpectation);
  EXPECT_EQ(image.refused[1].why, TargetRefusal::kNoExpectation);
  EXPECT_EQ(image.refused[2].why, TargetRefusal::kAmbiguous);
  const Eigen::Vector3d up = scene.camera_from_world.rotation * Eigen::Vector3d::UnitZ();
  image = finder.Find(view, Painter().camera(), scene.targets, {{}, up});
  Count count;
  count.Add(scene, image);
  EXPECT_EQ(count.seen, 64);
  EXPECT_EQ(count.wrong, 0);
  // Upside down as surveyed, upside down as found.
  auto turned = scene.targets;
  for (std::size_t i = 3; i < turned.size(); ++i) {
    turned[i].in_world_m = scene.targets[turned.size() + 2 - i].in_world_m;
  }
  image = finder.Find(view, Painter().camera(), turned, {{}, up});
  ASSERT_EQ(image.seen.size(), 64u);
  EXPECT_LT((image.seen[1].pixel_px - scene.TruthOf(65)).norm(), 0.5);
}

// As their inventors' own code draws them.
TEST(FindTargets, ReadsEveryCodeOfTheDictionary) {
  TargetFinder finder;
  for (int first = 0; first < 50; first += 25) {
    Random random("dictionary", static_cast<std::uint64_t>(first));
    Scene scene;
    for (int i = 0; i < 25; ++i) {
      const Eigen::Vector3d at(-0.8 + 0.4 * (i % 5), 3.0, 0.96 + 0.27 * (i / 5));
      scene.AddCode(at, 0.15, first + i, {0.2, 0.2, 1.5 * i});
    }
    const auto pixels = Painter().Paint(scene.scenery, scene.camera_from_world, random);
    Count count;
    count.Add(scene, finder.Find(Painter().View(pixels), Painter().camera(), scene.targets, {}));
    EXPECT_EQ(count.seen, 25);
    EXPECT_EQ(count.wrong, 0);
  }
}

TEST(FindTargets, GivesTheSameBitsForTheSameImage) {
  Random random("same bits");
  Scene scene;
  for (const auto& at : Places(random, 8, 0.35)) scene.AddCircle(at, 0.05, Turns(random, 30.0));
  const auto pixels = Painter().Paint(scene.scenery, scene.camera_from_world, random);
  const TargetsAhead ahead{
      test::ExpectedFrom(
          Painter().camera(), scene.camera_from_world, PoseSigma(0.001, 0.002), scene.targets),
      {}};
  TargetFinder finder;
  const auto once = finder.Find(Painter().View(pixels), Painter().camera(), scene.targets, ahead);
  const auto again = finder.Find(Painter().View(pixels), Painter().camera(), scene.targets, ahead);
  ASSERT_EQ(once.seen.size(), 8u);
  for (std::size_t i = 0; i < once.seen.size(); ++i) {
    EXPECT_EQ(once.seen[i].pixel_px, again.seen[i].pixel_px);
    EXPECT_EQ(once.seen[i].sigma_px, again.seen[i].sigma_px);
  }
}

TEST(FindTargets, SurvivesImagesWithNothingInThem) {
  Scene scene;
  scene.AddCode({-0.6, 3.0, 1.3}, 0.12, 5, {0.0, 0.0, 0.0});
  scene.AddCircle({0.6, 3.0, 1.3}, 0.08, {0.0, 0.0, 0.0});
  scene.AddLamp({0.6, 3.0, 1.9}, 1.4);
  const TargetsAhead ahead{
      test::ExpectedFrom(
          Painter().camera(), scene.camera_from_world, PoseSigma(0.001, 0.002), scene.targets),
      {}};
  TargetFinder finder;
  for (const int value : {0, 128, 255}) {
    const std::vector<std::uint8_t> pixels(960 * 720, static_cast<std::uint8_t>(value));
    const auto image =
        finder.Find(Painter().View(pixels), Painter().camera(), scene.targets, ahead);
    EXPECT_TRUE(image.seen.empty());
    EXPECT_EQ(image.refused.size(), 3u);
  }
  EXPECT_EQ(finder.Find({}, Painter().camera(), scene.targets, ahead).refused.size(), 3u);
}

TEST(TargetMark, IsReadAndRefusedWithAdvice) {
  EXPECT_EQ(ParseTargetMark("led")->kind, TargetKind::kLed);
  EXPECT_DOUBLE_EQ(ParseTargetMark("circle:50.5")->diameter_m, 0.0505);
  EXPECT_EQ(ParseTargetMark("coded:49")->code, 49);
  const auto board = ParseTargetMark("board:north wall:9x7:62");
  ASSERT_TRUE(board.has_value());
  EXPECT_EQ(board->board, "north wall");
  EXPECT_EQ(board->columns * 100 + board->rows, 907);
  EXPECT_EQ(board->point, 62);
  const std::map<std::string, TargetMarkFault> wrong = {
      {"", TargetMarkFault::kForm},
      {"prism", TargetMarkFault::kForm},
      {"led:1", TargetMarkFault::kForm},
      {"board:A:9x7", TargetMarkFault::kForm},
      {"circle:", TargetMarkFault::kDiameter},
      {"circle:0.5", TargetMarkFault::kDiameter},
      {"circle:nan", TargetMarkFault::kDiameter},
      {"circle:50mm", TargetMarkFault::kDiameter},
      {"coded:50", TargetMarkFault::kCode},
      {"coded:-1", TargetMarkFault::kCode},
      {"coded:1.0", TargetMarkFault::kCode},
      {"board::9x7:0", TargetMarkFault::kBoard},
      {"board:A:9x7:63", TargetMarkFault::kBoard},
      {"board:A:9:1", TargetMarkFault::kBoard},
      {"board:A:7x7:1", TargetMarkFault::kBoard},
      {"board:A:2x7:1", TargetMarkFault::kBoard},
      {"board:A:9x65:1", TargetMarkFault::kBoard}};
  for (const auto& [text, fault] : wrong) {
    const auto mark = ParseTargetMark(text);
    ASSERT_FALSE(mark.has_value()) << text;
    EXPECT_EQ(mark.error(), fault) << text;
    EXPECT_THAT(Advice(mark.error()), testing::HasSubstr(" ")) << text;
  }
}

}  // namespace
}  // namespace tbm
