#include "guidance/rail/settlement.h"

#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace tbm {
namespace {

using test::Random;

constexpr double kSpacing_m = 0.02;
constexpr std::int64_t kDay_ns = 86'400'000'000'000;

// The rail of the tests: 60 m, a curve of 300 m in plan, uphill by a hundredth.
constexpr double kRadius_m = 300.0;
Eigen::Vector3d RailAt(double distance_m) {
  const double turned_rad = distance_m / kRadius_m;
  return {kRadius_m * std::sin(turned_rad),
          kRadius_m * (1.0 - std::cos(turned_rad)),
          0.01 * distance_m};
}

double Trough(double distance_m) {
  const double away = (distance_m - 30.0) / 4.0;
  return -0.003 * std::exp(-0.5 * away * away);
}

struct Pass {
  double from_m = 0.0;
  double to_m = 60.0;
  double spacing_m = kSpacing_m;
  double sigma_m = 3e-4;
  // Part of the error that a sample has from the one before.
  double memory = 0.0;
  std::int64_t day = 0;
  std::function<double(double)> moved_m = [](double) { return 0.0; };
  double run_up_scale = 1.0;  // its distance counts wrongly
};

std::vector<RailPoint> Measured(const Pass& run, Random* random) {
  std::vector<RailPoint> points;
  Eigen::Vector3d error_m = random == nullptr ? Eigen::Vector3d(0, 0, 0) : random->Normal3();
  const int count = static_cast<int>(std::lround((run.to_m - run.from_m) / run.spacing_m));
  for (int i = 0; i <= count; ++i) {
    const double distance_m = run.from_m + i * run.spacing_m;
    RailPoint point;
    point.at = {1'790'000'000'000'000'000 + run.day * kDay_ns + std::int64_t{i} * 5'000'000};
    point.distance_m = run.run_up_scale * i * run.spacing_m;
    point.position_world_m = RailAt(distance_m);
    point.position_world_m.z() += run.moved_m(distance_m);
    point.position_world_m += run.sigma_m * error_m;
    point.sigma_world_m.setConstant(run.sigma_m);
    if (random != nullptr) {
      error_m = run.memory * error_m + std::sqrt(1.0 - run.memory * run.memory) * random->Normal3();
    }
    points.push_back(point);
  }
  return points;
}

Settlement Compared(const std::vector<std::vector<RailPoint>>& epochs,
                    const SettlementOptions& options = {}) {
  auto settlement = CompareEpochs(epochs, options);
  EXPECT_TRUE(settlement.has_value());
  return settlement ? std::move(settlement).value() : Settlement{};
}

TEST(Settlement, BoundIsTheNormalOne) {
  EXPECT_NEAR(TwoSidedBound(0.95), 1.959963985, 1e-8);
  EXPECT_NEAR(TwoSidedBound(0.99), 2.575829304, 1e-8);
}

TEST(Settlement, SameHeightsAtSamePlacesWhateverTheRunUp) {
  // The later run begins elsewhere, samples elsewhere, counts its distance 2 % too long.
  Pass later{.from_m = -1.3, .to_m = 58.0, .spacing_m = 0.017, .day = 30};
  later.run_up_scale = 1.02;
  later.moved_m = Trough;
  const Settlement settlement = Compared({Measured({}, nullptr), Measured(later, nullptr)});
  ASSERT_EQ(settlement.places.size(), 601u);
  std::size_t compared = 0;
  for (const SettlementPlace& place : settlement.places) {
    if (!place.changes[0]) continue;
    ++compared;
    EXPECT_NEAR(place.changes[0]->dz_m, Trough(place.distance_m), 2e-6) << place.distance_m;
    EXPECT_NEAR(place.changes[0]->sigma_m, 3e-4 * std::numbers::sqrt2, 1e-7);
  }
  EXPECT_NEAR(static_cast<double>(compared), 581.0, 1.0);
  EXPECT_FALSE(settlement.places.back().changes[0]) << "the later run ends before";
}

TEST(Settlement, TheOtherWayRoundIsTheSameRail) {
  std::vector<RailPoint> back = Measured({.day = 3, .moved_m = Trough}, nullptr);
  std::vector<RailPoint> turned;
  for (std::size_t i = 0; i < back.size(); ++i) {
    turned.push_back(back[back.size() - 1 - i]);
    turned.back().at = back[i].at;
    turned.back().distance_m = back[i].distance_m;
  }
  const Settlement settlement = Compared({Measured({}, nullptr), turned});
  ASSERT_TRUE(settlement.epochs[0].settlement);
  EXPECT_NEAR(settlement.epochs[0].settlement->distance_m, 30.0, 1e-6);
  EXPECT_NEAR(settlement.epochs[0].settlement->dz_m, -0.003, 1e-6);
}

// What an error along the line does to the height where the line climbs.
TEST(Settlement, SigmaHoldsTheGradient) {
  const auto line = [](std::int64_t day) {
    std::vector<RailPoint> points = Measured({.to_m = 5.0, .day = day}, nullptr);
    for (RailPoint& point : points) {
      point.position_world_m = {0.0, point.distance_m, 0.75 * point.distance_m};
      point.sigma_world_m = {1.0, 4e-4, 4e-4};
    }
    return points;
  };
  const Settlement settlement = Compared({line(0), line(1)});
  ASSERT_TRUE(settlement.places[20].changes[0]);
  EXPECT_NEAR(settlement.places[20].changes[0]->sigma_m, 4e-4 * 1.25 * std::numbers::sqrt2, 1e-9);
}

// Each place for itself: 5 % of all places over many lines, whether the errors of a line are fresh
// at every sample or the same for metres.
class FalseRate : public ::testing::TestWithParam<double> {};

TEST_P(FalseRate, IsWhatTheLevelSays) {
  const double memory = GetParam();
  Random random("settlement false rate", static_cast<std::uint64_t>(1e4 * memory));
  constexpr int kDraws = 800;
  double tested = 0.0;
  double significant = 0.0;
  double squares = 0.0;
  int lines_with_peak = 0;
  int lines_with_datum = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Pass base{.to_m = 20.0, .memory = memory};
    const Pass later{.from_m = 0.007, .to_m = 20.0, .memory = memory, .day = 1};
    const Settlement settlement = Compared({Measured(base, &random), Measured(later, &random)});
    const EpochSummary& summary = settlement.epochs[0];
    const double count = static_cast<double>(summary.compared);
    const double part = static_cast<double>(summary.significant) / count;
    tested += 1.0;
    significant += part;
    squares += part * part;
    lines_with_peak += summary.settlement || summary.heave ? 1 : 0;
    lines_with_datum += summary.datum ? 1 : 0;
  }
  const double rate = significant / tested;
  // Places of a line hang together: the tolerance is that of a mean over lines.
  const double sigma = std::sqrt((squares / tested - rate * rate) / tested);
  EXPECT_NEAR(rate, 0.05, 4.0 * sigma + 5e-4);
  EXPECT_LT(sigma, 0.009) << "or the test can tell nothing";
  // Bonferroni: at most 5 %, and four sigma of a binomial.
  EXPECT_LE(lines_with_peak, kDraws * 0.05 + 4.0 * std::sqrt(kDraws * 0.05 * 0.95));
  EXPECT_LE(lines_with_datum, kDraws * 0.05 + 4.0 * std::sqrt(kDraws * 0.05 * 0.95));
}

