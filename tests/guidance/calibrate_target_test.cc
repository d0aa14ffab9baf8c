#include <cmath>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "guidance/app/calibrate_command.h"
#include "guidance/app/target_input.h"
#include "guidance/config/calibration_parts.h"
#include "pose/base/angle.h"
#include "pose/rig/rig_text.h"
#include "tests/support/calibration_data.h"
#include "tests/support/command.h"
#include "tests/support/scene.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::Ran;
using test::ReadText;
using test::Rows;
using test::TempFolder;
using test::WriteText;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const std::string kDrawing =
    "led,x_mm,y_mm,z_mm\nP1,-250,0,100\nP2,250,0,100\nP3,0,250,0\nP4,0,-250,0\nP5,80,80,250\n";

void Replace(std::string* text, const std::string& from, const std::string& to) {
  const std::size_t at = text->find(from);
  ASSERT_NE(at, std::string::npos) << from;
  text->replace(at, from.size(), to);
}

// The published board, its inclinometer turned by some degrees, built as it is drawn.
class CalibrateTarget : public ::testing::Test {
 protected:
  CalibrateTarget() {
    survey_.rig = test::PublishedRig();
    survey_.rig.target_tilt.tilt_from_body = test::FieldRig().target_tilt.tilt_from_body;
    fs::create_directory(folder_ / "placements");
    WriteText(folder_ / "drawing.csv", kDrawing);
    Survey();
  }
  void Survey() { test::MakeBoardSurvey(folder_ / "placements", survey_); }

  CalibrateTargetRequest Request() const {
    CalibrateTargetRequest request;
    request.folder = folder_ / "placements";
    request.nominal = folder_ / "drawing.csv";
    request.out = folder_ / "target.yaml";
    request.sigma_mm = survey_.sigma_mm;
    return request;
  }
  std::string Placement(const std::string& name) const { return folder_ / ("placements/" + name); }
  // One file of the survey with something wrong in it.
  void Spoil(const std::string& name, const std::string& from, const std::string& to) const {
    std::string text = ReadText(Placement(name));
    Replace(&text, from, to);
    WriteText(Placement(name), text);
  }
  // A point of a CSV placement, moved.
  void Move(const std::string& name, const std::string& led, const Eigen::Vector3d& by_mm) const {
    std::string text;
    for (const auto& row : Rows(ReadText(Placement(name)))) {
      const bool is_it = row[1] == led;
      const auto place = [&](int i) {
        const auto at = static_cast<std::size_t>(2 + i);
        return is_it ? fmt::format("{:.2f}", std::stod(row[at]) + by_mm[i]) : row[at];
      };
      text += fmt::format("{},{},{},{},{}\n", row[0], row[1], place(0), place(1), place(2));
    }
    WriteText(Placement(name), text);
  }
  // The reading of a placement, off by so much in both angles.
  void Retype(const std::string& name, double by_deg) const {
    std::string text;
    for (const auto& row : Rows(ReadText(Placement("tilt.csv")))) {
      text += row[0] == name
                  ? fmt::format(
                        "{},{},{}\n", name, std::stod(row[1]) + by_deg, std::stod(row[2]) + by_deg)
                  : fmt::format("{}\n", fmt::join(row, ","));
    }
    WriteText(Placement("tilt.csv"), text);
  }
  Outcome Refused() const {
    const Outcome outcome = Ran(RunCalibrateTarget, Request());
    EXPECT_EQ(outcome.code, ExitCode::kBadInput);
    EXPECT_FALSE(fs::exists(Request().out));
    return outcome;
  }

  TempFolder folder_;
  test::BoardSurvey survey_;
};

