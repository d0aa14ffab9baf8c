#include "guidance/rail/rail_line.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/app/line_command.h"
#include "guidance/app/rail_run.h"
#include "pose/base/angle.h"
#include "tests/guidance/rail/rail_generator.h"
#include "tests/support/recorded_run.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::GeneratedRun;
using test::GenerateRail;
using test::RailScene;
using test::TempFolder;
using test::WriteText;
using ::testing::HasSubstr;
using ::testing::Not;

// How a solved line compares with truth.
struct Outcome {
  Eigen::Vector3d largest_mm = Eigen::Vector3d::Zero();
  double error_over_sigma = 0.0;
  Eigen::Vector3d squared_over_sigma = Eigen::Vector3d::Zero();  // mean over the run
};

template <class Truth>
Outcome Compare(const RailLine& line, const std::vector<Truth>& truth) {
  Outcome outcome;
  double rows = 0.0;
  auto known = truth.begin();
  for (const RailPoint& point : line.points) {
    while (known != truth.end() && known->at < point.at) ++known;
    if (known == truth.end() || known->at != point.at) continue;
    const Eigen::Vector3d off = point.position_world_m - known->position_world_m;
    outcome.largest_mm = outcome.largest_mm.cwiseMax(1e3 * off.cwiseAbs());
    outcome.squared_over_sigma += off.cwiseQuotient(point.sigma_world_m).cwiseAbs2();
    rows += 1.0;
  }
  EXPECT_GT(rows, 0.0);
  outcome.squared_over_sigma /= rows;
  outcome.error_over_sigma = std::sqrt(outcome.squared_over_sigma.mean());
  return outcome;
}

const RailEstimate& EstimateOf(const RailLine& line, const std::string& what) {
  const auto found = std::find_if(line.estimates.begin(),
                                  line.estimates.end(),
                                  [&](const RailEstimate& one) { return one.what == what; });
  EXPECT_NE(found, line.estimates.end()) << what;
  return *found;
}

std::string SharedRailRun(const std::string& name) {
  const char* given = std::getenv("TBM_SHARED");
  const std::string shared = given != nullptr ? given : std::string(TBM_SOURCE_DIR) + "/../shared";
  const std::string folder = shared + "/data/" + name;
  return std::filesystem::exists(folder + "/rail.yaml") ? folder : std::string();
}

struct RecordedCase {
  const char* name;
  Eigen::Vector3d most_mm;
};

class RecordedRail : public testing::TestWithParam<RecordedCase> {};

// The bounds are those that were promised.
TEST_P(RecordedRail, LiesWhereItWas) {
  const std::string folder = SharedRailRun(GetParam().name);
  TBM_SKIP_WITHOUT(folder);
  const auto run = ReadRailRun(folder);
  ASSERT_TRUE(run) << run.error().front().Text();
  const auto line = SolveRailLine(run->setup, run->recording, RailMethod::kSmoothed);
  ASSERT_TRUE(line);
  const Outcome outcome = Compare(*line, run->truth);
  for (int i = 0; i < 3; ++i) EXPECT_LE(outcome.largest_mm[i], GetParam().most_mm[i]) << i;
  EXPECT_GT(outcome.error_over_sigma, 0.7);
  EXPECT_LT(outcome.error_over_sigma, 1.3);
}

INSTANTIATE_TEST_SUITE_P(Runs,
                         RecordedRail,
                         testing::Values(RecordedCase{"rail_base", {0.7, 0.7, 0.6}},
                                         RecordedCase{"rail_spread", {0.5, 0.4, 0.4}},
                                         RecordedCase{"rail_hard", {0.8, 0.8, 0.7}}),
                         [](const auto& one) { return one.param.name; });