INSTANTIATE_TEST_SUITE_P(Memory, FalseRate, ::testing::Values(0.0, 0.99, 0.9999));

TEST(Settlement, FindsThePlantedTroughWithItsShape) {
  for (const double memory : {0.0, 0.99}) {
    Random random("planted trough", static_cast<std::uint64_t>(100 * memory));
    double depth_squares = 0.0;
    double centre_squares = 0.0;
    double width_squares = 0.0;
    constexpr int kDraws = 40;
    for (int draw = 0; draw < kDraws; ++draw) {
      const Pass later{.memory = memory, .day = 30, .moved_m = Trough};
      const Settlement settlement =
          Compared({Measured({.memory = memory}, &random), Measured(later, &random)});
      const EpochSummary& summary = settlement.epochs[0];
      ASSERT_TRUE(summary.settlement);
      EXPECT_NEAR(summary.settlement->distance_m, 30.0, 4.0);
      EXPECT_LE(summary.settlement->from_m, 30.0);
      EXPECT_GE(summary.settlement->to_m, 30.0);
      EXPECT_FALSE(summary.datum);
      ASSERT_TRUE(summary.trough);
      const TroughFit& trough = *summary.trough;
      depth_squares += std::pow((trough.depth_m - 0.003) / trough.sigma_depth_m, 2);
      centre_squares += std::pow((trough.centre_m - 30.0) / trough.sigma_centre_m, 2);
      width_squares += std::pow((trough.width_m - 4.0) / trough.sigma_width_m, 2);
      EXPECT_LT(trough.sigma_depth_m, 0.001);
      EXPECT_LT(trough.sigma_centre_m, 3.0);
      EXPECT_LT(trough.sigma_width_m, 3.0);
    }
    // Sigma is a bound: no more than that of a draw or two by chance.
    EXPECT_LT(std::sqrt(depth_squares / kDraws), 1.1) << memory;
    EXPECT_LT(std::sqrt(centre_squares / kDraws), 1.1) << memory;
    EXPECT_LT(std::sqrt(width_squares / kDraws), 1.1) << memory;
  }
}