TEST_F(CalibrateTarget, ItsFileIsTheTargetsPartOfARigFile) {
  auto request = Request();
  request.report = folder_ / "report";
  const Outcome outcome = Ran(RunCalibrateTarget, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("5 LEDs, 6 placements, 30 points"), HasSubstr("R1")));
  const auto part = LoadTargetPart(request.out);
  ASSERT_TRUE(part.has_value()) << part.error()[0].Text();
  ASSERT_EQ(part->leds.size(), 5u);
  for (std::size_t j = 0; j < 5; ++j) {
    const Led& led = part->leds[j];
    EXPECT_EQ(led.id, survey_.rig.leds[j].id);
    EXPECT_LT((led.p_led_in_target - survey_.rig.leds[j].p_led_in_target).norm(),
              4.0 * std::sqrt(3.0) * led.sigma_m);
    EXPECT_GT(led.sigma_m, 0.02e-3);
    EXPECT_LT(led.sigma_m, 0.06e-3) << "0.1 mm, six times";
  }
  // Of up on a level board, which is what it is for.
  const Eigen::Matrix3d& truth = survey_.rig.target_tilt.tilt_from_body;
  const Eigen::Vector3d up = part->mount.tilt_from_body.transpose() * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d true_up = truth.transpose() * Eigen::Vector3d::UnitZ();
  EXPECT_LT((up - true_up).norm(), 4.0 * part->mount.mounting_sigma_rad);
  EXPECT_LT(RadToDeg(part->mount.mounting_sigma_rad), 0.02);
  EXPECT_GT(RadToDeg(part->mount.mounting_sigma_rad), 0.002);
  EXPECT_NEAR(RadToDeg(part->mount.sigma_rad), 0.005, 1e-9);

  const auto rows = Rows(ReadText(request.report + "/target.csv"));
  ASSERT_EQ(rows.size(), 1u + 30u);
  EXPECT_EQ(rows[6][0], "s2.gsi");
  EXPECT_EQ(rows[6][1], "P1");
  EXPECT_EQ(rows[0][7], "controlled");
  EXPECT_EQ(rows[6][7], "3");
  const auto json = nlohmann::json::parse(ReadText(request.report + "/target.json"));
  EXPECT_EQ(json["degrees_of_freedom"], 90 - 15 - 36 + 6);
  EXPECT_EQ(json["leds"][4]["id"], "P5");
  EXPECT_EQ(json["placements"].size(), 6u);
  EXPECT_LT(json["placements"][3]["reading_off_deg"].get<double>(), 0.05);
  EXPECT_GT(json["mounting"]["mounting_sigma_deg"].get<double>(), 0.0);
}

TEST_F(CalibrateTarget, TheNominalPlacesMayComeFromARigFileOrFromItsOwn) {
  ASSERT_EQ(Ran(RunCalibrateTarget, Request()).code, ExitCode::kDone);
  auto again = Request();
  again.out = folder_ / "again.yaml";
  for (const std::string nominal : {"drawing.csv", "target.yaml", "rig.yaml"}) {
    SCOPED_TRACE(nominal);
    WriteText(folder_ / "rig.yaml", RigYaml(survey_.rig));
    again.nominal = folder_ / nominal;
    again.force = true;
    const Outcome outcome = Ran(RunCalibrateTarget, again);
    ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
    const auto part = LoadTargetPart(again.out);
    ASSERT_TRUE(part.has_value());
    EXPECT_LT((part->leds[3].p_led_in_target - survey_.rig.leds[3].p_led_in_target).norm(), 2e-4);
  }
}

TEST_F(CalibrateTarget, WhatIsMissingForTheMountingIsNamedAndTheLedsAreWritten) {
  const auto missing = [&](const std::string& why) {
    auto request = Request();
    request.force = true;
    const Outcome outcome = Ran(RunCalibrateTarget, request);
    EXPECT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("warning: no R1"), HasSubstr(why)));
    EXPECT_THAT(outcome.out, HasSubstr("no R1"));
    EXPECT_TRUE(LoadLeds(request.out).has_value());
    const auto part = LoadTargetPart(request.out);
    EXPECT_FALSE(part.has_value());
    if (!part) {
      EXPECT_THAT(part.error()[0].Text(),
                  AllOf(StartsWith(request.out), HasSubstr("inclinometers: missing")));
    }
  };
  std::string tilts = ReadText(Placement("tilt.csv"));
  fs::remove(Placement("tilt.csv"));
  missing("there are 0");
  tilts.resize(tilts.find("s2.gsi"));
  WriteText(Placement("tilt.csv"), tilts);
  missing("there is 1");
  survey_.lean_deg = 0.1;
  Survey();
  missing("tilt it by ten degrees or more");
  survey_.lean_deg = 2.5;
  survey_.sigma_mm = 3.0;
  Survey();
  missing("tilt the board further");
}

