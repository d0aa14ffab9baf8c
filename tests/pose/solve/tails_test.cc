#include "pose/solve/tails.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace tbm {
namespace {

// Printed tables of the chi-squared distribution, upper 5 % and 0.1 %.
TEST(ChiSquaredTail, AgreesWithPrintedTables) {
  const struct {
    int dof;
    double upper_5_percent;
    double upper_1_permille;
  } rows[] = {{1, 3.841459, 10.827566},
              {2, 5.991465, 13.815511},
              {3, 7.814728, 16.266236},
              {4, 9.487729, 18.466827},
              {5, 11.070498, 20.515006},
              {6, 12.591587, 22.457744},
              {10, 18.307038, 29.588298},
              {30, 43.772972, 59.703064},
              {60, 79.081944, 99.607233}};
  for (const auto& row : rows) {
    EXPECT_NEAR(ChiSquaredTail(row.upper_5_percent, row.dof), 0.05, 1e-7) << row.dof;
    EXPECT_NEAR(ChiSquaredTail(row.upper_1_permille, row.dof), 1e-3, 1e-8) << row.dof;
  }
}

TEST(ChiSquaredTail, HoldsAtTheEnds) {
  EXPECT_EQ(ChiSquaredTail(0.0, 4), 1.0);
  EXPECT_EQ(ChiSquaredTail(-1e-12, 4), 1.0);  // rounding of an exact fit
  EXPECT_EQ(ChiSquaredTail(1e7, 60), 0.0);
  EXPECT_EQ(ChiSquaredTail(std::nan(""), 4), 0.0);
  EXPECT_EQ(ChiSquaredTail(INFINITY, 4), 0.0);
}

TEST(ErrorRadius, IsTheNormalQuantileAlongOneDirection) {
  const Eigen::Matrix3d one = Eigen::Vector3d(0.0, 4.0, 0.0).asDiagonal();
  EXPECT_NEAR(ErrorRadius(one, 2.699796e-3), 6.0, 2e-3);  // 3 sigma, two-sided
}

TEST(ErrorRadius, IsTheMaxwellQuantileWhenAllDirectionsAreAlike) {
  EXPECT_NEAR(ErrorRadius(Eigen::Matrix3d::Identity(), 1e-3), std::sqrt(16.266236), 1e-3);
}

TEST(ErrorRadius, DoesNotDependOnTheAxes) {
  test::Random random("ErrorRadius.DoesNotDependOnTheAxes");
  const Eigen::Matrix3d along = Eigen::Vector3d(1.0, 0.3, 0.1).asDiagonal();
  const double radius = ErrorRadius(along, 1e-3);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Matrix3d turn = random.Rotation().toRotationMatrix();
    EXPECT_NEAR(ErrorRadius(turn * along * turn.transpose(), 1e-3), radius, 2e-4 * radius);
  }
}

// Share of drawn errors outside, for shapes from needle to ball: never above the risk, and never so
// far below that a larger factor could hide.
TEST(ErrorRadius, IsCrossedAsOftenAsItSays) {
  constexpr double kRisk = 2e-2;
  constexpr int kDraws = 60000;
  test::Random random("ErrorRadius.IsCrossedAsOftenAsItSays");
  for (const double middle : {0.02, 0.2, 0.5, 0.9}) {
    for (const double smallest : {0.0, 0.5, 1.0}) {
      const Eigen::Vector3d sigma(1.0, middle, smallest * middle);
      const double radius = ErrorRadius(sigma.array().square().matrix().asDiagonal(), kRisk);
      int outside = 0;
      for (int i = 0; i < kDraws; ++i) {
        outside += sigma.cwiseProduct(random.Normal3()).norm() > radius ? 1 : 0;
      }
      const double share = static_cast<double>(outside) / kDraws;
      EXPECT_LE(share, kRisk + 4.0 * std::sqrt(kRisk / kDraws)) << sigma.transpose();
      EXPECT_GE(share, 0.35 * kRisk) << sigma.transpose();
      if (smallest == 1.0) {
        EXPECT_GE(share, kRisk - 4.0 * std::sqrt(kRisk / kDraws));
      }
    }
  }
}

}  // namespace
}  // namespace tbm