TEST(Settlement, FitIsExactWithoutNoise) {
  std::vector<TroughSample> samples;
  for (int i = 0; i <= 600; ++i) samples.push_back({0.1 * i, Trough(0.1 * i), 4e-4});
  const auto trough = FitTrough(samples, 30.0);
  ASSERT_TRUE(trough);
  EXPECT_NEAR(trough->depth_m, 0.003, 1e-9);
  EXPECT_NEAR(trough->centre_m, 30.0, 1e-6);
  EXPECT_NEAR(trough->width_m, 4.0, 1e-6);
  // One error for all samples, a tenth of sigma, cannot do more than a tenth of the bound.
  std::vector<TroughSample> raised = samples;
  for (TroughSample& sample : raised) sample.dz_m -= 4e-5;
  const auto moved = FitTrough(raised, 30.0);
  ASSERT_TRUE(moved);
  EXPECT_LT(std::abs(moved->depth_m - 0.003), 0.15 * trough->sigma_depth_m);
  EXPECT_LT(std::abs(moved->width_m - 4.0), 0.15 * trough->sigma_width_m);
  EXPECT_FALSE(FitTrough(std::span(samples).subspan(310), 31.0)) << "one side only";
}

TEST(Settlement, ConstantOffsetIsSaidToBeTheDatum) {
  Random random("datum");
  const Pass later{.memory = 0.999, .day = 9, .moved_m = [](double) { return 0.002; }};
  const Settlement settlement =
      Compared({Measured({.memory = 0.999}, &random), Measured(later, &random)});
  ASSERT_TRUE(settlement.epochs[0].datum);
  EXPECT_NEAR(settlement.epochs[0].datum->dz_m, 0.002, 1e-3);
  EXPECT_NEAR(settlement.epochs[0].datum->sigma_m, 3e-4 * std::numbers::sqrt2, 1e-5);
  // A trough on a shifted datum is both.
  const Pass both{
      .to_m = 120.0, .day = 9, .moved_m = [](double m) { return 0.002 + 2.0 * Trough(m); }};
  const Settlement of_both =
      Compared({Measured({.to_m = 120.0}, &random), Measured(both, &random)});
  ASSERT_TRUE(of_both.epochs[0].datum);
  EXPECT_NEAR(of_both.epochs[0].datum->dz_m, 0.002, 3e-4);
  ASSERT_TRUE(of_both.epochs[0].settlement);
  // Half of the line down by as much is the ground.
  const Pass half{.day = 9, .moved_m = [](double m) { return m < 33.0 ? -0.002 : 0.0; }};
  EXPECT_FALSE(Compared({Measured({}, &random), Measured(half, &random)}).epochs[0].datum);
}