TEST_F(CalibrateTarget, ReadingsThatContradictThePointsAreRefused) {
  // Of another placement.
  std::string tilts = ReadText(Placement("tilt.csv"));
  Replace(&tilts, "s2.gsi", "x");
  Replace(&tilts, "s5.csv", "s2.gsi");
  Replace(&tilts, "x", "s5");  // a name without its ending will do
  WriteText(Placement("tilt.csv"), tilts);
  EXPECT_THAT(Refused().err, AllOf(HasSubstr("tilt.csv: no R1"), HasSubstr("its placement")));
  // Mistyped by half a degree.
  Survey();
  Retype("s4.gsi", 0.5);
  EXPECT_THAT(Refused().err,
              AllOf(HasSubstr("tilt.csv: the reading of s4.gsi is 0."),
                    HasSubstr("from where the points and all other readings put it"),
                    HasSubstr("tilt.csv: no R1")));
  // Counted the other way.
  Survey();
  std::string turned;
  for (const auto& row : Rows(ReadText(Placement("tilt.csv")))) {
    turned += row[0] == "placement" ? "placement,beta_deg,gamma_deg\n"
                                    : fmt::format("{},{},{}\n", row[0], -std::stod(row[1]), row[2]);
  }
  WriteText(Placement("tilt.csv"), turned);
  EXPECT_THAT(Refused().err, HasSubstr("with --sign -1 1 they would fit"));
  auto request = Request();
  request.sign = {-1.0, 1.0};
  ASSERT_EQ(Ran(RunCalibrateTarget, request).code, ExitCode::kDone);
  EXPECT_EQ(LoadTargetPart(request.out)->mount.sign[0], -1.0);
}

