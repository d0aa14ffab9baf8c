#include "devices/total_station/geocom_protocol.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/total_station/geocom_codes.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using testing::ElementsAre;

// The line that an encoded message holds.
std::string LineOf(std::string message) {
  while (message.starts_with('\n')) message.erase(0, 1);
  while (message.ends_with('\n') || message.ends_with('\r')) message.pop_back();
  return message;
}

std::vector<std::string> Cut(GeocomLineCutter& cutter, std::string_view bytes) {
  std::vector<std::string> lines;
  for (const char byte : bytes) {
    if (const auto line = cutter.Push(byte)) lines.emplace_back(*line);
  }
  return lines;
}

const std::string kValues =
    "0,4.71238898038469,1.57079632679,0.0000024,0.0001,-0.0002,0.0001,48.2511,9";

TEST(Geocom, ChecksumIsCrc16Arc) {
  EXPECT_EQ(Crc16Arc("123456789"), 0xBB3D);
  EXPECT_EQ(Crc16Arc(""), 0);
}

TEST(Geocom, WritesRequestsAsTheManualsDo) {
  EXPECT_EQ(EncodeGeocomRequest(2108, 7, "3000,1", false), "\n%R1Q,2108,7:3000,1\r\n");
  EXPECT_EQ(EncodeGeocomRequest(0, 32767, "", false), "\n%R1Q,0,32767:\r\n");
  // The checksum is over the line as it would be without it.
  const std::string crc = std::to_string(Crc16Arc("%R1Q,2108,7:3000,1"));
  EXPECT_EQ(EncodeGeocomRequest(2108, 7, "3000,1", true), "\n%R1Q,2108,7," + crc + ":3000,1\r\n");
}

TEST(Geocom, ReadsRepliesWithAndWithoutChecksum) {
  const auto reply = ParseGeocomReply("%R1P,0,12:0,1.5,-2e-3,\"TS16, A\",'1F'", false);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->com_code, 0);
  EXPECT_EQ(reply->transaction, 12);
  EXPECT_EQ(reply->return_code, 0);
  EXPECT_FALSE(reply->has_checksum);
  EXPECT_THAT(reply->parameters, ElementsAre("1.5", "-2e-3", "\"TS16, A\"", "'1F'"));
  EXPECT_EQ(GeocomReal(reply->parameters[1]), -2e-3);
  EXPECT_EQ(GeocomText(reply->parameters[2]), "TS16, A");
  EXPECT_EQ(GeocomByte(reply->parameters[3]), 0x1F);

  const std::string line = LineOf(EncodeGeocomReply(0, 12, kValues, true));
  const auto checked = ParseGeocomReply(line, true);
  ASSERT_TRUE(checked);
  EXPECT_TRUE(checked->has_checksum);
  EXPECT_EQ(checked->parameters.size(), 8u);
}

// 2108 was seen to answer so: the return code says that all is well, and nothing follows.
TEST(Geocom, AReplyWithoutValuesHasNone) {
  const auto reply = ParseGeocomReply("%R1P,0,0:0", false);
  ASSERT_TRUE(reply);
  EXPECT_TRUE(reply->parameters.empty());
}

TEST(Geocom, AReplyNeedNotBeginTheLine) {
  const auto noisy = ParseGeocomReply("?~%R1Q%R1P,0,9:0,1.25", false);
  ASSERT_TRUE(noisy);
  EXPECT_EQ(noisy->transaction, 9);
  // A late reply that has lost its end, and the one that is waited for.
  const auto glued = ParseGeocomReply("%R1P,0,8:0,7.5%R1P,0,9:0,1.25", false);
  ASSERT_TRUE(glued);
  EXPECT_EQ(glued->transaction, 9);
  EXPECT_THAT(glued->parameters, ElementsAre("1.25"));
}

TEST(Geocom, RefusesWhatIsNoReply) {
  for (const char* line : {"", "R1P,0,9:0,1.25", "%R1Q,0,9:0", "%N1,0,255,,0%T0,0,0,:", "%R1P"}) {
    const auto reply = ParseGeocomReply(line, false);
    ASSERT_FALSE(reply) << line;
    EXPECT_EQ(reply.error(), GeocomLineFault::kNotForUs) << line;
  }
  for (const char* line : {"%R1P,0,9",
                           "%R1P,0:0",
                           "%R1P,,9:0",
                           "%R1P,0,:0",
                           "%R1P,0,9:",
                           "%R1P,0,9:x",
                           "%R1P,0,-9:0",
                           "%R1P,0,32768:0",
                           "%R1P,0,9,1,2:0",
                           "%R1P,0,9,70000:0",
                           "%R1P,0 ,9:0",
                           "%R1P,0,9:0,\"open",
                           "%R1P,0,9999999999:0"}) {
    const auto reply = ParseGeocomReply(line, false);
    ASSERT_FALSE(reply) << line;
    EXPECT_EQ(reply.error(), GeocomLineFault::kBadForm) << line;
  }
  const auto bare = ParseGeocomReply("%R1P,0,9:0,1.25", true);
  ASSERT_FALSE(bare);
  EXPECT_EQ(bare.error(), GeocomLineFault::kNoChecksum);
}

