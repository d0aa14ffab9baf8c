#include "guidance/app/axis_command.h"

#include <cmath>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::Outcome;
using test::Ran;
using test::ReadText;
using test::TempFolder;
using test::WriteText;
using ::testing::HasSubstr;

const std::string kFolder = TBM_SOURCE_DIR "/tests/data/axis/";
const std::string kBad = TBM_SOURCE_DIR "/tests/data/config_bad/axis/";
AxisSource Example() { return {kFolder + "example.xml", {}}; }

template <class Request>
Request For(const AxisSource& source) {
  Request request;
  request.source = source;
  return request;
}

using Row = std::map<std::string, std::string>;
std::vector<Row> Rows(const std::string& csv) {
  const auto split = [](const std::string& line) {
    std::vector<std::string> fields;
    std::istringstream stream(line + ",");
    for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
    return fields;
  };
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  const auto header = split(line);
  std::vector<Row> rows;
  while (std::getline(lines, line)) {
    const auto fields = split(line);
    EXPECT_EQ(fields.size(), header.size()) << line;
    Row row;
    for (std::size_t i = 0; i < std::min(fields.size(), header.size()); ++i) {
      row[header[i]] = fields[i];
    }
    rows.push_back(row);
  }
  return rows;
}
double Number(const Row& row, const std::string& column) { return std::stod(row.at(column)); }

TEST(AxisCommand, CheckSaysNothingOddOfTheExample) {
  auto request = For<AxisCheckRequest>(Example());
  const Outcome outcome = Ran(RunAxisCheck, request);
  EXPECT_EQ(outcome.code, ExitCode::kDone);
  EXPECT_THAT(outcome.out, HasSubstr("nothing odd"));
  EXPECT_THAT(outcome.out, HasSubstr("10000.000 .. 10800.000"));
  EXPECT_THAT(outcome.out, HasSubstr("10830.000 (section 2)"));
  EXPECT_EQ(outcome.err, "");
}

TEST(AxisCommand, CheckNamesLineChainageAndSize) {
  const TempFolder folder;
  std::string text = ReadText(kFolder + "example.xml");
  // The second line of the axis begins 2.5 mm aside; the curve turns to the other side.
  const std::string start = "<Start>12354.9766891 4819.4648936</Start>";
  text.replace(text.find(start), start.size(), "<Start>12354.9791891 4819.4648936</Start>");
  WriteText(folder / "odd.xml", text);
  const Outcome odd = Ran(RunAxisCheck, For<AxisCheckRequest>({folder / "odd.xml", {}}));
  EXPECT_EQ(odd.code, ExitCode::kDone) << "odd is usable";
  EXPECT_THAT(odd.out, HasSubstr("odd.xml:19: chainage 10420.000 m: gap of 2.50 mm"));
  const std::string curve = "<Curve rot=\"cw\"";
  text.replace(text.find(curve), curve.size(), "<Curve rot=\"ccw\"");
  WriteText(folder / "mirrored.xml", text);
  auto request = For<AxisCheckRequest>({folder / "mirrored.xml", {}});
  const Outcome refused = Ran(RunAxisCheck, request);
  EXPECT_EQ(refused.code, ExitCode::kBadInput);
  EXPECT_THAT(refused.out, HasSubstr("refused  " + (folder / "mirrored.xml") + ":15:"));
  EXPECT_THAT(refused.out, HasSubstr("turns to the other side"));
  request.as_json = true;
  const auto json = nlohmann::json::parse(Ran(RunAxisCheck, request).out);
  EXPECT_EQ(json["usable"], false);
  EXPECT_EQ(json["axis_sha256"].get<std::string>().size(), 64u);
  bool is_there = false;
  for (const auto& remark : json["remarks"]) {
    is_there = is_there || (remark["code"] == "turning_mirrored" && remark["line"] == 15 &&
                            remark["refused"] == true);
  }
  EXPECT_TRUE(is_there);
}

