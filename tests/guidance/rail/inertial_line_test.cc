#include "guidance/rail/inertial_line.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "tests/guidance/rail/straight_run.h"

namespace tbm {
namespace {

using test::GenerateStraight;

double SecondOf(const GeneratedRun& run, Timestamp at) {
  return SecondsBetween(run.truth.front().at, at);
}

const RailTruth& TruthAt(const GeneratedRun& run, Timestamp at) {
  return *std::lower_bound(
      run.truth.begin(), run.truth.end(), at, [](const RailTruth& row, Timestamp when) {
        return row.at < when;
      });
}

// Of each coordinate, over all points.
double ErrorOverSigma(const GeneratedRun& run, const RailLine& line) {
  double sum = 0.0;
  for (const RailPoint& point : line.points) {
    const Eigen::Vector3d off_m = point.position_world_m - TruthAt(run, point.at).position_world_m;
    sum += off_m.cwiseQuotient(point.sigma_world_m).squaredNorm();
  }
  return std::sqrt(sum / (3.0 * static_cast<double>(line.points.size())));
}

// Twenty seconds at one metre per second on a straight rail show nothing but the unit's noise.
TEST(InertialLine, AnEvenMotionIsNoRest) {
  double squares = 0.0;
  constexpr int kRuns = 8;
  for (std::uint64_t draw = 0; draw < kRuns; ++draw) {
    GeneratedRun run = GenerateStraight({.stream = "inertial_even", .draw = draw});
    const auto line = SolveInertialLine(run.setup, run.recording);
    ASSERT_TRUE(line);
    ASSERT_GT(FindQuietSpans(run.setup, run.recording, *FindRestSignature(run.setup, run.recording))
                  .size(),
              2u)
        << "the even motion is not quiet";
    double sigma_m = 0.0;
    for (const RailPoint& point : line->points) {
      const double t = SecondOf(run, point.at);
      if (t > 6.1 && t < 29.5) {
        EXPECT_EQ(point.status, RailStatus::kOpen) << t;
        EXPECT_GE(point.sigma_world_m.x(), sigma_m) << t;
        sigma_m = point.sigma_world_m.x();
      }
    }
    // The rest at the end is one; its last quarter of a second may hold motion.
    EXPECT_EQ(line->points[line->points.size() - 100].status, RailStatus::kFixed);
    EXPECT_NEAR(line->points.back().distance_m, 22.0, 1.0);
    squares += std::pow(ErrorOverSigma(run, *line), 2) / kRuns;
  }
  std::printf("error over sigma %.2f\n", std::sqrt(squares));
  EXPECT_GT(std::sqrt(squares), 0.5);
  EXPECT_LT(std::sqrt(squares), 1.4);
}

TEST(InertialLine, MissingSamplesAreToldAndCount) {
  GeneratedRun run = GenerateStraight({.stream = "inertial_gap"});
  const auto whole = SolveInertialLine(run.setup, run.recording);
  std::erase_if(run.recording.imu, [&](const ImuSample& sample) {
    const double t = SecondOf(run, sample.ends_at);
    return t > 7.0 && t < 7.3;
  });
  const auto line = SolveInertialLine(run.setup, run.recording);
  ASSERT_TRUE(whole);
  ASSERT_TRUE(line);
  EXPECT_EQ(std::count_if(line->points.begin(),
                          line->points.end(),
                          [](const RailPoint& point) { return point.status == RailStatus::kGap; }),
            1);
  for (const RailPoint& point : line->points) {
    if (point.status != RailStatus::kGap) continue;
    EXPECT_NEAR(SecondOf(run, point.at), 7.3, 0.011);
    EXPECT_GT(point.sigma_world_m.x(), 0.01);  // half a metre per second squared for 0.3 s
  }
  EXPECT_GT(line->points.back().sigma_world_m.x(), 5.0 * whole->points.back().sigma_world_m.x());
  EXPECT_LT(ErrorOverSigma(run, *line), 1.5);
  // The way of the missing time is in it.
  EXPECT_NEAR(line->points.back().position_world_m.x(), 22.0, 1.5);
}

}  // namespace
}  // namespace tbm