TEST(RecordedRailHard, TheLateImagesAreFoundAndTheWrongMatchesLeftOut) {
  const std::string folder = SharedRailRun("rail_hard");
  TBM_SKIP_WITHOUT(folder);
  const auto run = ReadRailRun(folder);
  ASSERT_TRUE(run);
  const auto line = SolveRailLine(run->setup, run->recording, RailMethod::kSmoothed);
  ASSERT_TRUE(line);
  EXPECT_NEAR(EstimateOf(*line, "camera_time_offset_s").value, -0.005, 0.001);
  // One in a hundred of 9107 points.
  const auto points = std::count_if(line->rejections.begin(),
                                    line->rejections.end(),
                                    [](const RailRejection& one) { return one.what[0] == 'T'; });
  EXPECT_GT(points, 60);
  EXPECT_LT(points, 160);
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(),
                   values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

struct SeedCase {
  const char* name;
  bool has_spread_targets;
  Eigen::Vector3d most_mm;  // of the median over the seeds
};

class TenSeeds : public testing::TestWithParam<SeedCase> {};

TEST_P(TenSeeds, OfThePapersCurve) {
  std::array<std::vector<double>, 3> largest_mm;
  Eigen::Vector3d squared = Eigen::Vector3d::Zero();
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    RailScene scene;
    scene.seed = seed;
    scene.has_spread_targets = GetParam().has_spread_targets;
    const GeneratedRun run = GenerateRail(scene);
    const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
    ASSERT_TRUE(line) << "seed " << seed;
    const Outcome outcome = Compare(*line, run.truth);
    for (std::size_t i = 0; i < 3; ++i) {
      largest_mm[i].push_back(outcome.largest_mm[static_cast<Eigen::Index>(i)]);
    }
    squared += outcome.squared_over_sigma / 10.0;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_LE(Median(largest_mm[i]), GetParam().most_mm[static_cast<Eigen::Index>(i)]) << i;
  }
  EXPECT_GT(std::sqrt(squared.mean()), 0.7);
  EXPECT_LT(std::sqrt(squared.mean()), 1.3);
}

INSTANTIATE_TEST_SUITE_P(Boards,
                         TenSeeds,
                         testing::Values(SeedCase{"board", false, {0.6, 0.4, 0.4}},
                                         SeedCase{"spread", true, {0.4, 0.3, 0.3}}),
                         [](const auto& one) { return one.param.name; });

// Noise as declared: what the filter says of its measurements holds over many runs.
TEST(Consistency, InnovationsAreAsLargeAsTheyShouldBe) {
  std::array<double, kFusionUpdates> nis{};
  std::array<double, kFusionUpdates> dof{};
  for (std::uint64_t seed = 101; seed <= 106; ++seed) {
    RailScene scene;
    scene.seed = seed;
    scene.turns_deg = 3.0;
    const GeneratedRun run = GenerateRail(scene);
    const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kFilter);
    ASSERT_TRUE(line);
    for (std::size_t i = 0; i < nis.size(); ++i) {
      nis[i] += line->consistency[i].nis;
      dof[i] += line->consistency[i].dof;
    }
  }
  const auto ratio = [&](FusionUpdate update) {
    return nis[static_cast<std::size_t>(update)] / dof[static_cast<std::size_t>(update)];
  };
  EXPECT_NEAR(ratio(FusionUpdate::kTilt), 1.0, 2.0 * std::sqrt(2.0 / dof[1]));
  // The sigma of a target's place counts as noise of each image as well as of the survey.
  EXPECT_NEAR(ratio(FusionUpdate::kTargets), 0.97, 0.03);
}

TEST(TimeOffset, IsFoundWithItsSigma) {
  double squared = 0.0;
  constexpr int kSeeds = 8;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    RailScene scene;
    scene.seed = seed;
    scene.has_spread_targets = true;
    scene.image_late_s = 0.005;
    const GeneratedRun run = GenerateRail(scene);
    const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
    ASSERT_TRUE(line);
    const RailEstimate& offset = EstimateOf(*line, "camera_time_offset_s");
    EXPECT_NEAR(offset.value, -0.005, 0.001) << "seed " << seed;
    squared += std::pow((offset.value + 0.005) / offset.sigma, 2) / kSeeds;
  }
  EXPECT_LT(std::sqrt(squared), 1.7);
}