TEST(AxisCommand, EvalGivesBothChainagesAndTheHash) {
  auto request = For<AxisEvalRequest>(Example());
  request.at_m = {10250.0, 10655.0};
  const Outcome outcome = Ran(RunAxisEval, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  const auto rows = Rows(outcome.out);
  ASSERT_EQ(rows.size(), 2u);
  // From example_table.csv and by hand.
  const auto table = Rows(ReadText(kFolder + "example_table.csv"));
  for (const char* column : {"east_m", "north_m", "up_m"}) {
    EXPECT_NEAR(Number(rows[0], column), Number(table[250], column), 1e-6) << column;
  }
  EXPECT_NEAR(Number(rows[0], "curvature_right_per_m"), 1.0 / 350.0, 1e-9);
  EXPECT_NEAR(Number(rows[0], "gradient_mm_per_m"), -6.0, 1e-6) << "half-way from -20 to +8";
  EXPECT_EQ(rows[0].at("cant_mm"), "110.000");
  EXPECT_EQ(rows[0].at("official_m"), "10250.000000");
  EXPECT_EQ(rows[1].at("official_m"), "10685.000000");
  EXPECT_EQ(rows[1].at("official_section"), "2");
  EXPECT_EQ(rows[1].at("axis_sha256").size(), 64u);
}

TEST(AxisCommand, EvalFindsOfficialNumbersTwiceOrNotAtAll) {
  auto request = For<AxisEvalRequest>(Example());
  request.is_official = true;
  request.at_m = {10690.0};
  const auto twice = Rows(Ran(RunAxisEval, request).out);
  ASSERT_EQ(twice.size(), 2u);
  EXPECT_EQ(twice[0].at("chainage_m"), "10640.000000");
  EXPECT_EQ(twice[1].at("chainage_m"), "10660.000000");
  request.at_m = {10320.0};
  const Outcome nowhere = Ran(RunAxisEval, request);
  EXPECT_EQ(nowhere.code, ExitCode::kBadInput);
  EXPECT_THAT(nowhere.err, HasSubstr("stands nowhere on the wall"));
}

TEST(AxisCommand, EvalWalksFromStartToEnd) {
  const TempFolder folder;
  auto request = For<AxisEvalRequest>(Example());
  request.step_m = 300.0;
  request.out = folder / "points.csv";
  ASSERT_EQ(Ran(RunAxisEval, request).code, ExitCode::kDone);
  const auto rows = Rows(ReadText(request.out));
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_EQ(rows[3].at("chainage_m"), "10800.000000");
  EXPECT_EQ(Ran(RunAxisEval, request).code, ExitCode::kBadInput) << "never over an existing file";
  auto outside = For<AxisEvalRequest>(Example());
  outside.at_m = {9999.0};
  EXPECT_THAT(Ran(RunAxisEval, outside).err, HasSubstr("goes from 10000.000 to 10800.000"));
}

TEST(AxisCommand, ProjectFindsTheDeviationsThatTheShotsWereMadeWith) {
  auto request = For<AxisProjectRequest>(Example());
  request.points = kFolder + "example_shots.csv";
  const Outcome outcome = Ran(RunAxisProject, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  const auto rows = Rows(outcome.out);
  const auto truth = Rows(ReadText(request.points));
  ASSERT_EQ(rows.size(), truth.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    SCOPED_TRACE(rows[i].at("point"));
    EXPECT_EQ(rows[i].at("point"), truth[i].at("point"));
    EXPECT_EQ(rows[i].at("status"), "ok");
    EXPECT_NEAR(Number(rows[i], "chainage_m"), Number(truth[i], "true_chainage_m"), 2e-6);
    EXPECT_NEAR(
        Number(rows[i], "deviation_right_mm"), 1e3 * Number(truth[i], "true_right_m"), 2e-3);
    EXPECT_NEAR(Number(rows[i], "deviation_up_mm"), 1e3 * Number(truth[i], "true_up_m"), 2e-3);
  }
}

TEST(AxisCommand, ProjectWritesARowAlsoForWhatHasNoFoot) {
  const TempFolder folder;
  WriteText(folder / "far.csv", "point,east_m,north_m,up_m\nA,0,0,0\nB,4512.4,12080,412\n");
  auto request = For<AxisProjectRequest>(Example());
  request.points = folder / "far.csv";
  const auto rows = Rows(Ran(RunAxisProject, request).out);
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].at("status"), "none");
  EXPECT_EQ(rows[0].at("reason"), "too_far");
  EXPECT_EQ(rows[0].at("chainage_m"), "");
  EXPECT_EQ(rows[1].at("reason"), "before_start");
  WriteText(folder / "bad.csv", "east_m,north_m,up_m\n1,2,three\n");
  request.points = folder / "bad.csv";
  const Outcome bad = Ran(RunAxisProject, request);
  EXPECT_EQ(bad.code, ExitCode::kBadInput);
  EXPECT_THAT(bad.err, HasSubstr("bad.csv:2: column up_m: 'three'"));
}

