#include "devices/gsi/gsi.h"

#include <numbers>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/gsi/gsi_record.h"
#include "devices/gsi/gsi_writer.h"
#include "devices/gsi/survey_csv.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using ::testing::HasSubstr;

GsiWord WordOf(std::string_view text) {
  const auto blocks = ParseGsi(text, "t.gsi");
  EXPECT_TRUE(blocks.has_value()) << (blocks ? "" : blocks.error().Text());
  return blocks->at(0).words.at(0);
}

TEST(Gsi, ReadsTheSampleBlocksOfBothFormats) {
  const std::string text =
      "*110002+00000000GDEM5415 21.024+0000000003545100 22.024+0000000008959300 "
      "31...0+0000000000013825 "
      "51....+000000000017+000\r\n"
      "110001+00000001 21.322+03496940 22.322+10012345 31..00+00030485 51..1.+0000+000 \n";
  const auto blocks = ParseGsi(text, "t.gsi");
  ASSERT_TRUE(blocks.has_value()) << blocks.error().Text();
  ASSERT_EQ(blocks->size(), 2u);
  const GsiBlock& wide = (*blocks)[0];
  ASSERT_EQ(wide.words.size(), 5u);
  EXPECT_EQ(wide.words[0].index, 11);
  EXPECT_EQ(wide.words[0].data, "00000000GDEM5415");
  EXPECT_EQ(wide.words[3].index, 31);
  EXPECT_DOUBLE_EQ(*GsiLengthM(wide.words[3]), 13.825);
  EXPECT_EQ(wide.words[4].data, "000000000017+000");
  // 0003545100: 35 degrees 45 minutes 10.0 seconds.
  EXPECT_DOUBLE_EQ(*GsiAngleRad(wide.words[1]),
                   (35.0 + 45.0 / 60 + 10.0 / 3600) * std::numbers::pi / 180);
  const GsiBlock& narrow = (*blocks)[1];
  EXPECT_EQ(narrow.line, 2);
  EXPECT_DOUBLE_EQ(*GsiAngleRad(narrow.words[1]), 34.96940 * std::numbers::pi / 200);
  EXPECT_DOUBLE_EQ(*GsiLengthM(narrow.words[3]), 30.485);
}

TEST(Gsi, EveryUnitDigitOfLengthsAndAngles) {
  EXPECT_DOUBLE_EQ(*GsiLengthM(WordOf("81...0+00012345")), 12.345);
  EXPECT_DOUBLE_EQ(*GsiLengthM(WordOf("81...1+00012345")), 12.345 * 0.3048);
  EXPECT_DOUBLE_EQ(*GsiLengthM(WordOf("81...6+00012345")), 1.2345);
  EXPECT_DOUBLE_EQ(*GsiLengthM(WordOf("81...7+00012345")), 1.2345 * 0.3048);
  EXPECT_DOUBLE_EQ(*GsiLengthM(WordOf("81...8-00012345")), -0.12345);
  constexpr double kPi = std::numbers::pi;
  EXPECT_DOUBLE_EQ(*GsiAngleRad(WordOf("21...2+10000000")), kPi / 2);
  EXPECT_DOUBLE_EQ(*GsiAngleRad(WordOf("21...3+09000000")), kPi / 2);
  EXPECT_DOUBLE_EQ(*GsiAngleRad(WordOf("21...4+09000000")), kPi / 2);
  EXPECT_DOUBLE_EQ(*GsiAngleRad(WordOf("21...5+16000000")), kPi / 2);
  EXPECT_FALSE(GsiAngleRad(WordOf("21...4+09060000")).has_value()) << "60 minutes";
  EXPECT_FALSE(GsiAngleRad(WordOf("21...4+09000600")).has_value()) << "60.0 seconds";
  for (const char* wrong :
       {"81...2+00000001", "81....+00000001", "81...9+00000001", "81...0+0000x001"}) {
    EXPECT_FALSE(GsiLengthM(WordOf(wrong)).has_value()) << wrong;
  }
  for (const char* wrong : {"21...0+00000001", "21....+00000001"}) {
    EXPECT_FALSE(GsiAngleRad(WordOf(wrong)).has_value()) << wrong;
  }
}

