#include "guidance/shield/coast.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace tbm {
namespace {

// Heading north: the shield's x axis is the site's y axis.
UncertainRigid3 North() {
  UncertainRigid3 shield{{ExpRotation({0.0, 0.0, std::acos(-1.0) / 2}), {5.0, 7.0, 1.0}},
                         PoseCovariance::Zero()};
  shield.covariance.diagonal() << 1e-10, 1e-10, 1e-10, 4e-6, 4e-6, 4e-6;
  return shield;
}

TEST(Coasted, GoesOnAlongItsOwnAxis) {
  const UncertainRigid3 now = Coasted(North(), 0.001, 0.0002, 60.0, {});
  EXPECT_NEAR(now.b_from_a.translation.x(), 5.0, 1e-12);
  EXPECT_NEAR(now.b_from_a.translation.y(), 7.06, 1e-12);
}

// Four minutes: 4 x 1.2 mm across on top of 2 mm; 240 mm along from the rate and 48 from the speed.
TEST(Coasted, SigmaGrowsByTheStatedLaw) {
  const UncertainRigid3 now = Coasted(North(), 0.001, 0.0002, 240.0, {});
  EXPECT_NEAR(std::sqrt(now.covariance(3, 3)), std::hypot(0.002, 0.0048), 1e-9);
  EXPECT_NEAR(std::sqrt(now.covariance(5, 5)), std::hypot(0.002, 0.0048), 1e-9);
  EXPECT_NEAR(std::sqrt(now.covariance(4, 4)), std::hypot(std::hypot(0.002, 0.240), 0.048), 1e-9);
  EXPECT_NEAR(std::sqrt(now.covariance(0, 0)), std::hypot(1e-5, 240.0 * 8e-7), 1e-12);
  EXPECT_NEAR(now.covariance(3, 4), 0.0, 1e-15);
}

TEST(Coasted, AtOnceNothingHasChanged) {
  const UncertainRigid3 now = Coasted(North(), 0.001, 0.0002, 0.0, {});
  EXPECT_EQ(now.covariance, North().covariance);
  EXPECT_EQ(now.b_from_a.translation, North().b_from_a.translation);
}

TEST(Freshness, GoesFromFreshOverCoastingToStale) {
  const FreshnessLimits limits{10.0, 300.0, 0.020};
  EXPECT_EQ(FreshnessOf({}, 0.001, limits), Freshness::kMissing);
  EXPECT_EQ(FreshnessOf(0.0, 0.001, limits), Freshness::kFresh);
  EXPECT_EQ(FreshnessOf(20.0, 0.001, limits), Freshness::kFresh);
  EXPECT_EQ(FreshnessOf(20.1, 0.001, limits), Freshness::kCoasting);
  EXPECT_EQ(FreshnessOf(300.0, 0.001, limits), Freshness::kCoasting);
  EXPECT_EQ(FreshnessOf(300.1, 0.001, limits), Freshness::kStale);
}

TEST(Freshness, ASigmaOfNoUseIsStaleHoweverYoung) {
  const FreshnessLimits limits{10.0, 300.0, 0.020};
  EXPECT_EQ(FreshnessOf(1.0, 0.021, limits), Freshness::kStale);
  EXPECT_EQ(FreshnessOf(1.0, std::numeric_limits<double>::quiet_NaN(), limits), Freshness::kStale);
}

TEST(Freshness, AClockSetBackMakesNothingFresh) {
  const FreshnessLimits limits{10.0, 300.0, 0.0};
  EXPECT_EQ(FreshnessOf(-0.5, 0.001, limits),
            Freshness::kFresh);  // two processes' clocks differ a little
  EXPECT_EQ(FreshnessOf(-3600.0, 0.001, limits), Freshness::kStale);
  EXPECT_EQ(FreshnessOf(std::numeric_limits<double>::quiet_NaN(), 0.001, limits),
            Freshness::kStale);
}

}  // namespace
}  // namespace tbm