TEST(RailLine, TheSameRecordingGivesTheSameBits) {
  const GeneratedRun run = GenerateRail({.seed = 5});
  const auto first = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
  const auto second = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
  ASSERT_TRUE(first);
  ASSERT_TRUE(second);
  for (std::size_t i = 0; i < first->points.size(); ++i) {
    ASSERT_EQ(first->points[i].position_world_m, second->points[i].position_world_m) << i;
  }
}

TEST(RailLine, SaysWhichStretchTheUnitBridgedAlone) {
  GeneratedRun run = GenerateRail({.seed = 6});
  std::erase_if(run.recording.images, [&](const TargetImage& image) {
    const double t = SecondsBetween(run.recording.images.front().stamped_at, image.stamped_at);
    return t > 11.5 && t < 14.0;
  });
  const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
  ASSERT_TRUE(line);
  const Timestamp begin = run.recording.imu.front().ends_at;
  Eigen::Vector3d bridged = Eigen::Vector3d::Zero();
  Eigen::Vector3d fixed = Eigen::Vector3d::Zero();
  for (const RailPoint& point : line->points) {
    const double t = SecondsBetween(begin, point.at);
    if (t > 12.6 && t < 12.9) {
      EXPECT_EQ(point.status, RailStatus::kBridged);
      bridged = bridged.cwiseMax(point.sigma_world_m);
    }
    if (t > 8.0 && t < 9.0) {
      EXPECT_EQ(point.status, RailStatus::kFixed);
      fixed = fixed.cwiseMax(point.sigma_world_m);
    }
  }
  EXPECT_GT(bridged.maxCoeff(), fixed.maxCoeff());
  EXPECT_LT(Compare(*line, run.truth).error_over_sigma, 1.6);
}

// A wheel with a circumference that is one in a hundred wrong, for a run that sees its targets only
// at the beginning and at the end.
TEST(RailLine, AWheelHoldsWhatTheUnitBridges) {
  Eigen::Vector3d with_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d without_mm = Eigen::Vector3d::Zero();
  double squared = 0.0;
  double scale_squared = 0.0;
  constexpr int kSeeds = 6;
  for (std::uint64_t seed = 21; seed < 21 + kSeeds; ++seed) {
    RailScene scene;
    scene.seed = seed;
    scene.speed_m_s = 0.05;
    scene.end_rest_s = 0.0;
    GeneratedRun run = GenerateRail(scene);
    const Timestamp begin = run.recording.images.front().stamped_at;
    std::erase_if(run.recording.images, [&](const TargetImage& image) {
      return SecondsBetween(begin, image.stamped_at) > 14.0;
    });
    const auto without = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
    ASSERT_TRUE(without);

    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0.0, 2e-4);
    double run_m = 0.0;
    for (std::size_t i = 1; i < run.truth.size(); ++i) {
      const auto& from = run.truth[i - 1];
      const auto& to = run.truth[i];
      run_m +=
          (from.world_from_imu.conjugate() * (to.position_world_m - from.position_world_m)).x();
      if (i % 20 == 0) run.recording.odometer.push_back({to.at, run_m / 1.01 + noise(random)});
    }
    RailOdometer wheel;
    wheel.sigma_m = 2e-4;
    wheel.sigma_scale = 0.01;
    wheel.sigma_rotation_rad = DegToRad(0.05);
    wheel.mounting.sigma_side_m_s = 0.1;
    run.setup.odometer = wheel;
    const auto with = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
    ASSERT_TRUE(with);
    const Outcome outcome = Compare(*with, run.truth);
    with_mm += outcome.largest_mm / kSeeds;
    without_mm += Compare(*without, run.truth).largest_mm / kSeeds;
    squared += std::pow(outcome.error_over_sigma, 2) / kSeeds;
    const RailEstimate& scale = EstimateOf(*with, "odometer_scale");
    EXPECT_EQ(scale.missing_motion, "");
    scale_squared += std::pow((scale.value - 0.01) / scale.sigma, 2) / kSeeds;
    EXPECT_GT(with->consistency[static_cast<std::size_t>(FusionUpdate::kOdometer)].accepted, 300u);
  }
  std::printf("largest, mm: %.1f %.1f %.1f with, %.1f %.1f %.1f without; error over sigma %.2f\n",
              with_mm.x(),
              with_mm.y(),
              with_mm.z(),
              without_mm.x(),
              without_mm.y(),
              without_mm.z(),
              std::sqrt(squared));
  EXPECT_LT(with_mm.y(), 0.3 * without_mm.y());
  EXPECT_LT(std::sqrt(squared), 1.5);
  EXPECT_LT(std::sqrt(scale_squared), 2.0);
}

