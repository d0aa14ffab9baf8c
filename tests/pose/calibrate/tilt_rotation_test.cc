#include "pose/calibrate/tilt_rotation.h"

#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"

namespace tbm {
namespace {

using ::testing::HasSubstr;

// Draws placements out of Euler angles, without the code under test: yaw about the plumb line, then
// tilts about the rig's x and y.
struct Bench {
  double tilt_deg = 15.0;
  double other_tilt_deg = 15.0;
  double yaw_deg = 180.0;
  double camera_sigma_deg = 0.02;
  double tilt_sigma_deg = 0.005;
  int count = 12;
  Eigen::Matrix3d camera_from_housing = Eigen::Matrix3d::Identity();
  Eigen::Vector3d up_in_board = Eigen::Vector3d::UnitZ();
  std::vector<TiltPlacement> placements;

  explicit Bench(unsigned seed) : engine_(seed) {}

  void Draw() {
    const Eigen::Matrix3d world_from_board =
        Eigen::AngleAxisd(1.3, Eigen::Vector3d(0.5, -0.7, 0.2).normalized()).toRotationMatrix();
    camera_from_housing =
        Eigen::AngleAxisd(2.1, Eigen::Vector3d(0.9, 0.3, -0.4).normalized()).toRotationMatrix();
    up_in_board = world_from_board.transpose() * Eigen::Vector3d::UnitZ();
    for (int i = 0; i < count; ++i) {
      const Eigen::Matrix3d world_from_housing =
          (Eigen::AngleAxisd(DegToRad(Uniform(yaw_deg)), Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(DegToRad(Uniform(tilt_deg)), Eigen::Vector3d::UnitX()) *
           Eigen::AngleAxisd(DegToRad(Uniform(other_tilt_deg)), Eigen::Vector3d::UnitY()))
              .toRotationMatrix();
      const Eigen::Vector3d up = world_from_housing.transpose() * Eigen::Vector3d::UnitZ();
      const double beta = -std::asin(up.x()) + DegToRad(Normal(tilt_sigma_deg));
      const double gamma = std::asin(up.y()) + DegToRad(Normal(tilt_sigma_deg));
      const double x = -std::sin(beta);
      const double y = std::sin(gamma);
      const Eigen::Vector3d error = DegToRad(1.0) * Eigen::Vector3d(Normal(camera_sigma_deg),
                                                                    Normal(camera_sigma_deg),
                                                                    Normal(camera_sigma_deg));
      const Eigen::Matrix3d wrong =
          Eigen::AngleAxisd(error.norm(), error.normalized()).toRotationMatrix();
      TiltPlacement one;
      one.camera_from_board =
          wrong * camera_from_housing * world_from_housing.transpose() * world_from_board;
      one.up_in_housing = {x, y, std::sqrt(1.0 - x * x - y * y)};
      one.camera_sigma_rad = DegToRad(camera_sigma_deg);
      one.tilt_sigma_rad = DegToRad(tilt_sigma_deg);
      placements.push_back(one);
    }
  }

  double Error_deg(const Eigen::Matrix3d& found) const {
    const Eigen::AngleAxisd off(Eigen::Matrix3d(found * camera_from_housing.transpose()));
    return RadToDeg(std::abs(off.angle()));
  }

 private:
  double Uniform(double most) {
    return most * (2.0 * std::generate_canonical<double, 53>(engine_) - 1.0);
  }
  double Normal(double sigma) { return sigma * normal_(engine_); }

  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

TEST(TiltRotation, TwelvePicturesAtFifteenDegreesGiveATwentiethOfADegree) {
  double squared = 0.0;
  double nees = 0.0;
  double chi2 = 0.0;
  double dof = 0.0;
  constexpr int kDraws = 60;
  for (unsigned seed = 1; seed <= kDraws; ++seed) {
    Bench bench(seed);
    bench.Draw();
    const auto found = FindTiltRotation(bench.placements, {});
    ASSERT_TRUE(found) << "seed " << seed;
    const double error = bench.Error_deg(found->camera_from_housing);
    squared += error * error / kDraws;
    const Eigen::AngleAxisd off(
        Eigen::Matrix3d(bench.camera_from_housing * found->camera_from_housing.transpose()));
    const Eigen::Vector3d e = off.angle() * off.axis();
    nees += e.dot(found->covariance.inverse() * e) / kDraws;
    chi2 += found->chi2;
    dof += found->dof;
  }
  EXPECT_LT(std::sqrt(squared), 0.05);
  EXPECT_GT(std::sqrt(squared), 0.01);
  // Mean of 60 draws of three degrees of freedom: 3 +- 0.63 at 95 %.
  EXPECT_NEAR(nees, 3.0, 0.8);
  EXPECT_NEAR(chi2 / dof, 1.0, 0.08);
}

TEST(TiltRotation, TheLagrangianNeedsTheRightStart) {
  int wrong_from_identity = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Bench bench(seed);
    bench.tilt_deg = bench.other_tilt_deg = 3.0;
    bench.Draw();
    int steps = 0;
    const Eigen::Matrix3d good = AugmentedLagrangianTiltRotation(
        bench.placements, StartTiltRotation(bench.placements), &steps);
    EXPECT_LT(bench.Error_deg(good), 1.0) << "seed " << seed;
    EXPECT_LT(steps, 150);
    const Eigen::Matrix3d from_identity =
        AugmentedLagrangianTiltRotation(bench.placements, Eigen::Matrix3d::Identity(), &steps);
    wrong_from_identity += bench.Error_deg(from_identity) > 5.0 ? 1 : 0;
  }
  EXPECT_GT(wrong_from_identity, 5);
}

TEST(TiltRotation, WithGravityKnownNoYawIsNeeded) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    Bench bench(seed);
    bench.yaw_deg = 0.0;
    bench.Draw();
    const auto without = FindTiltRotation(bench.placements, {});
    ASSERT_FALSE(without);
    EXPECT_EQ(without.error().fault, TiltRotationFault::kNoYaw);
    TiltRotationOptions options;
    options.up_in_board = bench.up_in_board;
    const auto found = FindTiltRotation(bench.placements, options);
    ASSERT_TRUE(found);
    EXPECT_LT(bench.Error_deg(found->camera_from_housing), 0.08);
    EXPECT_EQ(found->steps, 0);
  }
}

// Little turning costs accuracy; the sigma knows it, and decides.
TEST(TiltRotation, LittleYawIsTakenWithItsSigma) {
  double over_sigma = 0.0;
  double squared_deg = 0.0;
  int taken = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    Bench bench(seed);
    bench.yaw_deg = 10.0;
    bench.Draw();
    const auto found = FindTiltRotation(bench.placements, {});
    if (!found) {
      EXPECT_EQ(found.error().fault, TiltRotationFault::kNoYaw) << "seed " << seed;
      continue;
    }
    ++taken;
    const Eigen::AngleAxisd off(
        Eigen::Matrix3d(bench.camera_from_housing * found->camera_from_housing.transpose()));
    const Eigen::Vector3d e = off.angle() * off.axis();
    over_sigma += e.dot(found->covariance.inverse() * e) / 3.0;
    squared_deg += std::pow(bench.Error_deg(found->camera_from_housing), 2);
  }
  std::printf("%d of 60 taken, %.3f degrees rms, NEES over its size %.2f\n",
              taken,
              std::sqrt(squared_deg / taken),
              over_sigma / taken);
  EXPECT_GE(taken, 50);
  EXPECT_LT(std::sqrt(squared_deg / taken), 0.12);
  EXPECT_NEAR(over_sigma / taken, 1.0, 0.3);
}

