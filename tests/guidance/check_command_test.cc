#include "guidance/app/check_command.h"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::Outcome;
using test::ReadText;
using test::TempFolder;
using test::WriteText;
using ::testing::HasSubstr;

const std::string kTable2 = TBM_SOURCE_DIR "/tests/data/paper_table2/";

Outcome Check(const CheckRequest& request) { return test::Ran(RunCheck, request); }

CheckRequest Table2(const std::string& method) {
  CheckRequest request;
  request.poses = kTable2 + method + ".csv";
  request.log = kTable2 + "total_station.csv";
  request.point = "shield_head";
  return request;
}

// Figures worked out by hand from the printed coordinates.
TEST(CheckCommand, GivesTheFiguresOfThePaperTable2) {
  const TempFolder folder;
  for (const auto& [method, mean_mm, max_mm] :
       {std::tuple("combined", 2.53, 3.82), {"vision", 4.01, 5.26}}) {
    CheckRequest request = Table2(method);
    request.report = folder / method;
    const Outcome outcome = Check(request);
    ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
    const auto json = nlohmann::json::parse(ReadText(request.report + "/check.json"));
    EXPECT_NEAR(json["distance"]["mean_mm"].get<double>(), mean_mm, 0.005);
    EXPECT_NEAR(json["distance"]["max_mm"].get<double>(), max_mm, 0.005);
    EXPECT_EQ(json["observations"], 6);
    EXPECT_EQ(json["align"], "none");
  }
}

TEST(CheckCommand, WritesOneRowPerObservation) {
  const TempFolder folder;
  CheckRequest request = Table2("combined");
  request.report = folder / "report";
  ASSERT_EQ(Check(request).code, ExitCode::kDone);
  const std::string csv = ReadText(request.report + "/check.csv");
  EXPECT_TRUE(
      csv.starts_with("stamp_ns,pairing,pose_x_mm,pose_y_mm,pose_z_mm,log_x_mm,log_y_mm,log_z_mm,"
                      "dx_mm,dy_mm,dz_mm,distance_mm\n"
                      ",in_order,39.2788,1363.1400,4517.9500,36.0705,1363.3100,4515.8800,3.2083,-0."
                      "1700,2.0700,3.8219\n"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 7);
  EXPECT_TRUE(ReadText(request.report + "/check.png").starts_with("\x89PNG"));
}

TEST(CheckCommand, PrintsWhatItDid) {
  const Outcome outcome = Check(Table2("combined"));
  EXPECT_THAT(outcome.out, HasSubstr("6 in_order"));
  EXPECT_THAT(outcome.out, HasSubstr("align     none"));
  EXPECT_THAT(outcome.out, HasSubstr("  distance     2.531     2.681     3.822     3.822"));
}

TEST(CheckCommand, RigidAlignmentSaysItsDegreesOfFreedom) {
  CheckRequest request = Table2("combined");
  request.align_rigid = true;
  EXPECT_THAT(Check(request).out, HasSubstr("rigid: took 6 degrees of freedom of 18"));
}

TEST(CheckCommand, NeverReplacesAReportUnlessForced) {
  const TempFolder folder;
  CheckRequest request = Table2("combined");
  request.report = folder.path();
  WriteText(folder / "check.json", "mine");
  const Outcome refused = Check(request);
  EXPECT_EQ(refused.code, ExitCode::kBadInput);
  EXPECT_THAT(refused.err, HasSubstr("check.json: exists already"));
  EXPECT_EQ(ReadText(folder / "check.json"), "mine");
  EXPECT_FALSE(std::filesystem::exists(folder / "check.csv")) << "nothing of it is written";
  request.force = true;
  EXPECT_EQ(Check(request).code, ExitCode::kDone);
  EXPECT_NE(ReadText(folder / "check.json"), "mine");
}

TEST(CheckCommand, BadInputIsSaidInOneSentence) {
  CheckRequest request = Table2("combined");
  request.poses = "/nowhere.csv";
  EXPECT_EQ(Check(request).code, ExitCode::kBadInput);
  EXPECT_THAT(Check(request).err, HasSubstr("/nowhere.csv: cannot be opened"));
  request = Table2("combined");
  request.point = "tail";
  EXPECT_THAT(Check(request).err, HasSubstr("no point 'tail'; it has shield_head"));
  request = Table2("combined");
  request.log_point = "T9";
  EXPECT_THAT(Check(request).err, HasSubstr("no point 'T9'; it has shield_head"));
}

}  // namespace
}  // namespace tbm