// Samples are missing, then the targets: when they come back the state is a metre from where it may
// be, and what the first images say is not linear any more.
TEST(RailLine, TheFirstImagesAfterALongBlindStretchAreUnderstood) {
  for (const RailMethod method : {RailMethod::kFilter, RailMethod::kSmoothed}) {
    double worst = 0.0;
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      GeneratedRun run = GenerateRail({.seed = seed, .speed_m_s = 0.15});
      const Timestamp begin = run.recording.imu.front().ends_at;
      const auto within = [&](Timestamp at, double from_s, double to_s) {
        const double t = SecondsBetween(begin, at);
        return t > from_s && t < to_s;
      };
      std::erase_if(run.recording.imu,
                    [&](const ImuSample& sample) { return within(sample.ends_at, 12.0, 12.7); });
      std::erase_if(run.recording.images,
                    [&](const TargetImage& image) { return within(image.stamped_at, 11.9, 15.0); });
      const auto solved = SolveRailLine(run.setup, run.recording, method);
      ASSERT_TRUE(solved);
      RailLine line = *solved;
      std::erase_if(line.points,
                    [&](const RailPoint& point) { return !within(point.at, 15.2, 60.0); });
      worst = std::max(worst, Compare(line, run.truth).error_over_sigma);
    }
    std::printf("error over sigma behind it, the worst of twelve runs: %.2f\n", worst);
    EXPECT_LT(worst, 2.2);
  }
}

TEST(RailLine, WhatLiesOutsideOfTheSamplesIsTold) {
  GeneratedRun run = GenerateRail({.seed = 10});
  const Timestamp end = run.recording.imu.back().ends_at;
  run.recording.tilts.push_back({end + std::chrono::seconds(1), {}});
  run.recording.images.push_back({end + std::chrono::seconds(2), {}});
  const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
  ASSERT_TRUE(line);
  std::vector<std::string> told;
  for (const RailRejection& one : line->rejections) {
    if (one.why_not == "outside_of_samples" && one.at > end) told.push_back(one.what);
  }
  EXPECT_THAT(told, testing::ElementsAre("tilt", "targets"));
}

TEST(RailLine, WithoutImagesTheHeadingMustBeGiven) {
  RailScene scene;
  scene.seed = 7;
  scene.has_targets = false;
  GeneratedRun run = GenerateRail(scene);
  const auto without = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
  ASSERT_FALSE(without);
  EXPECT_EQ(without.error().fault, RailStartFault::kNoHeading);
  run.setup.start.heading_rad = -DegToRad(90.0);
  run.setup.start.sigma_heading_rad = DegToRad(0.05);
  const auto with = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
  ASSERT_TRUE(with);
  // The rest at the end takes what the integration has gathered out again.
  EXPECT_LT(Compare(*with, run.truth).error_over_sigma, 2.0);
}

TEST(RailLine, WhatARunCannotTellIsNamedWithTheMotionThatWould) {
  GeneratedRun run = GenerateRail({.seed = 8});
  // It never leaves: nothing tells of the clock.
  std::erase_if(run.recording.imu, [&](const ImuSample& sample) {
    return SecondsBetween(run.recording.imu.front().ends_at, sample.ends_at) > 9.8;
  });
  const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
  ASSERT_TRUE(line);
  EXPECT_THAT(EstimateOf(*line, "camera_time_offset_s").missing_motion, HasSubstr("motion"));
  EXPECT_EQ(EstimateOf(*line, "gyro_bias_z_rad_s").missing_motion, "");
  EXPECT_EQ(line->points.back().distance_m, 0.0);
}

struct BadStart {
  const char* name;
  std::function<void(GeneratedRun&)> spoil;
  RailStartFault fault;
};