TEST_F(CalibrateTarget, WhatIsWrongWithThePointsIsSaidWithFileLedAndSize) {
  struct Case {
    const char* what;
    std::function<void()> spoil;
    std::vector<std::string> words;
  };
  const auto keep_only = [&](const std::string& name, std::size_t rows) {
    std::string text;
    for (const auto& row : Rows(ReadText(Placement(name)))) {
      if (rows-- > 0) text += fmt::format("{}\n", fmt::join(row, ","));
      if (rows == 0) break;
    }
    WriteText(Placement(name), text);
  };
  const std::vector<Case> cases = {
      {"two LEDs only",
       [&] { keep_only("s3.csv", 3); },
       {"placements/s3.csv: has P1, P2 only", "three LEDs or more"}},
      {"exchanged",
       [&] {
         Spoil("s3.csv", ",P1,", ",Px,");
         Spoil("s3.csv", ",P5,", ",P1,");
         Spoil("s3.csv", ",Px,", ",P5,");
       },
       {"s3.csv: names are exchanged", "the point named P1 is P5", "the point named P5 is P1"}},
      {"exchanged in a GSI file",
       [&] {
         Spoil("s2.gsi", "0P3 ", "0Px ");
         Spoil("s2.gsi", "0P4 ", "0P3 ");
         Spoil("s2.gsi", "0Px ", "0P4 ");
       },
       {"s2.gsi: names are exchanged", "the point named P3 is P4"}},
      {"one point off by 2 mm",
       [&] {
         Move("s5.csv", "P4", {0.0, 0.0, 2.0});
       },
       {"s5.csv: P4 is ", "from where all other points put it", "--sigma-mm"}},
      {"three points off by 2 mm",
       [&] {
         Move("s5.csv", "P4", {0.0, 0.0, 2.0});
         Move("s3.csv", "P1", {2.0, 0.0, 0.0});
         Move("s1.csv", "P5", {0.0, -2.0, 0.0});
       },
       {"s5.csv: P4 is ", "s3.csv: P1 is ", "s1.csv: P5 is "}},
      {"a placement with two readings",
       [&] { Spoil("tilt.csv", "s2.gsi", "s1,1,1\ns2.gsi"); },
       {"tilt.csv:3: column placement: s1.csv has its reading in line 2 already"}},
      {"a name that two files have",
       [&] {
         WriteText(Placement("s1.gsi"), ReadText(Placement("s2.gsi")));
         Spoil("tilt.csv", "s1.csv", "s1");
       },
       {"tilt.csv:2: column placement: 's1' may be s1.csv or s1.gsi; write the ending"}},
      {"one point far away",
       [&] {
         Move("s1.csv", "P2", {0.0, 5000.0, 0.0});
       },
       {"s1.csv: P2 is 500", "measure it again"}},
      {"other board",
       [&] {
         WriteText(folder_ / "drawing.csv",
                   "led,x_mm,y_mm,z_mm\nP1,-350,0,100\nP2,350,0,100\nP3,0,350,0\nP4,0,-350,0\n"
                   "P5,80,80,250\n");
       },
       {"s1.csv: this is not the board of", "drawing.csv", "is allowed", "should be"}},
      {"columns in m",
       [&] {
         std::string text;
         for (const auto& row : Rows(ReadText(Placement("s1.csv")))) {
           if (row[1] == "point") {
             text += "stamp_ns,point,x_mm,y_mm,z_mm\n";
             continue;
           }
           text += fmt::format(",{},{:.5f},{:.5f},{:.5f}\n",
                               row[1],
                               1e-3 * std::stod(row[2]),
                               1e-3 * std::stod(row[3]),
                               1e-3 * std::stod(row[4]));
         }
         WriteText(Placement("s1.csv"), text);
       },
       {"s1.csv: this is not the board", "are these columns in m?"}},
      {"north before east",
       [&] { Spoil("s1.csv", "x_mm,y_mm", "y_mm,x_mm"); },
       {"s1.csv: the points are a mirror image", "east, north, height"}},
      {"on one line",
       [&] {
         WriteText(folder_ / "drawing.csv",
                   "led,x_mm,y_mm,z_mm\nP1,-250,0,100\nP2,250,0,100\nP3,0,3,100\nP4,0,-250,0\n"
                   "P5,80,80,250\n");
         keep_only("s1.csv", 4);
       },
       {"s1.csv: its LEDs P1, P2, P3 stand on one line", "beside it"}},
      {"never measured",
       [&] { WriteText(folder_ / "drawing.csv", kDrawing + "P6,0,0,50\n"); },
       {"LED P6 was measured in no placement", "drawing.csv"}},
      {"two placements in one file",
       [&] {
         WriteText(Placement("s1.csv"),
                   ReadText(Placement("s1.csv")) + ReadText(Placement("s3.csv")).substr(30));
       },
       {"s1.csv:7: column point: P1 is ", "from where line 2 has it", "a file of its own"}},
      {"names of its own",
       [&] {
         for (int i = 1; i <= 5; ++i) {
           Spoil("s1.csv", fmt::format(",P{},", i), fmt::format(",{},", i));
         }
       },
       {"s1.csv: has none of the LEDs P1, P2, P3, P4, P5; its points are", "'1', '2'"}},
      {"no number",
       [&] { Spoil("s1.csv", ",P3,", ",P3,x"); },
       {"s1.csv:4: column x_mm", "not a number"}},
      {"beyond the map",
       [&] { Spoil("s1.csv", ",P3,", ",P3,1e200,1,1\n,Px,"); },
       {"s1.csv:4", "allowed is"}},
      {"no placement of that name",
       [&] { Spoil("tilt.csv", "s4.gsi", "s9.gsi"); },
       {"tilt.csv:5: column placement: 's9.gsi' is no file of the folder", "s6.gsi"}},
      {"no angle", [&] { Spoil("tilt.csv", "gamma_deg", "gamma"); }, {"tilt.csv:1", "gamma_deg"}},
      {"no folder",
       [&] { fs::remove_all(folder_ / "placements"); },
       {"placements: cannot be read"}},
      {"empty folder",
       [&] {
         fs::remove_all(folder_ / "placements");
         fs::create_directory(folder_ / "placements");
       },
       {"holds no placement", ".gsi"}},
      {"no drawing",
       [&] { fs::remove(folder_ / "drawing.csv"); },
       {"drawing.csv: cannot be opened"}}};
  for (const Case& one : cases) {
    SCOPED_TRACE(one.what);
    fs::remove_all(folder_ / "placements");
    fs::create_directory(folder_ / "placements");
    WriteText(folder_ / "drawing.csv", kDrawing);
    Survey();
    one.spoil();
    const Outcome outcome = Refused();
    for (const std::string& word : one.words) EXPECT_THAT(outcome.err, HasSubstr(word));
  }
}