TEST(Geocom, RefusesMoreFieldsThanAnyCallHas) {
  std::string line = "%R1P,0,9:0";
  for (std::size_t i = 1; i < kGeocomMostParameters; ++i) line += ",1";
  EXPECT_TRUE(ParseGeocomReply(line, false));
  EXPECT_FALSE(ParseGeocomReply(line + ",1", false));
}

TEST(Geocom, FieldsAreTakenOnlyWhole) {
  for (const char* field : {"", "1.5x", " 1.5", "nan", "inf", "1e999", "0x10", "1,5"}) {
    EXPECT_FALSE(GeocomReal(field)) << field;
  }
  for (const char* field : {"", "1.5", "12a"}) EXPECT_FALSE(GeocomInteger(field)) << field;
  for (const char* field : {"", "1F", "'1G'", "'1F", "'123'"}) EXPECT_FALSE(GeocomByte(field));
  for (const char* field : {"", "\"", "TS16", "\"a\"b\"", "\"\x01\""}) {
    EXPECT_FALSE(GeocomText(field)) << field;
  }
  EXPECT_EQ(GeocomText("\"\""), "");
  test::Random random("FieldsAreTakenOnlyWhole");
  for (int i = 0; i < 1000; ++i) {
    const double value = random.Uniform(-7.0, 7.0);
    EXPECT_EQ(GeocomReal(GeocomNumber(value)), value);
  }
}

TEST(Geocom, CutAnywhereWithAChecksumGivesNothing) {
  const std::string line = LineOf(EncodeGeocomReply(0, 12, kValues, true));
  for (std::size_t size = 0; size < line.size(); ++size) {
    EXPECT_FALSE(ParseGeocomReply(line.substr(0, size), true)) << size;
    EXPECT_FALSE(ParseGeocomReply(line.substr(line.size() - size), true)) << size;
  }
}

TEST(Geocom, OneFlippedBitNeverPassesTheChecksum) {
  const std::string line = LineOf(EncodeGeocomReply(0, 12, kValues, true));
  const std::string request = LineOf(EncodeGeocomRequest(9027, 12, "1.5,1.6,0,1,0", true));
  for (std::size_t bit = 0; bit < 8 * line.size(); ++bit) {
    std::string flipped = line;
    flipped[bit / 8] = static_cast<char>(flipped[bit / 8] ^ (1 << (bit % 8)));
    EXPECT_FALSE(ParseGeocomReply(flipped, true)) << flipped;
  }
  int taken = 0;
  for (std::size_t bit = 0; bit < 8 * request.size(); ++bit) {
    std::string flipped = request;
    flipped[bit / 8] = static_cast<char>(flipped[bit / 8] ^ (1 << (bit % 8)));
    const auto parsed = ParseGeocomRequest(flipped);
    if (parsed && parsed->has_checksum) ++taken;
  }
  EXPECT_EQ(taken, 0);
}

TEST(Geocom, EncodedRequestsAreReadBack) {
  for (const bool with_checksum : {false, true}) {
    const std::string line = LineOf(EncodeGeocomRequest(9027, 40, "1.5,1.6,0,1,0", with_checksum));
    const auto request = ParseGeocomRequest(line);
    ASSERT_TRUE(request);
    EXPECT_EQ(request->rpc, 9027);
    EXPECT_EQ(request->transaction, 40);
    EXPECT_EQ(request->has_checksum, with_checksum);
    EXPECT_THAT(request->parameters, ElementsAre("1.5", "1.6", "0", "1", "0"));
  }
  const auto shortest = ParseGeocomRequest("%R1Q,5003:");
  ASSERT_TRUE(shortest);
  EXPECT_EQ(shortest->transaction, 0);
  EXPECT_TRUE(shortest->parameters.empty());
}

TEST(Geocom, TransactionNumbersStayInTheInstrumentsRange) {
  EXPECT_EQ(NextTransaction(1), 2);
  EXPECT_EQ(NextTransaction(32766), 32767);
  EXPECT_EQ(NextTransaction(32767), 1);
  EXPECT_EQ(NextTransaction(0), 1);
  EXPECT_EQ(NextTransaction(-5), 1);
}

TEST(GeocomLines, CutsAtEitherEndAndGluesPieces) {
  GeocomLineCutter cutter;
  EXPECT_TRUE(Cut(cutter, "%R1P,0,").empty());
  EXPECT_THAT(Cut(cutter, "1:0\r\n\n\r\n%R1P,0,2:0\n%R1"), ElementsAre("%R1P,0,1:0", "%R1P,0,2:0"));
  EXPECT_THAT(Cut(cutter, "P,0,3:0\r"), ElementsAre("%R1P,0,3:0"));
  EXPECT_EQ(cutter.bytes_held(), 0u);
  Cut(cutter, "half");
  cutter.Reset();
  EXPECT_THAT(Cut(cutter, "whole\n"), ElementsAre("whole"));
}

