#include "guidance/rail/rail_filter.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include <gtest/gtest.h>

#include "guidance/rail/rail_line.h"
#include "guidance/rail_study/rail_scene.h"
#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"
#include "tests/guidance/rail/straight_run.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using test::GenerateStraight;
using test::Random;

double Squared(const RailPoint& point, const RailTruth& truth) {
  return (point.position_world_m - truth.position_world_m)
      .cwiseQuotient(point.sigma_world_m)
      .squaredNorm();
}

// Not even a trolley that rests before and behind stays where it is while nothing is told.
TEST(RailFilter, WhatIsMovedWhileSamplesAreMissingAtRestIsNoRest) {
  double squared = 0.0;
  constexpr int kRuns = 12;
  for (int seed = 0; seed < kRuns; ++seed) {
    Random random("moved at rest", static_cast<std::uint64_t>(seed));
    GeneratedRun run = GenerateStraight({.stream = "moved at rest, the run",
                                         .draw = static_cast<std::uint64_t>(seed),
                                         .speed_m_s = 0.3,
                                         .even_s = 4.0,
                                         .end_rest_s = 12.0,
                                         .is_push_even = true});
    const Timestamp begin = run.recording.imu.front().ends_at;
    const Eigen::Vector3d moved_m = random.Normal3(0.2);
    std::erase_if(run.recording.imu, [&](const ImuSample& sample) {
      const double t = SecondsBetween(begin, sample.ends_at);
      return t > 18.0 && t < 20.0;
    });
    for (RailTruth& row : run.truth) {
      if (SecondsBetween(begin, row.at) >= 20.0) row.position_world_m += moved_m;
    }
    for (const RailMethod method : {RailMethod::kFilter, RailMethod::kSmoothed}) {
      const auto line = SolveRailLine(run.setup, run.recording, method);
      ASSERT_TRUE(line);
      const RailPoint& last = line->points.back();
      EXPECT_EQ(last.status, RailStatus::kOpen);
      EXPECT_GT(last.sigma_world_m.minCoeff(), 0.2);
      EXPECT_LT(last.sigma_world_m.maxCoeff(), 2.0);
      squared += Squared(last, run.truth.back()) / (6.0 * kRuns);
    }
  }
  std::printf("error over sigma %.2f\n", std::sqrt(squared));
  EXPECT_LT(std::sqrt(squared), 1.3);
}

TEST(RailFilter, ADeclaredRestDoesNotBridgeMissingSamples) {
  GeneratedRun run = GenerateStraight({.stream = "gap in the declared rest", .speed_m_s = 0.3});
  const Timestamp begin = run.recording.imu.front().ends_at;
  std::erase_if(run.recording.imu, [&](const ImuSample& sample) {
    const double t = SecondsBetween(begin, sample.ends_at);
    return t > 3.0 && t < 4.5;
  });
  const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kFilter);
  ASSERT_TRUE(line);
  const RailPoint& later = line->points[400];
  ASSERT_GT(SecondsBetween(begin, later.at), 5.0);
  EXPECT_EQ(later.status, RailStatus::kOpen);
  EXPECT_GT(later.sigma_world_m.minCoeff(), 0.1);
}

TEST(QuietWatch, ASpanEndsWhereSamplesAreMissing) {
  GeneratedRun run = GenerateStraight(
      {.stream = "quiet across a gap", .speed_m_s = 0.3, .even_s = 4.0, .end_rest_s = 12.0});
  const Timestamp begin = run.recording.imu.front().ends_at;
  const auto within = [&](Timestamp at, double from_s, double to_s) {
    const double t = SecondsBetween(begin, at);
    return t > from_s && t < to_s;
  };
  std::erase_if(run.recording.imu,
                [&](const ImuSample& sample) { return within(sample.ends_at, 18.0, 20.0); });
  const auto rest = FindRestSignature(run.setup, run.recording);
  ASSERT_TRUE(rest);
  const std::vector<RestSpan> spans = FindQuietSpans(run.setup, run.recording, *rest);
  ASSERT_GE(spans.size(), 2u);
  for (const RestSpan& span : spans) {
    EXPECT_FALSE(SecondsBetween(begin, span.begins_at) < 18.0 &&
                 SecondsBetween(begin, span.ends_at) > 20.0);
  }
  EXPECT_GT(SecondsBetween(begin, spans.back().begins_at), 20.0);
}