TEST(Gsi, EachWordHasItsOwnUnit) {
  const auto blocks =
      ParseGsi("110001+00000007 81..00+00001000 82..06+00010000 83..08-00100000", "t.gsi");
  ASSERT_TRUE(blocks.has_value());
  const auto point = PointOf((*blocks)[0], "t.gsi");
  ASSERT_TRUE(point.has_value());
  ASSERT_TRUE(point->has_value());
  EXPECT_EQ((*point)->name, "7");
  EXPECT_DOUBLE_EQ((*point)->east_m, 1.0);
  EXPECT_DOUBLE_EQ((*point)->north_m, 1.0);
  EXPECT_DOUBLE_EQ((*point)->height_m, -1.0);
}

TEST(Gsi, NamesMayHoldBlanksSignsAndEndInBlanks) {
  EXPECT_EQ(WordOf("*110001+0000000NO 4+A-7 ").data, "0000000NO 4+A-7");
  EXPECT_EQ(WordOf("110001+P 1 +2/3 81..00+00000001").data, "P 1 +2/3");
  EXPECT_EQ(WithoutLeadingZeros("00000A0"), "A0");
  EXPECT_EQ(WithoutLeadingZeros("0000"), "0");
  EXPECT_EQ(WithoutLeadingZeros(""), "");
}

TEST(Gsi, MixedWidthsEvenInsideOneBlock) {
  const auto blocks =
      ParseGsi("*110001+0000000000000001 81..00+00001000 82..00+0000000000002000 83..00+00003000\n",
               "t.gsi");
  ASSERT_TRUE(blocks.has_value()) << blocks.error().Text();
  const auto point = PointOf((*blocks)[0], "t.gsi");
  EXPECT_DOUBLE_EQ((*point)->east_m, 1.0);
  EXPECT_DOUBLE_EQ((*point)->north_m, 2.0);
  EXPECT_DOUBLE_EQ((*point)->height_m, 3.0);
}

TEST(Gsi, ThreeDigitIndicesAreNotTwoDigitOnes) {
  EXPECT_EQ(WordOf("531..6+00010132").index, 531);
  EXPECT_EQ(WordOf("561..6+00001224").index, 561);
  EXPECT_EQ(WordOf("110531+00000001").index, 11) << "block number 531";
  EXPECT_EQ(WordOf("410001+00000001").index, 41);
  EXPECT_EQ(WordOf("51....+0012+000").index, 51);
}

TEST(Gsi, PolarReadingsBecomeCoordinates) {
  // 50 gon to the right, zenith angle 100 gon: level, half way between north and east.
  const auto blocks = ParseGsi(
      "110001+00000001 21..02+05000000 22..02+10000000 31..00+00010000 84..00+00001000 "
      "85..00+00002000 86..00+00003000 87..00+00000100 88..00+00001500\n",
      "t.gsi");
  const auto point = PointOf((*blocks)[0], "t.gsi");
  ASSERT_TRUE(point.has_value());
  EXPECT_NEAR((*point)->east_m, 1.0 + 10.0 * std::numbers::sqrt2 / 2, 1e-9);
  EXPECT_NEAR((*point)->north_m, 2.0 + 10.0 * std::numbers::sqrt2 / 2, 1e-9);
  EXPECT_NEAR((*point)->height_m, 3.0 + 1.5 - 0.1, 1e-9);
}

TEST(Gsi, BlocksWithoutCoordinatesAreNoPoints) {
  const auto blocks = ParseGsi(
      "410001+00000TPS\n110002+00000001 21..02+05000000 22..02+10000000 31..00+00000000\n"
      "110003+00000ST1 84..00+00001000 85..00+00002000 86..00+00003000\n",
      "t.gsi");
  ASSERT_TRUE(blocks.has_value());
  for (const GsiBlock& block : *blocks) {
    const auto point = PointOf(block, "t.gsi");
    ASSERT_TRUE(point.has_value());
    EXPECT_FALSE(point->has_value()) << block.line;
  }
}

