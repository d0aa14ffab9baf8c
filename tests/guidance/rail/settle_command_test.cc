#include "guidance/app/settle_command.h"

#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/app/geometry_command.h"
#include "tests/support/command.h"
#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::Outcome;
using test::Ran;
using test::Random;
using test::ReadText;
using test::Rows;
using test::TempFolder;
using test::WriteText;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

const std::string kHeader =
    "stamp_ns,distance_m,x_m,y_m,z_m,qw,qx,qy,qz,sigma_x_mm,sigma_y_mm,sigma_z_mm,status\n";

struct Line {
  int day = 0;
  int draw = 0;  // of the noise
  double length_m = 40.0;
  double noise_m = 0.0;
  std::function<double(double)> up_m = [](double) { return 0.0; };
};

std::string Text(const Line& line) {
  Random random("settle command", static_cast<std::uint64_t>(line.day + 1000 * line.draw));
  std::string text = kHeader;
  const int count = static_cast<int>(std::lround(line.length_m / 0.05));
  for (int i = 0; i <= count; ++i) {
    const double m = 0.05 * i;
    text += fmt::format(
        "{},{:.6f},{:.6f},2.000000,{:.6f},1.000000000,0.000000000,0.000000000,0.000000000,0.300,"
        "0.300,0.300,fixed\n",
        1'790'000'000'000'000'000 + line.day * 86'400'000'000'000 + i * 50'000'000LL,
        m,
        m,
        5.0 + line.up_m(m) + random.Normal(line.noise_m));
  }
  return text;
}

double Trough(double m) { return -0.003 * std::exp(-0.5 * std::pow((m - 20.0) / 3.0, 2)); }

class SettleCommand : public ::testing::Test {
 protected:
  std::string File(const std::string& name, const std::string& text) {
    WriteText(folder_ / name, text);
    return folder_ / name;
  }
  SettleRequest Request(const std::vector<Line>& later) {
    SettleRequest request;
    request.base = File("base.csv", Text({.noise_m = 3e-4}));
    for (const Line& line : later) {
      request.later.push_back(File(fmt::format("day_{}.csv", line.day), Text(line)));
    }
    request.out = folder_ / "settlement.csv";
    return request;
  }

  TempFolder folder_;
};