// Somebody has written down a rest that is longer than it was.
TEST(RailFilter, MotionThatWasTakenForRestIsIntegratedAfterAll) {
  for (const double too_long_s : {0.0, 0.04, 0.1, 0.15, 0.23}) {
    SCOPED_TRACE(too_long_s);
    double squared = 0.0;
    constexpr int kRuns = 8;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      GeneratedRun run = GenerateRail({.seed = seed, .rest_s = 9.5});
      run.setup.start.at_rest_s = 9.5 + too_long_s;
      const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
      if (!line) {
        EXPECT_EQ(line.error().fault, RailStartFault::kMovesAtStart);
        continue;
      }
      const auto& images = line->consistency[static_cast<std::size_t>(FusionUpdate::kTargets)];
      EXPECT_EQ(images.accepted, images.given);
      const std::size_t at = 2050;  // a quarter of a second after it has left
      squared += Squared(line->points[at], run.truth[at]) / (3.0 * kRuns);
      EXPECT_EQ(line->points[at].at, run.truth[at].at);
    }
    EXPECT_LT(std::sqrt(squared), 1.6);
  }
}

TEST(RailFilter, RestHoldsAPlaceButFindsNone) {
  GeneratedRun run = GenerateRail({.seed = 12, .end_rest_s = 8.0});
  const Timestamp begin = run.recording.imu.front().ends_at;
  const double end_s = SecondsBetween(begin, run.recording.imu.back().ends_at);
  // From the middle of the way on it sees nothing.
  std::erase_if(run.recording.images, [&](const TargetImage& image) {
    return SecondsBetween(begin, image.stamped_at) > 14.0;
  });
  const auto open = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
  ASSERT_TRUE(open);
  EXPECT_EQ(open->points.back().status, RailStatus::kOpen);
  EXPECT_GT(open->consistency[static_cast<std::size_t>(FusionUpdate::kRest)].accepted, 150u);

  // It sees the last of them when it has stopped: from there on rest holds what they have said.
  GeneratedRun seen = GenerateRail({.seed = 12, .end_rest_s = 8.0});
  std::erase_if(seen.recording.images, [&](const TargetImage& image) {
    return SecondsBetween(begin, image.stamped_at) > end_s - 6.0;
  });
  const auto held = SolveRailLine(seen.setup, seen.recording, RailMethod::kFilter);
  ASSERT_TRUE(held);
  EXPECT_EQ(held->points.back().status, RailStatus::kFixed);
}

struct AskewTally {
  double line = 0.0;  // mean squares over sigma
  double turn = 0.0;
  double turn_sigma_rad = 0.0;
};

