#include "devices/gsi/gsi.h"

#include <numbers>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace tbm
