#include "guidance/app/rail_run.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/app/line_command.h"
#include "guidance/app/line_file.h"
#include "guidance/rail/rail_line.h"
#include "tests/guidance/rail/small_rail_run.h"

namespace tbm {
namespace {

using test::Random;
using test::SmallRailRun;
using ::testing::AllOf;
using ::testing::HasSubstr;

// Either a line of which every number is one, or a reason.
void SolveOrSay(RailRunTexts texts) {
  const auto run = ParseRailRun("run", std::move(texts));
  if (!run) {
    ASSERT_FALSE(run.error().empty());
    for (const FileFault& fault : run.error()) EXPECT_THAT(fault.Text(), HasSubstr("run/"));
    return;
  }
  const auto line = SolveRailLine(run->setup, run->recording, RailMethod::kSmoothed);
  if (!line) return;
  for (const RailPoint& point : line->points) {
    ASSERT_TRUE(point.position_world_m.allFinite());
    ASSERT_TRUE((point.sigma_world_m.array() > 0.0).all());
  }
}

TEST(SmallRailRun, IsReadWholeAndSolved) {
  const auto run = ParseRailRun("run", SmallRailRun());
  ASSERT_TRUE(run) << run.error().front().Text();
  EXPECT_TRUE(run->warnings.empty()) << run->warnings.front();
  EXPECT_EQ(run->recording.imu.size(), 200u);
  EXPECT_EQ(run->recording.images.size(), 10u);
  EXPECT_EQ(run->recording.grounds.size(), 10u);
  const auto line = SolveRailLine(run->setup, run->recording, RailMethod::kSmoothed);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->points.back().position_world_m.x(), 0.05, 2e-3);
  EXPECT_EQ(line->consistency[static_cast<std::size_t>(FusionUpdate::kTargets)].given,
            line->consistency[static_cast<std::size_t>(FusionUpdate::kTargets)].accepted);
}

TEST(RailRunBytes, CutFlippedAndGluedFilesAreRefusedOrReadAsTheyStand) {
  const RailRunTexts whole = SmallRailRun();
  Random random("rail run bytes");
  for (const auto& file : whole) {
    const std::string& name = file.first;
    const std::string& text = file.second;
    SCOPED_TRACE(name);
    const auto with = [&](std::string other) {
      RailRunTexts texts = whole;
      texts[name] = std::move(other);
      SolveOrSay(std::move(texts));
    };
    for (int i = 0; i < 12; ++i) {
      with(text.substr(0, static_cast<std::size_t>(random.Index(static_cast<int>(text.size())))));
    }
    for (int i = 0; i < 40; ++i) {
      std::string flipped = text;
      const auto at = static_cast<std::size_t>(random.Index(static_cast<int>(text.size())));
      flipped[at] = static_cast<char>(flipped[at] ^ (1 << random.Index(8)));
      with(std::move(flipped));
    }
    with(text + text);
    with("");
  }
}

TEST(RailRunBytes, ALineFileIsReadAsItStandsOrRefused) {
  std::string whole =
      "stamp_ns,distance_m,x_m,y_m,z_m,qw,qx,qy,qz,sigma_x_mm,sigma_y_mm,sigma_z_mm,status\n";
  for (int i = 0; i < 9; ++i) {
    whole += fmt::format("{},{},{},0,0,1,0,0,0,0.2,0.2,0.2,{}\n",
                         100 + i,
                         0.1 * i,
                         0.1 * i,
                         i % 3 == 0 ? "fixed" : "bridged");
  }
  const auto read = [](const std::string& text) {
    const auto line = ParseLineFile(text, "line.csv");
    if (!line) {
      ASSERT_FALSE(line.error().empty());
      return;
    }
    ASSERT_GE(line->points.size(), 2u);
    for (std::size_t i = 0; i < line->points.size(); ++i) {
      const RailPoint& point = line->points[i];
      ASSERT_TRUE(point.position_world_m.allFinite());
      ASSERT_TRUE((point.sigma_world_m.array() > 0.0).all());
      ASSERT_TRUE(i == 0 || point.at > line->points[i - 1].at);
    }
  };
  EXPECT_EQ(ParseLineFile(whole, "line.csv")->points.size(), 9u);
  for (std::size_t length = 0; length <= whole.size(); ++length) read(whole.substr(0, length));
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (int bit = 0; bit < 8; bit += 3) {
      std::string flipped = whole;
      flipped[at] = static_cast<char>(flipped[at] ^ (1 << bit));
      read(flipped);
    }
  }
  read(whole + whole);
}

TEST(RailRunTruth, AnAttitudeThatIsNoneIsRefused) {
  RailRunTexts texts = SmallRailRun();
  texts["truth.csv"] = "stamp_ns,x_m,y_m,z_m,qw,qx,qy,qz\n5,0,0,0,0,0,0,0\n";
  const auto run = ParseRailRun("run", std::move(texts));
  ASSERT_FALSE(run);
  EXPECT_THAT(run.error().front().Text(),
              AllOf(HasSubstr("run/truth.csv:2: column qw"), HasSubstr("must be 1")));
}

}  // namespace
}  // namespace tbm