TEST(Settlement, TrendIsTheWeightedLineThroughTheHeights) {
  // Days 0, 10, 40 with -0.1 mm a day; the second epoch ten times as uncertain and off by 5 mm.
  const auto down = [](double mm) { return [mm](double) { return -1e-3 * mm; }; };
  const std::vector<std::vector<RailPoint>> epochs = {
      Measured({}, nullptr),
      Measured({.sigma_m = 3e-3, .day = 10, .moved_m = down(6.0)}, nullptr),
      Measured({.day = 40, .moved_m = down(4.0)}, nullptr)};
  const Settlement settlement = Compared(epochs);
  // By hand: weights 1, 0.01, 1 in units of 1 / 0.3^2 mm^-2.
  const double mean_day = (0.1 + 40.0) / 2.01;
  const double mean_mm = (0.06 + 4.0) / 2.01;
  const double normal =
      mean_day * mean_day + 0.01 * std::pow(10.0 - mean_day, 2) + std::pow(40.0 - mean_day, 2);
  const double right = mean_day * mean_mm + 0.01 * (10.0 - mean_day) * (6.0 - mean_mm) +
                       (40.0 - mean_day) * (4.0 - mean_mm);
  const auto& trend = settlement.places[300].trend;
  ASSERT_TRUE(trend);
  EXPECT_NEAR(1e3 * trend->rate_m_per_day, -right / normal, 1e-6);
  EXPECT_NEAR(1e3 * trend->sigma_m_per_day, 0.3 / std::sqrt(normal), 1e-6);
  EXPECT_TRUE(trend->is_significant);
  EXPECT_FALSE(Compared({epochs[0], epochs[2]}).places[300].trend) << "two points are no trend";
}

TEST(Settlement, TrendOfARestingRailIsRarelySignificant) {
  Random random("resting trend");
  double tested = 0.0;
  double significant = 0.0;
  for (int draw = 0; draw < 100; ++draw) {
    std::vector<std::vector<RailPoint>> epochs;
    for (const std::int64_t day : {0, 7, 30, 33}) {
      epochs.push_back(Measured(
          {.to_m = 10.0, .sigma_m = 1e-4 * static_cast<double>(1 + day % 5), .day = day}, &random));
    }
    for (const SettlementPlace& place : Compared(epochs).places) {
      if (!place.trend) continue;
      tested += 1.0;
      significant += place.trend->is_significant ? 1.0 : 0.0;
    }
  }
  const double tolerance = 4.0 * std::sqrt(0.05 * 0.95 / tested);
  EXPECT_NEAR(significant / tested, 0.05, tolerance + 5e-4);
  EXPECT_LT(tolerance, 0.01);
}

// Moved from 1.9 to 3.1 m of 5 m; places[25] is at 2.5 m.
std::size_t AlertOf(double sigma_m, double moved_m, double shifted_m = 0.0) {
  const auto moved = [=](double m) {
    return shifted_m + (std::abs(m - 2.5) < 0.6 ? moved_m : 0.0);
  };
  const Pass base{.to_m = 5.0, .sigma_m = sigma_m};
  const Pass later{.to_m = 5.0, .sigma_m = sigma_m, .day = 1, .moved_m = moved};
  const SettlementOptions options{.alert_m = {0.001, 0.003, 0.005}};
  const Settlement settlement =
      Compared({Measured(base, nullptr), Measured(later, nullptr)}, options);
  EXPECT_EQ(settlement.epochs[0].datum.has_value(), shifted_m != 0.0);
  EXPECT_EQ(settlement.places[5].alert, 0u);
  return settlement.places[25].alert;
}