TEST(TiltRotation, OneTiltAxisIsEnoughWhereGravityIsKnown) {
  Bench bench(3);
  bench.other_tilt_deg = 0.0;
  bench.Draw();
  TiltRotationOptions options;
  options.up_in_board = bench.up_in_board;
  const auto found = FindTiltRotation(bench.placements, options);
  ASSERT_TRUE(found);
  EXPECT_LT(bench.Error_deg(found->camera_from_housing), 0.1);
}

TEST(TiltRotation, WhatCannotBeKnownIsRefusedAndTheMotionNamed) {
  Bench yaw_only(1);
  yaw_only.tilt_deg = yaw_only.other_tilt_deg = 0.0;
  yaw_only.Draw();
  const auto no_tilt = FindTiltRotation(yaw_only.placements, {});
  ASSERT_FALSE(no_tilt);
  EXPECT_EQ(no_tilt.error().fault, TiltRotationFault::kNoTilt);
  EXPECT_THAT(MissingMotion(no_tilt.error().fault), HasSubstr("both axes"));

  Bench one_axis(2);
  one_axis.other_tilt_deg = 0.0;
  one_axis.Draw();
  const auto one = FindTiltRotation(one_axis.placements, {});
  ASSERT_FALSE(one);
  EXPECT_EQ(one.error().fault, TiltRotationFault::kOneAxis);
  EXPECT_THAT(MissingMotion(one.error().fault), HasSubstr("other axis"));

  Bench few(3);
  few.count = 3;
  few.Draw();
  const auto three = FindTiltRotation(few.placements, {});
  ASSERT_FALSE(three);
  EXPECT_EQ(three.error().fault, TiltRotationFault::kTooFew);

  Bench weak(4);
  weak.tilt_deg = weak.other_tilt_deg = 1.5;
  weak.camera_sigma_deg = 0.3;
  weak.Draw();
  const auto too_weak = FindTiltRotation(weak.placements, {});
  ASSERT_FALSE(too_weak);
  EXPECT_EQ(too_weak.error().fault, TiltRotationFault::kTooWeak);
  EXPECT_GT(too_weak.error().sigma_rad, 0.0035);
}

