#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "hmi_bridge/app/report_request.h"
#include "hmi_bridge/app/report_runner.h"
#include "tests/idl/dds_support.h"
#include "tests/support/temp_folder.h"

namespace tbm::hmi {
namespace {

using namespace std::chrono_literals;
using dds::test::Eventually;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const ReportPlaces kPlaces{"/opt/tbm", "/site/axis.xml", {"main", "", {500.0, 0.0, 0.25}}, "/j"};

std::string FaultOf(const std::string& json) {
  const auto request = ParseReportRequest(json);
  return request ? "" : request.error().text;
}

TEST(ReportRequest, AxisCheckIsTwoProgramsOfTheMachinesAxis) {
  const auto request = ParseReportRequest(R"({"kind":"axis_check"})");
  ASSERT_TRUE(request);
  const auto commands = CommandsOf(*request, kPlaces);
  ASSERT_TRUE(commands);
  EXPECT_THAT(commands.value(),
              ElementsAre(ElementsAre("/opt/tbm",
                                      "axis",
                                      "check",
                                      "/site/axis.xml",
                                      "--alignment=main",
                                      "--origin",
                                      "500",
                                      "0",
                                      "0.25"),
                          ElementsAre("/opt/tbm",
                                      "axis",
                                      "plot",
                                      "/site/axis.xml",
                                      "--out=axis.png",
                                      "--alignment=main",
                                      "--origin",
                                      "500",
                                      "0",
                                      "0.25")));
}

TEST(ReportRequest, AccuracyNamesPointsAndTime) {
  const auto request = ParseReportRequest(
      R"({"kind":"accuracy","points":["front","cutter_face"],"shots_text":"x","at_utc_ms":1700000000500})");
  ASSERT_TRUE(request);
  EXPECT_EQ(request->shots_text, "x");
  EXPECT_THAT(CommandsOf(*request, kPlaces).value(),
              ElementsAre(ElementsAre("/opt/tbm",
                                      "check",
                                      "/j",
                                      "shots.txt",
                                      "--report=.",
                                      "--point=front",
                                      "--point=cutter_face",
                                      "--at=2023-11-14T22:13:20Z",
                                      "--force")));
}

TEST(ReportRequest, ExportHoldsTheWholeTime) {
  const auto request = ParseReportRequest(
      R"({"kind":"export","topics":["event","command"],"from_utc_ms":1700000000500,"to_utc_ms":1700000001500})");
  ASSERT_TRUE(request);
  EXPECT_THAT(CommandsOf(*request, kPlaces).value(),
              ElementsAre(ElementsAre("/opt/tbm",
                                      "export",
                                      "/j",
                                      "--out=.",
                                      "--topic=event",
                                      "--topic=command",
                                      "--from=2023-11-14T22:13:20Z",
                                      "--to=2023-11-14T22:13:22Z",
                                      "--force")));
}

TEST(ReportRequest, WithoutJournalItIsSaid) {
  const auto request = ParseReportRequest(R"({"kind":"accuracy","shots_text":"x"})");
  ASSERT_TRUE(request);
  ReportPlaces places = kPlaces;
  places.journal_folder.clear();
  EXPECT_THAT(CommandsOf(*request, places).error().text, HasSubstr("journal"));
}

TEST(ReportRequest, NothingButPlainWordsGetsToACommandLine) {
  for (const char* bad : {"",
                          "--force",
                          "-f",
                          "a b",
                          "a/b",
                          "../x",
                          "a\\n",
                          "a\\u0000",
                          ".",
                          "$(id)",
                          "a;b",
                          "a=b",
                          "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"}) {
    EXPECT_NE(
        FaultOf(std::string(R"({"kind":"accuracy","shots_text":"x","points":[")") + bad + "\"]}"),
        "")
        << bad;
  }
}

TEST(ReportRequest, EveryFaultSaysWhatWouldBeRight) {
  EXPECT_THAT(FaultOf(""), HasSubstr("JSON"));
  EXPECT_THAT(FaultOf("[]"), HasSubstr("JSON object"));
  EXPECT_THAT(FaultOf("{}"), HasSubstr("axis_check, accuracy or export"));
  EXPECT_THAT(FaultOf(R"({"kind":7})"), HasSubstr("kind"));
  EXPECT_THAT(FaultOf(R"({"kind":"accuracy"})"), HasSubstr("shots_text"));
  EXPECT_THAT(FaultOf(R"({"kind":"accuracy","shots_text":""})"), HasSubstr("shots_text"));
  EXPECT_THAT(FaultOf(R"({"kind":"accuracy","shots_text":")" + std::string(200'001, 'x') + "\"}"),
              HasSubstr("200000"));
  EXPECT_THAT(FaultOf(R"({"kind":"accuracy","shots_text":"x","at_utc_ms":-1})"),
              HasSubstr("at_utc_ms"));
  EXPECT_THAT(FaultOf(R"({"kind":"export","topics":[],"from_utc_ms":1,"to_utc_ms":2})"),
              HasSubstr("topics"));
  EXPECT_THAT(FaultOf(R"({"kind":"export","topics":["no"],"from_utc_ms":1,"to_utc_ms":2})"),
              HasSubstr("no topic 'no'"));
  EXPECT_THAT(FaultOf(R"({"kind":"export","topics":["event"],"from_utc_ms":2,"to_utc_ms":2})"),
              HasSubstr("from_utc_ms"));
  EXPECT_THAT(FaultOf(R"({"kind":"export","topics":["event"],"from_utc_ms":0,"to_utc_ms":1e11})"),
              HasSubstr("24 hours"));
  EXPECT_THAT(FaultOf(std::string(100'000, '[')), HasSubstr("deep"));
}

TEST(ReportRequest, CutFlippedAndGluedBytesAreReadOrRefused) {
  const std::string good =
      R"({"kind":"export","topics":["event"],"from_utc_ms":1700000000500,"to_utc_ms":1700000001500})";
  std::size_t refused = 0;
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string flipped = good;
    flipped[i] = static_cast<char>(flipped[i] ^ 0x11);
    for (const std::string& bad : {good.substr(0, i), flipped, good + good.substr(0, i + 1)}) {
      const auto request = ParseReportRequest(bad);
      EXPECT_TRUE(request || !request.error().text.empty());
      if (!request) ++refused;
    }
  }
  EXPECT_GT(refused, 2 * good.size());
}

// Stands in for `tbm`: a script that does what the test says.
class Reports : public testing::Test {
 protected:
  ReportRunner& Runner(const std::string& script) {
    const std::string program = folder_ / "tbm";
    test::WriteText(program, "#!/bin/sh\n" + script);
    chmod(program.c_str(), 0700);
    runner_ = std::make_unique<ReportRunner>(
        ReportPlaces{program, "/axis.xml", {}, "/j"}, folder_ / "reports", clock_);
    return *runner_;
  }
  Json View() { return Json::parse(*runner_->View().json); }
  bool Ends() {
    return Eventually(
        [&] {
          const Json view = View();
          return view[0]["state"] == "done" || view[0]["state"] == "failed";
        },
        10s);
  }

  const SystemClock clock_;
  test::TempFolder folder_;
  std::unique_ptr<ReportRunner> runner_;
};

TEST_F(Reports, AreMadeInAFolderOfTheirOwn) {
  ReportRunner& runner =
      Runner("echo \"said $*\"; [ \"$1\" = check ] && cp shots.txt check.csv; exit 0");
  const auto answer = runner.Start(R"({"kind":"accuracy","shots_text":"a,b\n1,2\n"})", "ann");
  ASSERT_TRUE(std::holds_alternative<std::string>(answer));
  EXPECT_EQ(Json::parse(std::get<std::string>(answer))["report_id"], "1");
  ASSERT_TRUE(Ends());
  const Json report = View()[0];
  EXPECT_EQ(report["state"], "done");
  EXPECT_EQ(report["by"], "ann");
  EXPECT_THAT(report["text"].get<std::string>(), HasSubstr("said check /j shots.txt --report=."));
  ASSERT_NE(runner.File("1", "check.csv"), nullptr);
  EXPECT_EQ(*runner.File("1", "check.csv"), "a,b\n1,2\n");
}

TEST_F(Reports, NoOtherFileIsHandedOut) {
  ReportRunner& runner = Runner("ln -s /etc/passwd passwd; mkdir sub; exit 0");
  runner.Start(R"({"kind":"accuracy","shots_text":"x"})", "ann");
  ASSERT_TRUE(Ends());
  for (const char* name :
       {"shots.txt", "passwd", "../1/report.txt", "/etc/passwd", "", ".", "sub", "nothing"}) {
    EXPECT_EQ(runner.File("1", name), nullptr) << name;
  }
  for (const char* id : {"2", "", "../1", "-1", "1x"}) {
    EXPECT_EQ(runner.File(id, "report.txt"), nullptr) << id;
  }
}

TEST_F(Reports, AFailureSaysWhatTheProgramSaid) {
  ReportRunner& runner = Runner("echo 'shots.txt:3: no number' >&2; exit 2");
  runner.Start(R"({"kind":"axis_check"})", "ann");
  ASSERT_TRUE(Ends());
  EXPECT_EQ(View()[0]["state"], "failed");
  EXPECT_THAT(View()[0]["text"].get<std::string>(),
              AllOf(HasSubstr("shots.txt:3: no number"), HasSubstr("ended with 2")));
}

TEST_F(Reports, AreBounded) {
  ReportRunner& runner = Runner("head -c 60000000 /dev/zero > big.csv; exit $?");
  runner.Start(R"({"kind":"axis_check"})", "ann");
  ASSERT_TRUE(Ends());
  EXPECT_EQ(View()[0]["state"], "failed");
  EXPECT_LE(std::filesystem::file_size(folder_ / "reports/1/big.csv"), 50'000'000u);
}

TEST_F(Reports, OnlySoManyWait) {
  ReportRunner& runner = Runner("sleep 60");
  int refused = 0;
  for (int i = 0; i < 8; ++i) {
    const auto answer = runner.Start(R"({"kind":"axis_check"})", "ann");
    const auto* fault = std::get_if<ApiFault>(&answer);
    if (fault != nullptr) {
      EXPECT_EQ(fault->http_status, 429);
      ++refused;
    }
  }
  EXPECT_GE(refused, 3);
}

TEST_F(Reports, EndWithTheBridge) {
  Runner("echo $$ > pid; sleep 600").Start(R"({"kind":"axis_check"})", "ann");
  const std::string pid_file = folder_ / "reports/1/pid";
  ASSERT_TRUE(Eventually([&] { return !test::ReadText(pid_file).empty(); }));
  const std::string pid = test::ReadText(pid_file);
  runner_.reset();
  EXPECT_FALSE(std::filesystem::exists("/proc/" + pid.substr(0, pid.find('\n')) + "/cmdline"));
}

TEST_F(Reports, OldOnesMakeRoom) {
  ReportRunner& runner = Runner("exit 0");
  for (int i = 0; i < 25; ++i) {
    ASSERT_TRUE(
        std::holds_alternative<std::string>(runner.Start(R"({"kind":"axis_check"})", "ann")));
    ASSERT_TRUE(Ends());
  }
  EXPECT_LE(View().size(), ReportRunner::kMostKept + 1);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "reports/1"));
}

}  // namespace
}  // namespace tbm::hmi
