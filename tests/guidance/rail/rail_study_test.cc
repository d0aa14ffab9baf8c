#include "guidance/rail_study/rail_study.h"

#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/app/rail_study_command.h"
#include "guidance/rail_study/rail_scene.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using ::testing::HasSubstr;

TEST(CompareLine, TakesThePointsThatTruthNames) {
  RailLine line;
  for (std::int64_t i = 0; i < 4; ++i) {
    line.points.push_back({.at = {i},
                           .position_world_m = Eigen::Vector3d(1e-3 * static_cast<double>(i), 0, 0),
                           .sigma_world_m = Eigen::Vector3d::Constant(1e-3)});
  }
  // 0 and 2 mm off in x, 5 and 5 in y.
  const std::vector<KnownPoint> truth = {
      {{0}, {0, 5e-3, 0}}, {{2}, {0, 5e-3, 0}}, {{9}, {9, 9, 9}}};
  const LineDeviation off = CompareLine(line, truth);
  EXPECT_EQ(off.points, 2u);
  EXPECT_NEAR(off.largest_m.x(), 2e-3, 1e-12);
  EXPECT_NEAR(off.largest_m.y(), 5e-3, 1e-12);
  EXPECT_NEAR(off.deviation_m.x(), 1e-3, 1e-12);
  EXPECT_NEAR(off.deviation_m.y(), 0.0, 1e-9);
  EXPECT_NEAR(off.error_over_sigma, std::sqrt((4.0 + 25.0 + 25.0) / 6.0), 1e-9);
  EXPECT_EQ(CompareLine(line, {}).points, 0u);
}

TEST(MedianOf, IsThatOfEachCoordinate) {
  std::vector<LineDeviation> runs(3);
  for (std::size_t i = 0; i < 3; ++i) {
    runs[i].largest_m = Eigen::Vector3d(static_cast<double>(i), 5.0 - static_cast<double>(i), 1.0);
    runs[i].error_over_sigma = static_cast<double>(i);
  }
  EXPECT_EQ(MedianOf(runs).largest_m, Eigen::Vector3d(1.0, 4.0, 1.0));
  EXPECT_NEAR(MedianOf(runs).error_over_sigma, std::sqrt(5.0 / 3.0), 1e-12);
}

// What the paper's filter takes as exact and is not, it pays with a sigma that is too small.
TEST(RailStudy, EachWayIsAsGoodAsItIs) {
  std::array<std::vector<LineDeviation>, kStudiedLines.size()> runs;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    RailScene scene;
    scene.seed = seed;
    const GeneratedRun run = GenerateRail(scene);
    std::vector<KnownPoint> truth;
    for (const RailTruth& point : run.truth) truth.push_back({point.at, point.position_world_m});
    for (std::size_t way = 0; way < runs.size(); ++way) {
      const auto line = SolveStudiedLine(run.setup, run.recording, kStudiedLines[way]);
      ASSERT_TRUE(line) << Word(kStudiedLines[way]);
      runs[way].push_back(CompareLine(*line, truth));
      EXPECT_EQ(runs[way].back().points, run.truth.size());
    }
  }
  std::array<LineDeviation, kStudiedLines.size()> median;
  for (std::size_t way = 0; way < runs.size(); ++way) {
    median[way] = MedianOf(runs[way]);
    std::printf("%-10s %.2f %.2f %.2f mm, error over sigma %.2f\n",
                std::string(Word(kStudiedLines[way])).c_str(),
                1e3 * median[way].largest_m.x(),
                1e3 * median[way].largest_m.y(),
                1e3 * median[way].largest_m.z(),
                median[way].error_over_sigma);
  }
  const auto& [inertial, paper, filter, smoothed] = median;
  EXPECT_GT(inertial.largest_m.norm(), 3.0 * paper.largest_m.norm());
  EXPECT_GT(paper.largest_m.norm(), 1.2 * smoothed.largest_m.norm());
  EXPECT_LT(smoothed.largest_m.norm(), filter.largest_m.norm());
  EXPECT_LT(paper.largest_m.maxCoeff(), 3e-3);
  EXPECT_GT(paper.error_over_sigma, 1.5);
  EXPECT_LT(filter.error_over_sigma, 1.4);
  EXPECT_LT(smoothed.error_over_sigma, 1.3);
}

TEST(RailStudyCommand, WritesATableBesideThePapersAndNotTwice) {
  const test::TempFolder folder;
  RailStudyRequest request;
  request.out = folder / "study";
  request.draws = 2;
  std::ostringstream out;
  std::ostringstream err;
  ASSERT_EQ(RunRailStudy(request, Console{out, err}), ExitCode::kDone) << err.str();
  const std::string table = test::ReadText(folder / "study/rail_study.txt");
  EXPECT_THAT(table, HasSubstr("the paper, fused        0.5    0.4    0.5"));
  const std::string csv = test::ReadText(folder / "study/rail_study.csv");
  EXPECT_THAT(csv, HasSubstr("\nboard,paper,"));
  EXPECT_THAT(csv, HasSubstr("\nspread,smoothed,"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 9);
  EXPECT_EQ(RunRailStudy(request, Console{out, err}), ExitCode::kBadInput);
  EXPECT_THAT(err.str(), HasSubstr("rail_study.csv"));
  request.force = true;
  EXPECT_EQ(RunRailStudy(request, Console{out, err}), ExitCode::kDone);
  EXPECT_EQ(test::ReadText(folder / "study/rail_study.csv"), csv);
}

}  // namespace
}  // namespace tbm