TEST_F(SettleCommand, WritesThePromisedColumnsAndTheTrough) {
  SettleRequest request = Request({{.day = 30, .noise_m = 3e-4, .up_m = Trough}});
  const Outcome outcome = Ran(RunSettle, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  const std::string text = ReadText(request.out);
  EXPECT_THAT(text, StartsWith("distance_m,dz_mm,sigma_mm,significant\n0.000000,"));
  const auto rows = Rows(text);
  ASSERT_EQ(rows.size(), 402u);
  EXPECT_EQ(rows[201][0], "20.000000");
  EXPECT_NEAR(std::stod(rows[201][1]), -3.0, 4 * 0.43);
  EXPECT_NEAR(std::stod(rows[201][2]), 0.3 * std::numbers::sqrt2, 1e-3);
  EXPECT_EQ(rows[201][3], "1");
  EXPECT_THAT(outcome.out, HasSubstr("401 of 401 places compared"));
  EXPECT_THAT(outcome.out, HasSubstr("settlement "));
  EXPECT_THAT(outcome.out, HasSubstr("trough: "));
  EXPECT_THAT(outcome.out, Not(HasSubstr("datum")));
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(Ran(RunSettle, request).code, ExitCode::kBadInput) << "the file is there";
  request.force = true;
  EXPECT_EQ(Ran(RunSettle, request).code, ExitCode::kDone);
}

TEST_F(SettleCommand, SaysThatNothingMoved) {
  const Outcome outcome = Ran(RunSettle, Request({{.day = 30, .noise_m = 3e-4}}));
  EXPECT_THAT(outcome.out, HasSubstr("nothing moved that chance would not give"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("trough")));
}

// Four epochs of 401 places, 40 times: how often each part of the summary speaks.
struct Spoken {
  int summary = 0;
  int alert = 0;
  int trend = 0;
};
constexpr int kDraws = 40;

Spoken SpokenOf(const TempFolder& folder, const std::function<double(double)>& sunk_by_60_m) {
  Spoken spoken;
  for (int draw = 0; draw < kDraws; ++draw) {
    SettleRequest request;
    request.base = folder / "base.csv";
    WriteText(request.base, Text({.draw = draw, .noise_m = 3e-4}));
    for (const int day : {20, 40, 60}) {
      request.later.push_back(folder / fmt::format("day_{}.csv", day));
      const auto up_m = [&](double m) { return day / 60.0 * sunk_by_60_m(m); };
      WriteText(request.later.back(),
                Text({.day = day, .draw = draw, .noise_m = 3e-4, .up_m = up_m}));
    }
    request.out = folder / "settlement.csv";
    request.alert_mm = {0.5, 2.0};
    request.force = true;
    const Outcome outcome = Ran(RunSettle, request);
    EXPECT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
    const auto says = [&](const std::string& text) {
      return outcome.out.find(text) != std::string::npos ? 1 : 0;
    };
    const std::string last = outcome.out.substr(outcome.out.find("day_60.csv: "));
    spoken.summary += last.find("nothing moved") == std::string::npos ? 1 : 0;
    spoken.alert += 1 - says("alert: none");
    spoken.trend += 1 - says("trend: none");
  }
  return spoken;
}

// At most 5 % each; of 40 that is beyond 6 in 0.3 % of all cases.
TEST_F(SettleCommand, WhatDidNotMoveIsRarelySaidToMove) {
  const Spoken spoken = SpokenOf(folder_, [](double) { return 0.0; });
  EXPECT_LE(spoken.summary, 6);
  EXPECT_LE(spoken.alert, 6);
  EXPECT_LE(spoken.trend, 6);
}

TEST_F(SettleCommand, ATroughIsAlwaysFound) {
  const Spoken spoken = SpokenOf(folder_, Trough);
  EXPECT_EQ(spoken.summary, kDraws);
  EXPECT_EQ(spoken.alert, kDraws);
  EXPECT_EQ(spoken.trend, kDraws);
}

TEST_F(SettleCommand, SaysThatTheDatumMayHaveMoved) {
  const auto raised = [](double) { return 0.002; };
  const Outcome outcome = Ran(RunSettle, Request({{.day = 30, .noise_m = 3e-4, .up_m = raised}}));
  EXPECT_THAT(outcome.out, HasSubstr("the datum may have moved: the whole line is "));
  EXPECT_THAT(outcome.out, HasSubstr("+- 0.42 higher"));
  SettleRequest request = Request({{.day = 31, .noise_m = 3e-4, .up_m = raised}});
  request.alert_mm = {1.0};
  request.out = folder_ / "with_alert.csv";
  EXPECT_THAT(Ran(RunSettle, request).out,
              HasSubstr("alert: none\n  counted beside the shift of the whole line\n"));
}

TEST_F(SettleCommand, SeveralEpochsInTheOrderOfTimeWithTrendAndAlerts) {
  const auto part = [](double scale) { return [scale](double m) { return scale * Trough(m); }; };
  SettleRequest request = Request({{.day = 60, .up_m = part(2.0)},
                                   {.day = 20, .up_m = part(0.5)},
                                   {.day = 40, .up_m = Trough}});
  request.alert_mm = {1.0, 3.0, 5.0};
  request.plot = folder_ / "settlement.png";
  const Outcome outcome = Ran(RunSettle, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  const auto rows = Rows(ReadText(request.out));
  const std::vector<std::string> header = {"distance_m",
                                           "dz_mm",
                                           "sigma_mm",
                                           "significant",
                                           "alert",
                                           "trend_mm_per_day",
                                           "trend_sigma_mm_per_day",
                                           "trend_significant",
                                           "dz_1_mm",
                                           "sigma_1_mm",
                                           "dz_2_mm",
                                           "sigma_2_mm",
                                           "dz_3_mm",
                                           "sigma_3_mm"};
  EXPECT_EQ(rows[0], header);
  const auto& deepest = rows[201];
  EXPECT_EQ(deepest[1], deepest[12]) << "the last in time, not in the command line";
  EXPECT_NEAR(std::stod(deepest[8]) - std::stod(deepest[12]), 4.5, 1e-3);
  EXPECT_NEAR(std::stod(deepest[10]) - std::stod(deepest[12]), 3.0, 1e-3);
  EXPECT_NEAR(std::stod(deepest[5]), -0.1, 0.02);
  EXPECT_EQ(deepest[7], "1");
  EXPECT_EQ(deepest[4], "alarm");
  EXPECT_EQ(rows[1][4], "none");
  EXPECT_THAT(outcome.out, HasSubstr("alarm: 5 mm or more at "));
  EXPECT_THAT(outcome.out, HasSubstr("trend: lowest -0."));
  EXPECT_THAT(outcome.out, Not(HasSubstr("trend: highest")));
  EXPECT_THAT(ReadText(request.plot), StartsWith("\x89PNG"));
}

TEST_F(SettleCommand, TableOnTheStandardOutputIsNothingElse) {
  SettleRequest request = Request({{.day = 30}});
  request.out = "-";
  const Outcome outcome = Ran(RunSettle, request);
  EXPECT_EQ(Rows(outcome.out).size(), 402u);
  EXPECT_THAT(outcome.err, HasSubstr("places compared"));
}

TEST_F(SettleCommand, EachFaultNamesFileLineColumnAndWhatIsRight) {
  const std::string good = Text({.day = 30, .length_m = 1.0});
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
  };
  const std::string third = "0.100000,0.100000,2.000000,5.000000,1.000000000,";
  struct Case {
    std::string text;
    std::string message;
  };
  const std::vector<Case> cases = {
      {"", "bad.csv: is empty; the first line must be stamp_ns,"},
      {kHeader, "bad.csv: has fewer than two rows"},
      {with("sigma_z_mm", "sigma_z_m"), "bad.csv:1: column sigma_z_mm: is missing"},
      {with("17925920001", "1.7925920001"),
       "bad.csv:4: column stamp_ns: '1.792592000100000000' is not an integer"},
      {with("17925920001", "17925920000"),
       "bad.csv:4: column stamp_ns: 1792592000000000000 does "
       "not come after 1792592000050000000 of line 3"},
      {with(third, "0.04" + third.substr(4)),
       "bad.csv:4: column distance_m: 0.04 is less than 0.05 of line 3"},
      {with(third, "0.100000,0.100000,2.000000,abc,1.000000000,"),
       "bad.csv:4: column z_m: 'abc' is not a number"},
      {with(third, "0.100000,0.100000,nan,5.000000,1.000000000,"),
       "bad.csv:4: column y_m: 'nan' is not a finite number"},
      {with(third, "0.100000,1e12,2.000000,5.000000,1.000000000,"),
       "bad.csv:4: column x_m: is no place on earth"},
      {with(third, "0.100000,0.100000,2.000000,5.000000,0.900000000,"),
       "bad.csv:4: column qw: qw,qx,qy,qz have the length 0.9; it must be 1"},
      {with("0.300,fixed", "0.000,fixed"), "bad.csv:2: column sigma_z_mm: must be more than 0"},
      {with("0.300,fixed", "-0.300,fixed"), "bad.csv:2: column sigma_z_mm: must be more than 0"},
      {with("0.300,fixed", "0.300,fine"),
       "bad.csv:2: column status: 'fine' is none of fixed, bridged, open, gap"},
      {with("0.300,fixed", "0.300"), "bad.csv:2: has 12 fields; the header has 13"},
  };
  for (const Case& c : cases) {
    for (const bool as_base : {true, false}) {
      SettleRequest request = Request({});
      const std::string bad = File("bad.csv", c.text);
      request.later = {as_base ? File("later.csv", good) : bad};
      if (as_base) request.base = bad;
      const Outcome outcome = Ran(RunSettle, request);
      EXPECT_EQ(outcome.code, ExitCode::kBadInput) << c.message;
      EXPECT_THAT(outcome.err, HasSubstr(folder_ / c.message));
      EXPECT_EQ(ReadText(request.out), "");
    }
  }
}

TEST_F(SettleCommand, SaysEveryFaultOfBothFiles) {
  SettleRequest request;
  request.base = folder_ / "nowhere.csv";
  std::string text = Text({.day = 30, .length_m = 1.0});
  for (std::size_t at = 0, i = 0; i < 3; ++i) {
    at = text.find("fixed", at);
    text.replace(at, 5, "wrong");
  }
  request.later = {File("bad.csv", text)};
  request.out = folder_ / "settlement.csv";
  const std::string err = Ran(RunSettle, request).err;
  EXPECT_THAT(err, HasSubstr("nowhere.csv: cannot be opened"));
  for (const char* line : {"bad.csv:2:", "bad.csv:3:", "bad.csv:4:"}) {
    EXPECT_THAT(err, HasSubstr(line));
  }
}

TEST_F(SettleCommand, CutLastLineIsPassedOver) {
  SettleRequest request = Request({});
  std::string text = Text({.day = 30});
  text.resize(text.size() - 4);
  request.later = {File("cut.csv", text)};
  const Outcome outcome = Ran(RunSettle, request);
  EXPECT_EQ(outcome.code, ExitCode::kDone);
  EXPECT_THAT(outcome.err, HasSubstr("cut.csv: the last line is cut short and passed over"));
}

TEST_F(SettleCommand, RefusesWhatIsNoSecondEpoch) {
  SettleRequest request = Request({{.day = 30}});
  request.later.push_back(request.base);
  EXPECT_THAT(Ran(RunSettle, request).err,
              HasSubstr("base.csv:2: column stamp_ns: 1790000000000000000 is not after"));
  request = Request({{.day = 30}});
  std::swap(request.base, request.later[0]);
  EXPECT_THAT(Ran(RunSettle, request).err, HasSubstr("the base must be the earliest"));
  request = Request({});
  std::string text = Text({.day = 30});
  for (std::size_t at = 0; (at = text.find(",2.000000,5.", at)) != std::string::npos;) {
    text.replace(at, 12, ",9.000000,5.");
  }
  request.later = {File("aside.csv", text)};
  EXPECT_THAT(Ran(RunSettle, request).err,
              HasSubstr("aside.csv: column x_m: no part of the line is within half a metre"));
}

TEST_F(SettleCommand, RefusesOptionsThatMeanNothing) {
  const auto message = [&](const std::function<void(SettleRequest&)>& change) {
    SettleRequest request = Request({{.day = 30}});
    change(request);
    const Outcome outcome = Ran(RunSettle, request);
    EXPECT_EQ(outcome.code, ExitCode::kBadInput);
    return outcome.err;
  };
  EXPECT_THAT(message([](auto& r) { r.step_m = 0.0; }), HasSubstr("--step 0: must be more than 0"));
  EXPECT_THAT(message([](auto& r) { r.step_m = 1e-6; }), HasSubstr("more than a million places"));
  EXPECT_THAT(message([](auto& r) { r.level = 1.0; }), HasSubstr("--level 1: must lie between"));
  EXPECT_THAT(message([](auto& r) {
                r.alert_mm = {3.0, 1.0};
              }),
              HasSubstr("--alert-mm: 1 stands where more than 3 belongs"));
  EXPECT_THAT(message([](auto& r) {
                r.alert_mm = {1.0, 2.0, 3.0, 4.0};
              }),
              HasSubstr("--alert-mm: has 4 numbers"));
}

TEST_F(SettleCommand, GeometryWritesWhatItCanAndLeavesTheRestEmpty) {
  GeometryRequest request;
  const auto wave = [](double m) { return 0.004 * std::sin(2.0 * std::numbers::pi * m / 10.0); };
  request.line = File("line.csv", Text({.length_m = 160.0, .up_m = wave}));
  request.out = folder_ / "geometry.csv";
  const Outcome outcome = Ran(RunGeometry, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  const auto rows = Rows(ReadText(request.out));
  const std::vector<std::string> header = {"distance_m",
                                           "level_d1_mm",
                                           "level_d2_mm",
                                           "alignment_d1_mm",
                                           "alignment_d2_mm",
                                           "cross_level_mm",
                                           "twist_3m_mm_per_m",
                                           "twist_6m_mm_per_m"};
  EXPECT_EQ(rows[0], header);
  EXPECT_EQ(rows[1][0], "0.250000");
  EXPECT_EQ(rows[1][1], "") << "no room: empty, not zero";
  EXPECT_EQ(rows[330][0], "82.500000");
  EXPECT_NEAR(std::stod(rows[330][1]), 4.0, 0.05);
  EXPECT_EQ(rows[330][2], "") << "160 m are too short for 70 m waves";
  EXPECT_NEAR(std::stod(rows[330][3]), 0.0, 1e-3);
  EXPECT_NEAR(std::stod(rows[330][5]), 0.0, 1e-3);
  EXPECT_THAT(outcome.out, HasSubstr("band D1: 3 to 25 m; gain 0.69"));
  EXPECT_THAT(outcome.out,
              HasSubstr("level D2       empty: no part of the line without a hole is "
                        "longer than 280 m"));
}

TEST_F(SettleCommand, GeometryRefusesWithTheReason) {
  GeometryRequest request;
  request.line = File("line.csv", Text({.length_m = 0.5}));
  request.out = folder_ / "geometry.csv";
  EXPECT_THAT(Ran(RunGeometry, request).err,
              HasSubstr("line.csv: column distance_m: no part without a hole is longer"));
  std::string bad = Text({});
  bad.replace(bad.find("fixed"), 5, "fluid");
  request.line = File("line.csv", bad);
  EXPECT_THAT(Ran(RunGeometry, request).err, HasSubstr("line.csv:2: column status: 'fluid'"));
  request.bases_m = {3.0, 3.0};
  EXPECT_THAT(Ran(RunGeometry, request).err, HasSubstr("--bases: 3 stands twice"));
  request.bases_m = {0.1};
  EXPECT_THAT(Ran(RunGeometry, request).err, HasSubstr("--bases: 0.1 must lie between"));
  request.bases_m = {};
  request.step_m = 2.0;
  EXPECT_THAT(Ran(RunGeometry, request).err, HasSubstr("--step 2: must lie between 0.05 and 0.5"));
  request.step_m = 0.25;
  request.gauge_mm = 1.435;
  EXPECT_THAT(Ran(RunGeometry, request).err, HasSubstr("--gauge-mm 1.435: must lie between"));
}

}  // namespace
}  // namespace tbm
