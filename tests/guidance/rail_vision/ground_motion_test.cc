#include "guidance/rail_vision/ground_motion.h"

#include <cmath>
#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/guidance/rail_vision/ground_picture.h"
#include "tests/guidance/rail_vision/scene_picture.h"

namespace tbm {
namespace {

using test::Random;

constexpr double kHeight_m = 0.5;

const test::ScenePainter& Painter() {
  static const test::ScenePainter painter(test::GroundCamera());
  return painter;
}

// Looks down, image's right is vehicle's right; then turned a little.
Rigid3 CameraAt(const Eigen::Vector3d& at, const Eigen::Vector3d& turns_rad) {
  return {(ExpRotation(turns_rad) * test::LookingDown()).normalized(), at};
}

std::vector<std::uint8_t> Picture(const test::Scenery& scenery,
                                  const Rigid3& world_from_camera,
                                  Random& random,
                                  const std::string& name = "") {
  const auto pixels = Painter().Paint(scenery, Inverse(world_from_camera), random);
  const char* folder = std::getenv("TBM_PICTURES");
  if (folder != nullptr && !name.empty()) {
    test::WritePicture(std::string(folder) + "/" + name + ".pgm", Painter().View(pixels));
  }
  return pixels;
}

GroundFeatures FeaturesOf(const std::vector<std::uint8_t>& pixels) {
  return FindGroundFeatures(Painter().View(pixels), Painter().camera());
}

// Shifts along the ground, measured from a camera that is turned a little from square to it.
struct Exactness {
  double rms_mm = 0.0;
  double worst_mm = 0.0;
  double error_over_sigma = 0.0;
};
Exactness MeasurePairs(const std::string& name, const Eigen::Quaterniond& world_from_ground) {
  constexpr int kPairs = 20;
  constexpr double kTurn_rad = 1e-4;
  Exactness exactness;
  double squared_mm = 0.0;
  double squared_sigmas = 0.0;
  for (int i = 0; i < kPairs; ++i) {
    Random random(name, static_cast<std::uint64_t>(i));
    test::Scenery scenery;
    scenery.patches.push_back(test::GroundPatch(random.Bits()));
    scenery.patches.back().world_from_patch.rotation = world_from_ground;
    const Rigid3 first =
        CameraAt(Eigen::Vector3d(random.Uniform(-0.3, 0.3), random.Uniform(-0.3, 0.3), kHeight_m),
                 random.Normal3(0.02));
    const Eigen::Vector3d way(
        random.Uniform(0.01, 0.12), random.Normal(0.005), random.Normal(0.002));
    const Rigid3 second = CameraAt(
        first.translation + way,
        LogRotation(first.rotation * test::LookingDown().conjugate()) + random.Normal3(0.01));
    const Rigid3 world{world_from_ground, Eigen::Vector3d::Zero()};
    const Rigid3 world_from_first = world * first;
    const Rigid3 world_from_second = world * second;
    const auto motion = MeasureGroundMotion(
        FeaturesOf(Picture(scenery, world_from_first, random, i == 0 ? name : "")),
        FeaturesOf(Picture(scenery, world_from_second, random)),
        Painter().camera(),
        {world_from_first.rotation,
         world_from_second.rotation * ExpRotation(random.Normal3(kTurn_rad)),
         kTurn_rad});
    if (!motion) {
      ADD_FAILURE() << name << " " << i << ": " << Word(motion.error());
      continue;
    }
    const double height_m = first.translation.z();
    const Eigen::Vector3d off_m = height_m * motion->moved - first.rotation.conjugate() * way;
    squared_mm += 1e6 * off_m.head<2>().squaredNorm() / 2.0;
    exactness.worst_mm = std::max(exactness.worst_mm, 1e3 * off_m.head<2>().norm());
    const Eigen::Matrix2d covariance =
        height_m * height_m * motion->covariance.topLeftCorner<2, 2>();
    squared_sigmas += off_m.head<2>().dot(covariance.inverse() * off_m.head<2>()) / 2.0;
    if (i == 0) {
      std::printf("matches %zu, inliers %zu, rms %.3f px, sigma %.4f mm\n",
                  motion->matches,
                  motion->inliers,
                  motion->rms_px,
                  1e3 * std::sqrt(covariance(0, 0)));
    }
  }
  exactness.rms_mm = std::sqrt(squared_mm / kPairs);
  exactness.error_over_sigma = std::sqrt(squared_sigmas / kPairs);
  std::printf("%s, %d pairs: rms %.4f mm, worst %.4f mm, error over sigma %.2f\n",
              name.c_str(),
              kPairs,
              exactness.rms_mm,
              exactness.worst_mm,
              exactness.error_over_sigma);
  return exactness;
}

TEST(GroundMotion, IsAsExactAsItSays) {
  const Exactness exactness = MeasurePairs("ground", Eigen::Quaterniond::Identity());
  EXPECT_LT(exactness.rms_mm, 0.08);
  EXPECT_LT(exactness.worst_mm, 0.25);
  EXPECT_GT(exactness.error_over_sigma, 0.7);
  EXPECT_LT(exactness.error_over_sigma, 1.4);
}

// A rail that falls by 4 %, on ground that falls to the left by 3 %.
TEST(GroundMotion, IsAsExactWhereTheGroundFalls) {
  const Exactness exactness = MeasurePairs("falling", ExpRotation({-0.03, 0.04, 0.0}));
  EXPECT_LT(exactness.rms_mm, 0.08);
  EXPECT_LT(exactness.worst_mm, 0.25);
  EXPECT_GT(exactness.error_over_sigma, 0.6);
  EXPECT_LT(exactness.error_over_sigma, 1.4);
}

// Two pictures of the same ground, 40 mm apart, through what a test makes of them.
struct Pair {
  GroundFeatures first;
  GroundFeatures second;
  GroundAttitudes attitudes;
};
Pair Taken(const test::Scenery& scenery, const test::Scenery& later, const std::string& name) {
  Random random(name);
  const Rigid3 first = CameraAt({0.0, 0.0, kHeight_m}, Eigen::Vector3d::Zero());
  const Rigid3 second = CameraAt({0.04, 0.0, kHeight_m}, Eigen::Vector3d::Zero());
  return {FeaturesOf(Picture(scenery, first, random, name)),
          FeaturesOf(Picture(later, second, random)),
          {first.rotation, second.rotation, 1e-4}};
}
Result<GroundMotion, GroundFailure> Measured(const Pair& pair) {
  return MeasureGroundMotion(pair.first, pair.second, Painter().camera(), pair.attitudes);
}

std::string Why(const Pair& pair) {
  const auto motion = Measured(pair);
  return motion ? "measured" : Word(motion.error());
}

TEST(GroundMotion, SaysWhyThereIsNone) {
  test::Scenery ground;
  ground.patches.push_back(test::GroundPatch(7));
  EXPECT_EQ(Why(Taken(ground, ground, "good_ground")), "measured");

  test::Scenery bare;
  EXPECT_EQ(Why(Taken(bare, bare, "bare")), "no_texture");

  test::Scenery blurred = ground;
  blurred.blur_px = 14.0;
  EXPECT_EQ(Why(Taken(blurred, blurred, "blurred")), "blurred");

  test::Scenery elsewhere;
  elsewhere.patches.push_back(test::GroundPatch(8));
  EXPECT_EQ(Why(Taken(ground, elsewhere, "elsewhere")), "too_few_matches");

  // A sleeper stands 0.2 m above the ballast, over half of the image.
  test::Scenery stepped = ground;
  stepped.patches.push_back(test::GroundPatch(9));
  stepped.patches.back().half_y_m = 0.5;
  stepped.patches.back().world_from_patch.translation = {0.0, 0.5, 0.2};
  EXPECT_EQ(Why(Taken(stepped, stepped, "stepped")), "not_a_plane");

  // The attitude is not what it is said to be.
  Pair pair = Taken(ground, ground, "good_ground");
  pair.attitudes.world_from_second =
      pair.attitudes.world_from_second * ExpRotation({0.0, 0.0, 0.02});
  EXPECT_EQ(Why(pair), "not_a_plane");
}

TEST(GroundMotion, GivesTheSameBitsForTheSameImages) {
  test::Scenery ground;
  ground.patches.push_back(test::GroundPatch(7));
  const Pair pair = Taken(ground, ground, "good_ground");
  const Pair again = Taken(ground, ground, "good_ground");
  EXPECT_EQ(pair.first.points, again.first.points);
  const auto once = Measured(pair);
  const auto twice = Measured(again);
  ASSERT_TRUE(once.has_value() && twice.has_value());
  EXPECT_EQ(once->moved, twice->moved);
  EXPECT_EQ(once->covariance, twice->covariance);
  EXPECT_EQ(once->inliers, twice->inliers);
}

}  // namespace
}  // namespace tbm