TEST(AxisCommand, ComplainsOfEveryFaultOfTheFile) {
  const auto request = For<AxisEvalRequest>({kBad + "spiral_type_radioid.xml", {}});
  const Outcome outcome = Ran(RunAxisEval, request);
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err, HasSubstr(":11: "));
  EXPECT_THAT(outcome.err, HasSubstr("names a family"));
  EXPECT_EQ(outcome.out, "");
}

// Names come from files: they are text, not commands, and need not be UTF-8.
TEST(AxisCommand, NamesAreOnlyText) {
  const TempFolder folder;
  std::string text = ReadText(kFolder + "example.xml");
  const std::string name = "name=\"north tube\"";
  text.replace(text.find(name),
               name.size(),
               "name=\"n\xFC' \nsystem 'touch " + (folder / "harm") + "' &#10;\x1b[31m\"");
  WriteText(folder / "axis.xml", text);
  const AxisSource source{folder / "axis.xml", {}};
  auto check = For<AxisCheckRequest>(source);
  const Outcome shown = Ran(RunAxisCheck, check);
  EXPECT_EQ(shown.code, ExitCode::kDone);
  EXPECT_EQ(shown.out.find('\x1b'), std::string::npos);
  check.as_json = true;
  EXPECT_EQ(nlohmann::json::parse(Ran(RunAxisCheck, check).out)["usable"], true);
  auto plot = For<AxisPlotRequest>(source);
  plot.out = folder / "axis.png";
  EXPECT_EQ(Ran(RunAxisPlot, plot).code, ExitCode::kDone);
  EXPECT_FALSE(std::filesystem::exists(folder / "harm"));
  WriteText(folder / "points.csv",
            "point,east_m,north_m,up_m\n\"ring 1, left\",4519.5,12098.0,411.7\n");
  auto project = For<AxisProjectRequest>(source);
  project.points = folder / "points.csv";
  EXPECT_THAT(Ran(RunAxisProject, project).out, HasSubstr("\n\"ring 1, left\",ok,,10012."));
}

TEST(AxisCommand, PlotDrawsAPicture) {
  const TempFolder folder;
  auto request = For<AxisPlotRequest>(Example());
  request.out = folder / "axis.png";
  const Outcome outcome = Ran(RunAxisPlot, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_GT(ReadText(request.out).size(), 20'000u);
  EXPECT_EQ(Ran(RunAxisPlot, request).code, ExitCode::kBadInput) << "never over an existing file";
}

// Seen on 2026-11-23: the example machine's axis has no cant, and there was no picture of it.
TEST(AxisCommand, PlotDrawsADesignWithoutCant) {
  const TempFolder folder;
  auto request = For<AxisPlotRequest>({TBM_SOURCE_DIR "/guidance/app/example/axis.xml", {}});
  request.out = folder / "axis.png";
  const Outcome outcome = Ran(RunAxisPlot, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_GT(ReadText(request.out).size(), 20'000u);
}

TEST(AxisCommand, PlotDrawsPointsWithoutHeights) {
  const TempFolder folder;
  WriteText(folder / "axis.csv", "east_m,north_m\n0,0\n0,10\n0,20\n1,30\n");
  auto request = For<AxisPlotRequest>({folder / "axis.csv", {}});
  request.out = folder / "axis.png";
  const Outcome outcome = Ran(RunAxisPlot, request);
  EXPECT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
}

}  // namespace
}  // namespace tbm
