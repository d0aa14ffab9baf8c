// Errors of a survey do not average away, however few targets an image shows and however many a
// run passes.
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "guidance/rail/rail_line.h"
#include "guidance/rail_study/rail_study.h"
#include "tests/guidance/rail/straight_run.h"

namespace tbm {
namespace {

using test::GenerateStraight;
using test::StraightScene;

struct WallCase {
  const char* name;
  double even_s;
  double spacing_m;
  std::size_t most_seen;
  double target_sigma_m;
  int runs;
};

class WallTargets : public testing::TestWithParam<WallCase> {};

TEST_P(WallTargets, LeaveErrorsAsLargeAsTheirSigma) {
  const WallCase& wall = GetParam();
  for (const RailMethod method : {RailMethod::kSmoothed, RailMethod::kFilter}) {
    Eigen::Vector3d squares = Eigen::Vector3d::Zero();
    double sigma_m = 0.0;
    double left_out_m = 0.0;
    std::size_t seen = 0;
    for (int draw = 0; draw < wall.runs; ++draw) {
      const GeneratedRun run = GenerateStraight({.stream = wall.name,
                                                 .draw = static_cast<std::uint64_t>(draw),
                                                 .even_s = wall.even_s,
                                                 .sway_deg = 0.3,
                                                 .target_spacing_m = wall.spacing_m,
                                                 .most_seen = wall.most_seen,
                                                 .target_sigma_m = wall.target_sigma_m});
      for (const TargetImage& image : run.recording.images) {
        seen = std::max(seen, image.pixels.size());
      }
      const auto line = SolveRailLine(run.setup, run.recording, method);
      ASSERT_TRUE(line);
      left_out_m = std::max(left_out_m, line->target_modes_left_out_m);
      const double per_point = 1.0 / static_cast<double>(line->points.size() * wall.runs);
      for (std::size_t i = 0; i < line->points.size(); ++i) {
        const RailPoint& point = line->points[i];
        const Eigen::Vector3d off_m = point.position_world_m - run.truth[i].position_world_m;
        squares += per_point * off_m.cwiseQuotient(point.sigma_world_m).cwiseAbs2();
        sigma_m += per_point * point.sigma_world_m.norm() / std::sqrt(3.0);
      }
    }
    EXPECT_LE(seen, wall.most_seen);
    const double ratio = std::sqrt(squares.mean());
    std::printf("%s, %s: error over sigma %.2f (%.2f %.2f %.2f), sigma %.2f mm, left out %.2f mm\n",
                wall.name,
                method == RailMethod::kSmoothed ? "smoothed" : "filter",
                ratio,
                std::sqrt(squares.x()),
                std::sqrt(squares.y()),
                std::sqrt(squares.z()),
                1e3 * sigma_m,
                1e3 * left_out_m);
    EXPECT_GT(ratio, 0.7);
    EXPECT_LT(ratio, 1.4);
  }
}

INSTANTIATE_TEST_SUITE_P(Runs,
                         WallTargets,
                         testing::Values(WallCase{"wall_few", 14.0, 5.0, 3, 5e-4, 8},
                                         WallCase{"wall_two", 14.0, 10.0, 2, 5e-4, 8},
                                         WallCase{"wall_long", 80.0, 4.0, 3, 5e-4, 3},
                                         WallCase{"wall_many", 40.0, 1.0, 12, 5e-4, 4},
                                         WallCase{"wall_good", 40.0, 4.0, 3, 5e-5, 4}),
                         [](const auto& one) { return std::string(one.param.name); });

}  // namespace
}  // namespace tbm