// A wheel that tells its way while it is built in askew to the unit by what rail.yaml says.
AskewTally WithAskewWheel(double askew_sigma_rad, int runs) {
  AskewTally tally;
  for (int seed = 0; seed < runs; ++seed) {
    Random random("askew wheel", static_cast<std::uint64_t>(seed));
    GeneratedRun run = GenerateStraight({.stream = "askew wheel, the run",
                                         .draw = static_cast<std::uint64_t>(seed),
                                         .speed_m_s = 0.3,
                                         .even_s = 36.0,
                                         .is_push_even = true});
    RailOdometer wheel;
    wheel.sigma_m = 3e-4;
    wheel.sigma_scale = 1e-3;
    wheel.sigma_rotation_rad = askew_sigma_rad;
    wheel.mounting.sigma_side_m_s = 2e-3;
    const Eigen::Vector3d askew_rad(
        0.0, random.Normal(askew_sigma_rad), random.Normal(askew_sigma_rad));
    wheel.mounting.vehicle_from_imu = ExpRotation(-askew_rad);
    run.setup.odometer = wheel;
    const double scale = random.Normal(wheel.sigma_scale);
    for (std::size_t i = 9; i < run.truth.size(); i += 10) {
      run.recording.odometer.push_back(
          {run.truth[i].at,
           run.truth[i].position_world_m.x() / (1.0 + scale) + random.Normal(wheel.sigma_m)});
    }
    const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
    EXPECT_TRUE(line);
    if (!line) continue;
    tally.line += Squared(line->points.back(), run.truth.back()) / (3.0 * runs);
    for (const RailEstimate& estimate : line->estimates) {
      const int axis = estimate.what == "odometer_turn_y_rad"   ? 1
                       : estimate.what == "odometer_turn_z_rad" ? 2
                                                                : 0;
      if (axis == 0) continue;
      tally.turn += std::pow((estimate.value - askew_rad[axis]) / estimate.sigma, 2) / (2.0 * runs);
      tally.turn_sigma_rad = std::max(tally.turn_sigma_rad, estimate.sigma);
    }
  }
  return tally;
}

TEST(RailFilter, AWheelThatIsBuiltInAskewIsAsGoodAsItSays) {
  const AskewTally tally = WithAskewWheel(DegToRad(0.2), 24);
  std::printf("error over sigma: line %.2f, turn %.2f; turn found within %.4f deg\n",
              std::sqrt(tally.line),
              std::sqrt(tally.turn),
              RadToDeg(tally.turn_sigma_rad));
  // Chi-squared with 72 and 48 degrees of freedom, 99.9 %.
  EXPECT_GT(tally.line, 0.52);
  EXPECT_LT(tally.line, 1.6);
  EXPECT_GT(tally.turn, 0.45);
  EXPECT_LT(tally.turn, 1.8);
}

TEST(RailFilter, AnInclinometerThatIsBuiltInAskewIsAsGoodAsItSays) {
  double squared = 0.0;
  double line = 0.0;
  constexpr int kRuns = 24;
  for (int seed = 0; seed < kRuns; ++seed) {
    Random random("askew inclinometer", static_cast<std::uint64_t>(seed));
    GeneratedRun run = GenerateStraight({.stream = "askew inclinometer, the run",
                                         .draw = static_cast<std::uint64_t>(seed),
                                         .speed_m_s = 0.3,
                                         .even_s = 16.0,
                                         .is_push_even = true});
    run.setup.tilt->sigma_rotation_rad = DegToRad(0.05);
    const Eigen::Vector2d off_rad = random.Normal2(run.setup.tilt->sigma_rotation_rad);
    for (TrolleyTilt& tilt : run.recording.tilts) {
      tilt.angles.beta_rad += off_rad.x();
      tilt.angles.gamma_rad += off_rad.y();
    }
    const auto solved = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
    ASSERT_TRUE(solved);
    line += Squared(solved->points.back(), run.truth.back()) / (3.0 * kRuns);
    for (const RailEstimate& estimate : solved->estimates) {
      if (!estimate.what.starts_with("tilt_offset")) continue;
      const double truth = estimate.what == "tilt_offset_beta_rad" ? off_rad.x() : off_rad.y();
      squared += std::pow((estimate.value - truth) / estimate.sigma, 2) / (2.0 * kRuns);
    }
  }
  std::printf("error over sigma: offset %.2f, line %.2f\n", std::sqrt(squared), std::sqrt(line));
  // Chi-squared with 48 and 72 degrees of freedom, 99.9 %.
  EXPECT_GT(squared, 0.45);
  EXPECT_LT(squared, 1.8);
  EXPECT_GT(line, 0.52);
  EXPECT_LT(line, 1.6);
}