TEST(GeocomLines, ThrowsAwayALineThatNeverEnds) {
  GeocomLineCutter cutter;
  EXPECT_TRUE(Cut(cutter, std::string(10 * kGeocomLineLimit, 'x')).empty());
  EXPECT_LE(cutter.bytes_held(), kGeocomLineLimit);
  EXPECT_THAT(Cut(cutter, "tail\n%R1P,0,1:0\n"), ElementsAre("%R1P,0,1:0"));
  EXPECT_EQ(cutter.lines_too_long(), 1u);
  const std::string longest(kGeocomLineLimit, 'y');
  EXPECT_THAT(Cut(cutter, longest + "\n"), ElementsAre(longest));
}

TEST(GeocomLines, FindsEveryReplyBehindGarbage) {
  test::Random random("FindsEveryReplyBehindGarbage");
  for (int round = 0; round < 500; ++round) {
    GeocomLineCutter cutter;
    std::string stream;
    for (int i = random.Index(60); i > 0; --i) stream += static_cast<char>(random.Index(256));
    stream += "\n";
    const int count = 1 + random.Index(3);
    for (int i = 0; i < count; ++i) stream += EncodeGeocomReply(0, 100 + i, kValues, true);
    int found = 0;
    for (const std::string& line : Cut(cutter, stream)) {
      found += ParseGeocomReply(line, true).has_value() ? 1 : 0;
    }
    ASSERT_EQ(found, count) << round;
  }
}

TEST(GeocomCodes, WarningsAreNoFailuresAndSayWhatTheyGive) {
  for (const int code : {0, 1283, 1284, 1285, 1288, 1289}) EXPECT_FALSE(FailureOfGeocomCode(code));
  for (const int code : {0, 1283, 1284}) EXPECT_TRUE(PartsOfGeocomCode(code)->has_distance);
  for (const int code : {1285, 1288, 1289}) EXPECT_FALSE(PartsOfGeocomCode(code)->has_distance);
  EXPECT_EQ(PartsOfGeocomCode(1288)->quality, ObservationQuality::kNotFullyCorrected);
  EXPECT_EQ(PartsOfGeocomCode(1284)->quality, ObservationQuality::kNoAccuracy);
  EXPECT_EQ(PartsOfGeocomCode(0)->quality, ObservationQuality::kFull);
  for (const int code : {1, 1290, 1293, 8710, 3107}) EXPECT_FALSE(PartsOfGeocomCode(code));
}

TEST(GeocomCodes, MeanWhatTheManualsSay) {
  using enum StationFailure;
  const std::pair<int, StationFailure> wanted[] = {
      {2, kBadParameter},  {5, kNotSupported},      {8, kAborted},           {13, kBusy},
      {16, kLowPower},     {22, kTilted},           {27, kNoLicence},        {259, kAngleSensor},
      {300, kAngleSensor}, {514, kSeveralTargets},  {517, kNoTarget},        {1292, kDistance},
      {1293, kBusy},       {1800, kMotor},          {3077, kTimeout},        {3081, kNotSupported},
      {3090, kGarbled},    {3107, kBusy},           {3108, kAsleep},         {8710, kNoTarget},
      {8705, kInaccurate}, {8711, kSeveralTargets}, {8712, kBadEnvironment}, {8725, kNoLock},
      {65000, kInstrument}};
  for (const auto& [code, failure] : wanted) EXPECT_EQ(FailureOfGeocomCode(code), failure) << code;
  EXPECT_EQ(GeocomCodeName(8710), "AUT_NO_TARGET");
  EXPECT_EQ(GeocomCodeName(0), "OK");
  EXPECT_EQ(GeocomCodeName(4711), "");
}

TEST(StationFailures, EachHasAWordOfItsOwnAndASentence) {
  std::set<std::string_view> words;
  for (int value = 1; value <= static_cast<int>(StationFailure::kSettingNotTaken); ++value) {
    const auto failure = static_cast<StationFailure>(value);
    EXPECT_TRUE(words.insert(FailureCode(failure)).second) << value;
    EXPECT_GT(FailureSentence(failure).size(), 20u) << value;
    EXPECT_EQ(FailureSentence(failure).back(), '.') << value;
  }
  EXPECT_EQ(FailureCode(StationFailure::kNotConnected), "not_connected");
  EXPECT_EQ(FailureCode(StationFailure::kSettingNotTaken), "setting_not_taken");
  EXPECT_EQ(FailureCode(static_cast<StationFailure>(28)), "unknown");
}

}  // namespace
}  // namespace tbm