// Declared are sigmas that are too small by `times`.
Bench Overrated(unsigned seed, double times) {
  Bench bench(seed);
  bench.Draw();
  for (TiltPlacement& one : bench.placements) {
    one.camera_sigma_rad /= times;
    one.tilt_sigma_rad /= times;
  }
  return bench;
}

TEST(TiltRotation, ReadingsThatAreWorseThanDeclaredMakeItsSigmaLarger) {
  double nees = 0.0;
  int taken = 0;
  int scaled = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    const Bench bench = Overrated(seed + 100, 2.2);
    const auto found = FindTiltRotation(bench.placements, {});
    if (!found) continue;
    ++taken;
    if (found->sigma_factor > 1.4) ++scaled;
    EXPECT_LE(found->sigma_factor, 3.0);
    const Eigen::AngleAxisd off(
        Eigen::Matrix3d(bench.camera_from_housing * found->camera_from_housing.transpose()));
    const Eigen::Vector3d e = off.angle() * off.axis();
    nees += e.dot(found->covariance.inverse() * e);
  }
  EXPECT_GE(taken, 55);
  EXPECT_GE(scaled, taken - 3) << "what chance gives is not scaled";
  EXPECT_NEAR(nees / taken, 3.0, 1.2) << "sigma has an error of its own, of 19 degrees of freedom";
  const auto refused = FindTiltRotation(Overrated(7, 5.0).placements, {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, TiltRotationFault::kNoRotation);
  EXPECT_NEAR(refused.error().sigma_factor, 5.0, 2.5);
  ASSERT_EQ(refused.error().wrong.size(), 1u) << "the worst, to look at";
}

TEST(TiltRotation, AMistypedReadingIsNamed) {
  for (const double off_deg : {0.4, 1.0, 10.0}) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
      SCOPED_TRACE(testing::Message() << off_deg << " degrees, seed " << seed);
      Bench bench(seed + 200);
      bench.Draw();
      const std::size_t wrong = seed % 12;
      Eigen::Vector3d& up = bench.placements[wrong].up_in_housing;
      up = (Eigen::AngleAxisd(DegToRad(off_deg), Eigen::Vector3d::UnitY()) * up).eval();
      for (const bool up_is_given : {false, true}) {
        TiltRotationOptions options;
        if (up_is_given) options.up_in_board = bench.up_in_board;
        const auto found = FindTiltRotation(bench.placements, options);
        ASSERT_FALSE(found);
        EXPECT_EQ(found.error().fault, TiltRotationFault::kDoesNotFit);
        ASSERT_EQ(found.error().wrong.size(), 1u);
        EXPECT_EQ(found.error().wrong[0].placement, wrong);
        EXPECT_TRUE(found.error().wrong[0].or_rather.empty());
        EXPECT_NEAR(
            found.error().wrong[0].off_rad, DegToRad(off_deg), DegToRad(0.1 + 0.03 * off_deg));
        options.takes_misfits = true;
        const auto rough = FindTiltRotation(bench.placements, options);
        ASSERT_TRUE(rough);
        EXPECT_EQ(rough->sigma_factor, 1.0);
      }
    }
  }
}

TEST(TiltRotation, SeveralWrongReadingsDoNotHideOneAnother) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Bench bench(seed + 300);
    bench.Draw();
    for (const std::size_t wrong : {1u, 5u, 9u}) {
      Eigen::Vector3d& up = bench.placements[wrong].up_in_housing;
      up = (Eigen::AngleAxisd(DegToRad(0.5), Eigen::Vector3d::UnitX()) * up).eval();
    }
    const auto found = FindTiltRotation(bench.placements, {});
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().fault, TiltRotationFault::kDoesNotFit);
    std::vector<std::size_t> named;
    for (const WrongTilt& one : found.error().wrong) named.push_back(one.placement);
    EXPECT_THAT(named, ::testing::UnorderedElementsAre(1u, 5u, 9u));
  }
}

TEST(TiltRotation, AnUpThatIsWronglyGivenIsNoticed) {
  Bench bench(11);
  bench.Draw();
  TiltRotationOptions options;
  options.up_in_board =
      Eigen::AngleAxisd(DegToRad(1.0), bench.up_in_board.unitOrthogonal()) * bench.up_in_board;
  options.up_sigma_rad = DegToRad(0.02);
  const auto found = FindTiltRotation(bench.placements, options);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TiltRotationFault::kNoRotation);
  EXPECT_GT(found.error().sigma_factor, 3.0);
}

TEST(TiltRotation, ABoardThatMovedIsNoticed) {
  Bench bench(5);
  bench.Draw();
  const Eigen::Matrix3d moved =
      Eigen::AngleAxisd(DegToRad(3.0), Eigen::Vector3d::UnitX()).toRotationMatrix();
  for (std::size_t i = 6; i < bench.placements.size(); ++i) {
    bench.placements[i].camera_from_board = bench.placements[i].camera_from_board * moved;
  }
  const auto found = FindTiltRotation(bench.placements, {});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, TiltRotationFault::kNoRotation);
}

}  // namespace
}  // namespace tbm