TEST(Gsi, FaultsNameLineAndWord) {
  const auto cut = ParseGsi("110001+00000001\n110002+00000002 81..00+0000\n", "t.gsi");
  ASSERT_FALSE(cut.has_value());
  EXPECT_THAT(cut.error().Text(), HasSubstr("t.gsi:2: no GSI word at character 17"));
  const auto blocks =
      ParseGsi("110001+00000001 81...2+00000001 82...0+00000001 83...0+00000001\n", "t.gsi");
  const auto point = PointOf((*blocks)[0], "t.gsi");
  ASSERT_FALSE(point.has_value());
  EXPECT_THAT(point.error().Text(), HasSubstr("t.gsi:1: word 81 at character 17: unit '2'"));
}

TEST(Gsi, IsToldFromCsvByItsFirstLine) {
  EXPECT_TRUE(LooksLikeGsi("\r\n*110001+0000000000000001"));
  EXPECT_TRUE(LooksLikeGsi("110001+00000001 81"));
  EXPECT_FALSE(LooksLikeGsi("stamp_ns,point,x_mm,y_mm,z_mm\n"));
  EXPECT_FALSE(LooksLikeGsi(""));
}

TEST(Gsi, SurvivesCutFlippedAndGluedBytes) {
  const std::string good =
      "*110002+00000000GDEM5415 21.024+0000000003545100 22.024+0000000008959300 "
      "31...0+0000000000013825\r\n"
      "110001+00000001 81..00+00001000 82..00+00002000 83..00+00003000\n";
  const auto read = [](const std::string& text) {
    const auto blocks = ParseGsi(text, "t.gsi");
    if (!blocks) return;
    for (const GsiBlock& block : *blocks) (void)PointOf(block, "t.gsi").has_value();
  };
  for (std::size_t size = 0; size <= good.size(); ++size) {
    read(good.substr(0, size));
    read(good.substr(0, size) + good);
  }
  for (std::size_t at = 0; at < 8 * good.size(); ++at) {
    std::string flipped = good;
    flipped[at / 8] = static_cast<char>(flipped[at / 8] ^ (1 << (at % 8)));
    read(flipped);
  }
}

constexpr double kPi = std::numbers::pi;

TEST(GsiWriter, WritesTheWordsOfBothFormats) {
  GsiRecord record;
  record.point = "P7";
  record.horizontal_rad = kPi / 2;
  record.zenith_rad = 1.5 * kPi;
  record.slope_m = 30.485;
  record.ppm = 17;
  record.prism_constant_m = -0.0344;
  EXPECT_EQ(*GsiLine(record, 12, {GsiWidth::kGsi8, GsiLengthUnit::kMm, GsiAngleUnit::kGon}),
            "110012+000000P7 21...2+10000000 22...2+30000000 31...0+00030485 51....+0017-034 "
            "58...6-00000344 \r\n");
  GsiRecord point;
  point.point = "GDEM 5415";
  point.east_m = 4'000'123.45678;
  point.north_m = -0.00001;
  point.height_m = 0.0;
  EXPECT_EQ(*GsiLine(point, 1, {}),
            "*110001+0000000GDEM 5415 81...8+0000400012345678 82...8-0000000000000001 "
            "83...8+0000000000000000 \r\n");
}

TEST(GsiWriter, EveryAngleUnitAtTheSeamsOfTheCircle) {
  const auto angle = [](double angle_rad, GsiAngleUnit unit) {
    GsiRecord record;
    record.point = "1";
    record.horizontal_rad = angle_rad;
    const std::string line = *GsiLine(record, 1, {GsiWidth::kGsi8, GsiLengthUnit::kMm, unit});
    return line.substr(16, 15);
  };
  EXPECT_EQ(angle(0.0, GsiAngleUnit::kGon), "21...2+00000000");
  EXPECT_EQ(angle(2 * kPi, GsiAngleUnit::kGon), "21...2+00000000");
  EXPECT_EQ(angle(-1e-12, GsiAngleUnit::kGon), "21...2+00000000");
  EXPECT_EQ(angle(-kPi / 200 * 1e-5, GsiAngleUnit::kGon), "21...2+39999999");
  EXPECT_EQ(angle(kPi, GsiAngleUnit::kDegree), "21...3+18000000");
  EXPECT_EQ(angle(kPi / 180 * (35 + 45.0 / 60 + 10.5 / 3600), GsiAngleUnit::kSexagesimal),
            "21...4+03545105");
  // A second short of a degree by less than the last digit: the carry goes through.
  EXPECT_EQ(angle(kPi / 180 * (36 - 0.01 / 3600), GsiAngleUnit::kSexagesimal), "21...4+03600000");
  EXPECT_EQ(angle(kPi / 2, GsiAngleUnit::kMil), "21...5+16000000");
}