TEST(RailStart, WhatIsWrongIsSaid) {
  const std::vector<BadStart> cases = {
      {"moves",
       [](GeneratedRun& run) { run.setup.start.at_rest_s = 12.0; },
       RailStartFault::kMovesAtStart},
      {"degrees",
       [](GeneratedRun& run) {
         for (ImuSample& sample : run.recording.imu) sample.gyro_rad_s *= 180.0 / 3.14159265;
       },
       RailStartFault::kWrongRateUnit},
      {"in g",
       [](GeneratedRun& run) {
         for (ImuSample& sample : run.recording.imu) sample.accel_m_s2 /= 9.80665;
       },
       RailStartFault::kWrongForce},
      {"biased",
       [](GeneratedRun& run) {
         for (ImuSample& sample : run.recording.imu) sample.gyro_rad_s.z() += 0.005;
       },
       RailStartFault::kBiasTooLarge},
      {"frozen",
       [](GeneratedRun& run) {
         for (ImuSample& sample : run.recording.imu) sample.gyro_rad_s.y() = 0.001;
       },
       RailStartFault::kFrozen},
      {"short", [](GeneratedRun& run) { run.recording.imu.resize(100); }, RailStartFault::kNoImu},
      {"no rest",
       [](GeneratedRun& run) { run.setup.start.at_rest_s = 0.5; },
       RailStartFault::kNoRest},
      {"elsewhere",
       [](GeneratedRun& run) { run.setup.start.position_world_m += Eigen::Vector3d(0, 0, 5); },
       RailStartFault::kNoTargetFits},
      {"sees nothing",
       [](GeneratedRun& run) {
         for (TargetImage& image : run.recording.images) image.pixels.clear();
       },
       RailStartFault::kNoHeading},
  };
  for (const BadStart& one : cases) {
    GeneratedRun run = GenerateRail({.seed = 9});
    one.spoil(run);
    const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kSmoothed);
    ASSERT_FALSE(line) << one.name;
    EXPECT_EQ(line.error().fault, one.fault) << one.name;
  }
}

// A whole run as files.
std::string Csv(const std::vector<ImuSample>& imu) {
  std::ostringstream text;
  text.precision(12);
  text
      << "stamp_ns,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2\n";
  for (const ImuSample& s : imu) {
    text << s.ends_at.ns << "," << s.gyro_rad_s.x() << "," << s.gyro_rad_s.y() << ","
         << s.gyro_rad_s.z() << "," << s.accel_m_s2.x() << "," << s.accel_m_s2.y() << ","
         << s.accel_m_s2.z() << "\n";
  }
  return text.str();
}

constexpr const char* kRailYaml =
    "gravity_m_s2: 9.80665\n"
    "imu: {rate_hz: 200, angle_random_walk_deg_sqrt_h: 0.2, velocity_random_walk_ug_sqrt_hz: 30, "
    "gyro_bias_deg_h: 30, accel_bias_mg: 1.0}\n"
    "start: {position_m: [1, 13.45, 1.2], sigma_position_mm: 0.1, heading_known: true, "
    "heading_deg: -90, sigma_heading_deg: 0.05, at_rest_s: 9.5}\n";

class LineCommand : public testing::Test {
 protected:
  LineCommand() {
    RailScene scene;
    scene.has_targets = false;
    run_ = GenerateRail(scene);
    WriteText(folder_ / "rail.yaml", kRailYaml);
    WriteText(folder_ / "imu.csv", Csv(run_.recording.imu));
  }
  ExitCode Run(LineRequest request = {}) {
    request.run = folder_.path();
    if (request.out.empty()) request.out = folder_ / "line.csv";
    out_.str("");
    err_.str("");
    return RunLine(request, Console{out_, err_});
  }
  // The whole run with one file's text changed; what it complains of.
  std::string Complaint(const std::string& file, const std::string& text) {
    const std::string good = test::ReadText(folder_ / file);
    WriteText(folder_ / file, text);
    EXPECT_EQ(Run(), ExitCode::kBadInput) << file << ": " << text.substr(0, 100);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "line.csv"));
    WriteText(folder_ / file, good);
    return err_.str();
  }

  TempFolder folder_;
  GeneratedRun run_;
  std::ostringstream out_;
  std::ostringstream err_;
};

