#include "guidance/shield/trend.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace tbm {
namespace {

using test::Random;

// A path whose direction walks at random, in steps of a centimetre.
class Path {
 public:
  Path(double steering_per_sqrt_m, Random& random)
      : steering_(steering_per_sqrt_m), random_(random) {
    slope_ = random.Normal(5e-3);
  }
  void DriveTo(double at_m) {
    while (at_ < at_m - 1e-9) {
      off_ += 0.01 * slope_;
      slope_ += random_.Normal(steering_ * 0.1);
      at_ += 0.01;
    }
  }
  double off() const { return off_; }
  double slope() const { return slope_; }

 private:
  double steering_;
  Random& random_;
  double at_ = 0.0;
  double off_ = 0.004;
  double slope_ = 0.0;
};

// A look every decimetre over 15 m, then 1, 5 and 20 m on without looking: the error over the sigma
// that was said, over 1000 drives.
TEST(Track, PredictsWithAnHonestBand) {
  constexpr double kSigma = 0.0015;
  TrackOptions options;
  Random random("trend_band");
  const std::vector<double> ahead = {0.0, 1.0, 5.0, 20.0};
  std::vector<double> squared(ahead.size(), 0.0);
  std::vector<int> inside(ahead.size(), 0);
  constexpr int kDrives = 1000;
  for (int drive = 0; drive < kDrives; ++drive) {
    Path path(options.steering_per_sqrt_m, random);
    Track track(options);
    for (int i = 0; i <= 150; ++i) {
      path.DriveTo(0.1 * i);
      const bool used = track.Add({{100.0 + 0.1 * i}, path.off() + random.Normal(kSigma), kSigma},
                                  path.slope() + random.Normal(options.crab_sigma_per_m),
                                  1e-4);
      ASSERT_TRUE(used);
    }
    for (std::size_t k = 0; k < ahead.size(); ++k) {
      path.DriveTo(15.0 + ahead[k]);
      const Prediction said = *track.Ahead(ahead[k]);
      const double error = (said.off_m - path.off()) / said.sigma_m;
      squared[k] += error * error / kDrives;
      inside[k] += std::abs(error) < 1.96;
    }
  }
  for (std::size_t k = 0; k < ahead.size(); ++k) {
    EXPECT_NEAR(squared[k], 1.0, 0.1) << ahead[k];
    EXPECT_NEAR(inside[k] / static_cast<double>(kDrives), 0.95, 0.016) << ahead[k];
  }
}

TEST(Track, LookingAgainAtOnePlaceSaysNothingOfTheDirection) {
  Track track({});
  Random random("trend_standstill");
  for (int i = 0; i < 5000; ++i)
    ASSERT_TRUE(track.Add({{50.0}, random.Normal(0.001), 0.001}, {}, 0.0));
  EXPECT_LT(track.Ahead(0.0)->sigma_m, 1e-4);
  // 2 cm per metre of start slope, ten metres on.
  EXPECT_NEAR(track.Ahead(10.0)->sigma_m, 0.2, 0.01);
  EXPECT_FALSE(track.Over(5.0));
}

TEST(Track, SlopeOverALength) {
  Track track({});
  for (int i = 0; i <= 100; ++i) {
    ASSERT_TRUE(track.Add({{0.1 * i}, 0.002 * 0.1 * i, 0.001}, {}, 0.0));
    if (i == 10) {
      EXPECT_FALSE(track.Over(5.0));  // a metre is too little of five
    }
  }
  const auto slope = track.Over(5.0);
  ASSERT_TRUE(slope);
  EXPECT_NEAR(slope->per_m, 0.002, 1e-9);
  EXPECT_NEAR(slope->length_m, 5.0, 0.11);
  // 51 looks of 1 mm over 5 m: sigma / (L sqrt(n / 12)).
  EXPECT_NEAR(slope->sigma_per_m, 0.001 / (5.0 * std::sqrt(51.0 / 12.0)), 5e-6);
}

TEST(Track, SlopeOfABentPathHasTheSigmaOfItsBend) {
  Track track({});
  for (int i = 0; i <= 100; ++i) {
    const double s = 0.1 * i;
    ASSERT_TRUE(track.Add({{s}, 1e-3 * s * s, 1e-4}, {}, 0.0));
  }
  EXPECT_GT(track.Over(10.0)->sigma_per_m, 10 * 1e-4 / (10.0 * std::sqrt(101.0 / 12.0)));
}

TEST(Track, ALittleBackIsIgnoredMuchBackBeginsAnew) {
  Track track({});
  ASSERT_TRUE(track.Add({{10.0}, 0.001, 0.001}, {}, 0.0));
  ASSERT_TRUE(track.Add({{11.0}, 0.001, 0.001}, {}, 0.0));
  EXPECT_FALSE(track.Add({{10.8}, 0.5, 0.001}, {}, 0.0));
  EXPECT_LT(track.Ahead(0.0)->off_m, 0.01);
  EXPECT_TRUE(track.Add({{5.0}, 0.020, 0.001}, {}, 0.0));
  EXPECT_NEAR(track.Ahead(0.0)->off_m, 0.020, 1e-12);
  EXPECT_NEAR(track.at()->m, 5.0, 1e-12);
}

TEST(Track, WithoutALookThereIsNothing) {
  Track track({});
  EXPECT_FALSE(track.Ahead(5.0));
  EXPECT_FALSE(track.Over(5.0));
  EXPECT_FALSE(track.at());
  EXPECT_FALSE(track.Add({{std::nan("")}, 0.0, 0.001}, {}, 0.0));
  EXPECT_FALSE(track.Ahead(5.0));
}

}  // namespace
}  // namespace tbm