// Displacements of the ground with one image of targets in the middle, and seconds by the unit
// alone before: the image corrects place and velocity where the first image of the ground was
// taken, too.
TEST(RailFilter, ATargetImageCorrectsWhereTheGroundWasFirstSeen) {
  RailConsistency grounds;
  double squared = 0.0;
  double points = 0.0;
  constexpr int kRuns = 10;
  constexpr double kSigma_m = 3e-5;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    GeneratedRun run = GenerateRail({.seed = seed, .speed_m_s = 0.1});
    Random random("ground between targets", seed);
    const Timestamp begin = run.recording.imu.front().ends_at;
    const Timestamp end = run.recording.imu.back().ends_at;
    std::optional<Timestamp> last;
    std::erase_if(run.recording.images, [&](const TargetImage& image) {
      if (SecondsBetween(begin, image.stamped_at) < 9.0) return false;
      if (last && SecondsBetween(*last, image.stamped_at) < 3.0) return true;
      last = image.stamped_at;
      return false;
    });
    RailGroundCamera camera;
    camera.camera_from_imu = TurnBetween(-Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ());
    camera.height_m = 0.5;
    camera.sigma_height_m = 1e-3;
    camera.sigma_rotation_rad = DegToRad(0.05);
    run.setup.ground = camera;
    const double scale = 1.0 + random.Normal(camera.sigma_height_m / camera.height_m);
    const Eigen::Quaterniond vehicle =
        ExpRotation({0.0, 0.0, random.Normal(camera.sigma_rotation_rad)}) * GroundVehicle(camera);
    for (const TargetImage& image : run.recording.images) {
      if (SecondsBetween(begin, image.stamped_at) < 12.0) continue;
      if (SecondsBetween(image.stamped_at, end) < 1.0) continue;
      const auto middle = std::ranges::lower_bound(run.truth, image.stamped_at, {}, &RailTruth::at);
      const RailTruth& from = *(middle - 24);
      const RailTruth& to = *(middle + 2);
      const Eigen::Vector3d way_m = vehicle * (from.world_from_imu.conjugate() *
                                               (to.position_world_m - from.position_world_m));
      run.recording.grounds.push_back({from.at,
                                       to.at,
                                       Eigen::Vector2d(way_m.x() / scale + random.Normal(kSigma_m),
                                                       way_m.y() / scale + random.Normal(kSigma_m)),
                                       kSigma_m});
    }
    const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kFilter);
    ASSERT_TRUE(line);
    const RailConsistency& kind =
        line->consistency[static_cast<std::size_t>(FusionUpdate::kImageDisplacement)];
    grounds.given += kind.given;
    grounds.accepted += kind.accepted;
    grounds.nis += kind.nis;
    grounds.dof += kind.dof;
    for (std::size_t i = 2000; i < run.truth.size(); i += 10) {
      squared += Squared(line->points[i], run.truth[i]);
      points += 3.0;
    }
  }
  std::printf("%zu of %zu displacements, NIS / dof %.3f; error over sigma %.2f\n",
              grounds.accepted,
              grounds.given,
              grounds.nis / grounds.dof,
              std::sqrt(squared / points));
  EXPECT_GE(grounds.accepted + 1, grounds.given);
  EXPECT_GT(grounds.nis / grounds.dof, 0.7);
  EXPECT_LT(grounds.nis / grounds.dof, 1.3);
  EXPECT_LT(std::sqrt(squared / points), 1.4);
}

// A point that its finder is not sure of is not believed more than that.
TEST(RailFilter, APointCountsAsItsFinderSays) {
  const auto left_out = [](double sigma_px) {
    GeneratedRun run = GenerateRail({.seed = 15});
    Random random("poor points");
    for (TargetImage& image : run.recording.images) {
      for (TargetPixel& pixel : image.pixels) {
        if (pixel.target % 7 != 0) continue;
        pixel.pixel_px += random.Normal2(1.5);
        pixel.sigma_px = sigma_px;
      }
    }
    const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
    EXPECT_TRUE(line);
    return std::count_if(line->rejections.begin(), line->rejections.end(), [](const auto& one) {
      return one.what[0] == 'T';
    });
  };
  EXPECT_GT(left_out(0.0), 500);
  EXPECT_LT(left_out(1.5), 3);
}

}  // namespace
}  // namespace tbm