TEST_F(LineCommand, WritesATableAndWhatItRestsOn) {
  ASSERT_EQ(Run(), ExitCode::kDone) << err_.str();
  std::ifstream table(folder_ / "line.csv");
  std::string header;
  std::getline(table, header);
  EXPECT_EQ(header,
            "stamp_ns,distance_m,x_m,y_m,z_m,qw,qx,qy,qz,sigma_x_mm,sigma_y_mm,sigma_z_mm,status");
  std::size_t rows = 0;
  for (std::string row; std::getline(table, row);) ++rows;
  EXPECT_EQ(rows, run_.recording.imu.size());
  const std::string report = test::ReadText(folder_ / "line.json");
  EXPECT_THAT(report, HasSubstr("\"gyro_bias_z_rad_s\""));
  EXPECT_THAT(report, HasSubstr("\"nis_per_dof\""));
  EXPECT_THAT(out_.str(), HasSubstr("samples"));
  // Nothing is written over.
  EXPECT_EQ(Run(), ExitCode::kBadInput);
  EXPECT_THAT(err_.str(), HasSubstr("line.csv"));
}

TEST_F(LineCommand, FaultsNameFileLineAndColumn) {
  const std::string imu = Csv(run_.recording.imu);
  const auto lines = [&](std::size_t count) {
    std::size_t at = 0;
    for (std::size_t i = 0; i < count; ++i) at = imu.find('\n', at) + 1;
    return at;
  };
  std::string swapped = imu;
  const std::string row = imu.substr(lines(100), lines(101) - lines(100));
  swapped.erase(lines(100), row.size());
  swapped.insert(lines(110) - row.size(), row);
  EXPECT_THAT(Complaint("imu.csv", swapped), HasSubstr("imu.csv:110: column stamp_ns"));
  std::string twice = imu;
  twice.insert(lines(101), row);
  EXPECT_THAT(Complaint("imu.csv", twice), HasSubstr("the stamp of the row before"));
  std::string word = imu;
  word.replace(lines(50) + 20, 3, "abc");
  EXPECT_THAT(Complaint("imu.csv", word), HasSubstr("imu.csv:51"));
  GeneratedRun frozen = run_;
  for (std::size_t i = 500; i < 520; ++i) frozen.recording.imu[i].gyro_rad_s.y() = 0.00012;
  EXPECT_THAT(Complaint("imu.csv", Csv(frozen.recording.imu)),
              testing::AllOf(HasSubstr("imu.csv:502: column gyro_y_rad_s"), HasSubstr("frozen")));
  GeneratedRun saturated = run_;
  for (std::size_t i = 500; i < 508; ++i) saturated.recording.imu[i].accel_m_s2.z() = 98.0665;
  EXPECT_THAT(Complaint("imu.csv", Csv(saturated.recording.imu)), HasSubstr("saturated"));
  GeneratedRun degrees = run_;
  for (ImuSample& sample : degrees.recording.imu) sample.gyro_rad_s *= 57.29578;
  EXPECT_THAT(Complaint("imu.csv", Csv(degrees.recording.imu)), HasSubstr("degrees per second"));

  std::string yaml = kRailYaml;
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = yaml;
    changed.replace(changed.find(from), from.size(), to);
    return Complaint("rail.yaml", changed);
  };
  EXPECT_THAT(with("rate_hz: 200", "rate_hz: 100"), HasSubstr("rows come every 5 ms"));
  EXPECT_THAT(with("rate_hz: 200", "rate_hz: -1"), HasSubstr("rail.yaml:2: imu.rate_hz"));
  EXPECT_THAT(with("at_rest_s: 9.5", "at_rest_s: 13"), HasSubstr("the trolley moves"));
  EXPECT_THAT(with("at_rest_s: 9.5", "at_rest_s: 1"), HasSubstr("start.at_rest_s"));
  EXPECT_THAT(with(" sigma_position_mm: 0.1,", ""), HasSubstr("start.sigma_position_mm"));
  EXPECT_THAT(with(" heading_deg: -90,", ""), HasSubstr("there is no heading_deg"));
  EXPECT_THAT(with(" sigma_heading_deg: 0.05,", ""), HasSubstr("there is no sigma_heading_deg"));
  EXPECT_THAT(with("start:", "odometer: {position_m: [0, 0, 0], sigma_mm: 0}\nstart:"),
              testing::AllOf(HasSubstr("rail.yaml:3: odometer.rotation"),
                             HasSubstr("odometer.sigma_mm"),
                             HasSubstr("odometer.sigma_scale_ppm"),
                             HasSubstr("odometer.sigma_rotation_deg"),
                             HasSubstr("odometer.sigma_side_mm_s")));
  EXPECT_THAT(with("accel_bias_mg", "accel_bias_ug"), HasSubstr("accel_bias_ug"));
  EXPECT_THAT(with("gravity_m_s2: 9.80665", "gravity_m_s2: 981"), HasSubstr("gravity_m_s2"));

  WriteText(folder_ / "targets.csv", "target,x_m,y_m,z_m,sigma_mm\nT1,1,2,3,0.1\n");
  WriteText(folder_ / "centres.csv", "stamp_ns,target,u_px,v_px\n1790000000100000000,T9,1,2\n");
  EXPECT_EQ(Run(), ExitCode::kBadInput);
  EXPECT_THAT(err_.str(), HasSubstr("centres.csv:2: column target: 'T9' does not stand in"));
  WriteText(folder_ / "targets.csv", "target,x_m,y_m,z_m,sigma_mm\nT1,1,2,3,0.1\nT1,1,2,3,0.1\n");
  EXPECT_EQ(Run(), ExitCode::kBadInput);
  EXPECT_THAT(err_.str(), HasSubstr("targets.csv:3"));
  WriteText(folder_ / "tilt.csv", "stamp_ns,sensor,beta_deg,gamma_deg\n1,front,0,0\n");
  EXPECT_EQ(Run(), ExitCode::kBadInput);
  EXPECT_THAT(err_.str(), HasSubstr("tilt.csv:2: column sensor"));
}