TEST(GsiWriter, WhatItWritesIsReadBackToTheLastDigit) {
  test::Random random("WhatItWritesIsReadBack");
  struct Case {
    GsiFormat format;
    double length_m;
    double angle_rad;
  };
  using enum GsiLengthUnit;
  using enum GsiAngleUnit;
  for (const Case& one :
       {Case{{GsiWidth::kGsi8, kMm, kGon}, 0.5e-3, kPi / 400e5},
        Case{{GsiWidth::kGsi8, kTenthMm, kDegree}, 0.5e-4, kPi / 360e5},
        Case{{GsiWidth::kGsi16, kHundredthMm, kSexagesimal}, 0.5e-5, kPi / 1296e4},
        Case{{GsiWidth::kGsi16, kTenthMm, kMil}, 0.5e-4, kPi / 6400e4}}) {
    const double far_m = one.format.width == GsiWidth::kGsi8 ? 9000.0 : 6e6;
    for (int i = 0; i < 300; ++i) {
      GsiRecord wrote;
      wrote.point = "T" + std::to_string(i);
      wrote.horizontal_rad = random.Uniform(0.0, 2 * kPi);
      wrote.zenith_rad = random.Uniform(0.0, 2 * kPi);
      wrote.slope_m = random.Uniform(1.0, 3000.0);
      wrote.ppm = random.Index(200) - 100;
      wrote.prism_constant_m = (random.Index(800) - 400) * 1e-4;
      wrote.east_m = random.Uniform(-far_m, far_m);
      wrote.north_m = random.Uniform(-far_m, far_m);
      wrote.height_m = random.Uniform(-300.0, 3000.0);
      wrote.station_east_m = random.Uniform(-far_m, far_m);
      wrote.reflector_height_m = random.Uniform(0.0, 2.0);
      const auto line = GsiLine(wrote, i + 1, one.format);
      ASSERT_TRUE(line) << line.error();
      const auto blocks = ParseGsi(*line, "t.gsi");
      ASSERT_TRUE(blocks) << blocks.error().Text();
      const auto read = RecordOf(blocks->at(0), "t.gsi");
      ASSERT_TRUE(read && *read);
      const GsiRecord& got = **read;
      EXPECT_EQ(got.point, wrote.point);
      const auto near_angle = [&](double a, double b) {
        return std::abs(std::remainder(a - b, 2 * kPi)) <= 1.0001 * one.angle_rad;
      };
      EXPECT_TRUE(near_angle(*got.horizontal_rad, *wrote.horizontal_rad));
      EXPECT_TRUE(near_angle(*got.zenith_rad, *wrote.zenith_rad));
      EXPECT_NEAR(*got.slope_m, *wrote.slope_m, 1.0001 * one.length_m);
      EXPECT_EQ(got.ppm, wrote.ppm);
      EXPECT_NEAR(*got.prism_constant_m, *wrote.prism_constant_m, 1e-12);
      EXPECT_NEAR(*got.east_m, *wrote.east_m, 1.0001 * one.length_m);
      EXPECT_NEAR(*got.north_m, *wrote.north_m, 1.0001 * one.length_m);
      EXPECT_NEAR(*got.height_m, *wrote.height_m, 1.0001 * one.length_m);
      EXPECT_NEAR(*got.station_east_m, *wrote.station_east_m, 1.0001 * one.length_m);
      EXPECT_NEAR(*got.reflector_height_m, *wrote.reflector_height_m, 1.0001 * one.length_m);
      EXPECT_FALSE(got.station_north_m);
    }
  }
}