TEST_F(CalibrateTarget, TwoPlacementsThatDisagreeAreBothNamedAndOneAloneIsWarnedOf) {
  survey_.placements = 2;
  fs::remove_all(folder_ / "placements");
  fs::create_directory(folder_ / "placements");
  Survey();
  Move("s1.csv", "P4", {0.0, 0.0, 4.0});
  EXPECT_THAT(
      Refused().err,
      AllOf(HasSubstr("s1.csv: P4"), HasSubstr("s2.gsi: P4"), HasSubstr("another placement")));
  fs::remove(Placement("s2.gsi"));
  fs::remove(Placement("tilt.csv"));
  const Outcome alone = Ran(RunCalibrateTarget, Request());
  EXPECT_EQ(alone.code, ExitCode::kDone);
  EXPECT_THAT(alone.err, HasSubstr("nothing controls the points"));
}

TEST_F(CalibrateTarget, ADoubtfulPointIsWarnedOf) {
  auto request = Request();
  request.sigma_mm = 0.2;
  request.report = folder_ / "report";
  for (int step = 1; step < 40; ++step) {
    Survey();
    Move("s3.csv", "P4", {0.0, 0.05 * step, 0.0});
    request.force = true;
    const Outcome outcome = Ran(RunCalibrateTarget, request);
    ASSERT_EQ(outcome.code, ExitCode::kDone) << "warned of before it is refused: " << outcome.err;
    if (outcome.err.empty()) continue;
    EXPECT_GT(step, 10);
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("warning: "), HasSubstr("s3.csv: P4 is ")));
    const auto row = Rows(ReadText(request.report + "/target.csv"))[1 + 10 + 3];
    EXPECT_EQ(row[1], "P4");
    EXPECT_NEAR(std::stod(row[5]), 0.05 * step, 0.5) << "how far from the others";
    EXPECT_GT(std::stod(row[6]), 16.3);
    return;
  }
  FAIL() << "never warned of";
}

TEST_F(CalibrateTarget, PointsOfOtherThingsAndRepeatedOnesAreTakenAsTheyAre) {
  const std::string csv = ReadText(Placement("s1.csv"));
  const std::size_t first = csv.find(",P1,");
  const std::string again = csv.substr(first, csv.find('\n', first) + 1 - first);
  WriteText(Placement("s1.csv"), csv + ",REF7,1,2,3\n" + again);
  auto request = Request();
  request.sigma_mm = 0.045;
  Outcome outcome = Ran(RunCalibrateTarget, request);
  EXPECT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("passed over"), HasSubstr("'REF7'")));
  EXPECT_THAT(outcome.err, HasSubstr("times as much as --sigma-mm 0.045"));
  // More than three times is no scatter.
  request.sigma_mm = 0.02;
  request.out = folder_ / "other.yaml";
  outcome = Ran(RunCalibrateTarget, request);
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("--sigma-mm 0.02"), HasSubstr("the worst is s")));
  EXPECT_FALSE(fs::exists(request.out));
}