TEST_F(LineCommand, WhatIsNotUsedIsTold) {
  WriteText(folder_ / "tilt.csv", "stamp_ns,sensor,beta_deg,gamma_deg\n1,trolley,0,0\n");
  WriteText(folder_ / "odometer.csv", "stamp_ns,distance_m\n1,0\n2,0.5\n");
  WriteText(folder_ / "displacement.csv",
            "from_ns,to_ns,dx_m,dy_m,sigma_m\n1790000000100000000,1790000000200000000,0,0,0.001\n");
  ASSERT_EQ(Run(), ExitCode::kDone) << err_.str();
  for (const char* file : {"tilt.csv", "odometer.csv", "displacement.csv"}) {
    EXPECT_THAT(err_.str(), HasSubstr(std::string(file) + ": is not used")) << file;
  }
}

TEST_F(LineCommand, MissingSamplesAreBridgedAndTold) {
  GeneratedRun gap = run_;
  gap.recording.imu.erase(gap.recording.imu.begin() + 600, gap.recording.imu.begin() + 620);
  WriteText(folder_ / "imu.csv", Csv(gap.recording.imu));
  ASSERT_EQ(Run(), ExitCode::kDone) << err_.str();
  EXPECT_THAT(err_.str(), HasSubstr("imu.csv:602"));
  EXPECT_THAT(err_.str(), HasSubstr("100 ms are missing"));
  EXPECT_THAT(test::ReadText(folder_ / "line.csv"), HasSubstr(",gap\n"));
}

TEST_F(LineCommand, AFolderThatIsNoneIsSaid) {
  LineRequest request;
  request.out = folder_ / "x.csv";
  request.run = folder_ / "nothing";
  std::ostringstream out;
  std::ostringstream err;
  EXPECT_EQ(RunLine(request, Console{out, err}), ExitCode::kBadInput);
  EXPECT_THAT(err.str(), HasSubstr("is not a folder"));
}

}  // namespace
}  // namespace tbm