TEST(GsiWriter, RefusesWhatHasNoPlaceInsteadOfCuttingIt) {
  const GsiFormat narrow{GsiWidth::kGsi8, GsiLengthUnit::kMm, GsiAngleUnit::kGon};
  GsiRecord record;
  record.point = "P1";
  record.east_m = 99'999.999;
  EXPECT_TRUE(GsiLine(record, 1, narrow));
  record.east_m = 100'000.0;
  EXPECT_THAT(GsiLine(record, 1, narrow).error(), HasSubstr("east: 8 digits are not enough"));
  EXPECT_TRUE(GsiLine(record, 1, {}));
  record.east_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(GsiLine(record, 1, {}).error(), HasSubstr("east: is not a number"));
  record.east_m.reset();
  record.zenith_rad = std::numeric_limits<double>::infinity();
  EXPECT_THAT(GsiLine(record, 1, {}).error(), HasSubstr("zenith angle: is not a number"));
  record.zenith_rad.reset();
  record.prism_constant_m = 1.0;
  EXPECT_THAT(GsiLine(record, 1, {}).error(), HasSubstr("prism constant"));
  for (const char* name : {"", "NINELETTERS", "two\nlines", "blank "}) {
    GsiRecord named;
    named.point = name;
    EXPECT_FALSE(GsiLine(named, 1, narrow)) << name;
  }
}

TEST(GsiRecord, KeepsPointingsAndSaysWhatIsWrong) {
  const auto record_of = [](const std::string& text) {
    return RecordOf(ParseGsi(text, "t.gsi")->at(0), "t.gsi");
  };
  const auto sample = record_of(
      "*110002+00000000GDEM5415 21.024+0000000003545100 31...0+0000000000013825 "
      "51....+000000000017+000\n");
  ASSERT_TRUE(sample && *sample);
  EXPECT_EQ((*sample)->ppm, 17.0);
  EXPECT_EQ((*sample)->prism_constant_m, 0.0);
  EXPECT_DOUBLE_EQ(*(*sample)->slope_m, 13.825);
  EXPECT_FALSE((*sample)->zenith_rad);
  EXPECT_FALSE((*record_of("110001+00000001 31..00+00000000"))->slope_m) << "a failed sight";
  EXPECT_FALSE(*record_of("410001+00000TPS"));
  EXPECT_THAT(record_of("110001+00000001 21..00+00000100").error().Text(),
              HasSubstr("t.gsi:1: word 21 at character 17: unit '0'"));
  EXPECT_THAT(record_of("110001+00000001 51....+00000000").error().Text(), HasSubstr("word 51"));
  EXPECT_THAT(record_of("110001+00000001 51....+0+00+000").error().Text(), HasSubstr("word 51"));
}

TEST(SurveyCsv, WhatItWritesIsReadBack) {
  const SurveyRow rows[] = {{Timestamp{1'790'000'000'123'456'789}, "head", 4e9 + 0.1234, -2.5, 0.0},
                            {std::nullopt, "say \"A\", B", 1.0, 2.0, 3.0}};
  std::string text(kSurveyCsvHeader);
  for (const SurveyRow& row : rows) text += SurveyCsvLine(row);
  const auto read = ReadSurveyCsv(text, "log.csv");
  ASSERT_TRUE(read) << read.error().Text();
  ASSERT_EQ(read->size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read->at(i).at, rows[i].at);
    EXPECT_EQ(read->at(i).point, rows[i].point);
    EXPECT_NEAR(read->at(i).x_mm, rows[i].x_mm, 0.6e-4);
    EXPECT_NEAR(read->at(i).y_mm, rows[i].y_mm, 0.6e-4);
    EXPECT_NEAR(read->at(i).z_mm, rows[i].z_mm, 0.6e-4);
    EXPECT_EQ(read->at(i).line, static_cast<int>(i) + 2);
  }
  EXPECT_THAT(
      ReadSurveyCsv("stamp_ns,point,x_mm,y_mm,z_mm\n1,a,1,2,nan\n", "log.csv").error().Text(),
      HasSubstr("log.csv:2: column z_mm: 'nan' is not a finite number"));
  EXPECT_THAT(ReadSurveyCsv("stamp_ns,point,x_mm,y_mm\n", "log.csv").error().Text(),
              HasSubstr("log.csv:1: column z_mm: is missing"));
}

}  // namespace
}  // namespace tbm