TEST_F(CalibrateTarget, ARigFileSaysOfOneReadingWhatTheTableDoes) {
  std::string text;
  for (const auto& row : Rows(ReadText(Placement("tilt.csv")))) {
    const char* sigma = row[0] == "placement" ? "sigma_deg" : row[0] == "s3.csv" ? "0.02" : "0.008";
    text += fmt::format("{},{}\n", fmt::join(row, ","), sigma);
  }
  WriteText(Placement("tilt.csv"), text);
  const Outcome outcome = Ran(RunCalibrateTarget, Request());
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("of one reading 0.02"));
  EXPECT_NEAR(RadToDeg(LoadTargetPart(Request().out)->mount.sigma_rad), 0.02, 1e-9);
}

TEST_F(CalibrateTarget, ReadingsWorseThanTheirSigmaMakeThatOfTheMountingLarger) {
  ASSERT_EQ(Ran(RunCalibrateTarget, Request()).code, ExitCode::kDone);
  const double good_rad = LoadTargetPart(Request().out)->mount.mounting_sigma_rad;
  survey_.tilt_sigma_deg = 0.02;
  Survey();
  auto request = Request();
  request.force = true;
  const Outcome outcome = Ran(RunCalibrateTarget, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("the sigma of the mounting is that much larger"));
  EXPECT_GT(LoadTargetPart(request.out)->mount.mounting_sigma_rad, 1.5 * good_rad);
}

TEST_F(CalibrateTarget, NothingIsReplacedUnlessForced) {
  auto request = Request();
  WriteText(request.out, "mine");
  EXPECT_THAT(Ran(RunCalibrateTarget, request).err, HasSubstr("exists already"));
  EXPECT_EQ(ReadText(request.out), "mine");
  request.out = folder_ / "other.yaml";
  request.report = folder_ / "report";
  fs::create_directory(request.report);
  WriteText(request.report + "/target.json", "mine");
  EXPECT_EQ(Ran(RunCalibrateTarget, request).code, ExitCode::kBadInput);
  EXPECT_FALSE(fs::exists(request.out)) << "found out before the work";
  request.force = true;
  EXPECT_EQ(Ran(RunCalibrateTarget, request).code, ExitCode::kDone);
  EXPECT_NE(ReadText(request.report + "/target.json"), "mine");
}

TEST(LedDrawing, EachFaultNamesLineAndColumn) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> cases = {
      {"led,x_mm,y_mm\n", {"d.csv:1", "z_mm"}},
      {"led,x_mm,y_mm,z_mm\nP1,0,0,0\nP2,1,0,0\n", {"d.csv: has 2 LEDs", "3 .. 32"}},
      {"led,x_mm,y_mm,z_mm\nP1,0,0,0\nP1,9,0,0\nP3,0,9,0\n", {"d.csv:3", "led", "two LEDs"}},
      {"led,x_mm,y_mm,z_mm\nP 1,0,0,0\nP2,9,0,0\nP3,0,9,0\n", {"d.csv:2", "led", "letters"}},
      {"led,x_mm,y_mm,z_mm\nP1,0,0,0\nP2,9,x,0\nP3,0,9,0\n", {"d.csv:3", "y_mm", "not a number"}},
      {"led,x_mm,y_mm,z_mm\nP1,0,0,0\nP2,9,0,0\nP3,0,9,2e5\n", {"d.csv:4", "z_mm", "100000"}}};
  for (const auto& [text, words] : cases) {
    const auto leds = ParseLedDrawing(text, "d.csv");
    ASSERT_FALSE(leds) << text;
    for (const std::string& word : words) EXPECT_THAT(leds.error()[0].Text(), HasSubstr(word));
  }
}

}  // namespace
}  // namespace tbm