TEST(Settlement, AlertsOnlyWhereItIsMoreThanChanceAnywhereOnTheLine) {
  EXPECT_EQ(AlertOf(1e-4, -0.0009), 0u);
  EXPECT_EQ(AlertOf(1e-4, -0.0011), 1u);
  EXPECT_EQ(AlertOf(1e-4, -0.0031), 2u);
  EXPECT_EQ(AlertOf(1e-4, 0.0051), 3u) << "heave counts as well";
  EXPECT_EQ(AlertOf(4e-3, -0.0051), 0u) << "not significant";
  // 2.8 sigma: significant for itself, and no wonder among 51 places.
  EXPECT_EQ(AlertOf(4e-4, -0.0016), 0u);
  EXPECT_EQ(AlertOf(4e-4, -0.0020), 1u);
}

TEST(Settlement, AlertsAreBesideAShiftOfTheWholeLine) {
  EXPECT_EQ(AlertOf(1e-4, 0.0, 0.004), 0u) << "named as the datum, not as the ground";
  EXPECT_EQ(AlertOf(1e-4, -0.0035, 0.004), 2u);
  EXPECT_EQ(AlertOf(1e-4, -0.0040, 0.004), 2u) << "as high as it was, while all else rose";
  EXPECT_EQ(AlertOf(1e-4, -0.0040, -0.004), 2u) << "8 mm, of which the line has 4";
}

TEST(Settlement, SaysNothingInHolesAndGaps) {
  std::vector<RailPoint> later = Measured({.day = 1}, nullptr);
  for (RailPoint& point : later) {
    if (point.distance_m > 9.99 && point.distance_m < 11.01) point.status = RailStatus::kGap;
  }
  std::erase_if(later, [](const RailPoint& point) {
    return point.distance_m > 19.99 && point.distance_m < 21.01;
  });
  const Settlement settlement = Compared({Measured({}, nullptr), later});
  for (const SettlementPlace& place : settlement.places) {
    const bool is_inside = (place.distance_m > 9.99 && place.distance_m < 11.01) ||
                           (place.distance_m > 19.99 && place.distance_m < 21.01);
    EXPECT_EQ(place.changes[0].has_value(), !is_inside) << place.distance_m;
  }
}

TEST(Settlement, RestAtTheStartIsOnePlace) {
  std::vector<RailPoint> base = Measured({}, nullptr);
  const RailPoint first = base.front();
  std::vector<RailPoint> resting(3000, first);
  resting.insert(resting.end(), base.begin(), base.end());
  const Settlement settlement = Compared({resting, Measured({.day = 1}, nullptr)});
  ASSERT_TRUE(settlement.places[0].changes[0]);
  EXPECT_NEAR(settlement.places[0].changes[0]->dz_m, 0.0, 1e-12);
}

TEST(Settlement, RefusesWhatCannotBeCompared) {
  const auto fault = [](const std::vector<std::vector<RailPoint>>& epochs) {
    const auto settlement = CompareEpochs(epochs, {});
    EXPECT_FALSE(settlement.has_value());
    return settlement ? SettlementFailure{} : settlement.error();
  };
  const std::vector<RailPoint> base = Measured({}, nullptr);
  std::vector<RailPoint> aside = Measured({.day = 1}, nullptr);
  for (RailPoint& point : aside) point.position_world_m.y() += 3.5;
  EXPECT_EQ(fault({base, aside}).fault, SettlementFault::kNoOverlap);
  EXPECT_EQ(fault({base, base, aside}).epoch, 2u);
  std::vector<RailPoint> back = base;
  for (std::size_t i = 0; i < base.size(); ++i) {
    back.push_back(base[base.size() - 1 - i]);
    back.back().distance_m = base.back().distance_m + base[i].distance_m + kSpacing_m;
  }
  const SettlementFailure turned = fault({base, back});
  EXPECT_EQ(turned.fault, SettlementFault::kTurnsBack);
  EXPECT_EQ(turned.epoch, 1u);
  EXPECT_NEAR(static_cast<double>(turned.point), static_cast<double>(base.size()), 60.0);
  EXPECT_EQ(fault({std::vector<RailPoint>(5, base[7]), base}).fault, SettlementFault::kNoLine);
}

}  // namespace
}  // namespace tbm
