#include "devices/inclinometer/bcd_frame_protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/devices/inclinometer/recordings.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using test::Bytes;
using test::ReadHexFile;
using testing::ElementsAre;
using testing::ElementsAreArray;

Bytes ToBytes(const FrameBytes& bytes) { return {bytes.begin(), bytes.end()}; }

std::vector<BcdFrame> DecodeAll(BcdFrameDecoder& decoder, const Bytes& bytes) {
  std::vector<BcdFrame> frames;
  for (const std::uint8_t byte : bytes) {
    for (auto frame = decoder.Push(byte); frame; frame = decoder.Next()) frames.push_back(*frame);
  }
  return frames;
}
std::vector<BcdFrame> DecodeAll(FrameFamily family, const Bytes& bytes) {
  BcdFrameDecoder decoder(family);
  return DecodeAll(decoder, bytes);
}

// -2.87 and -0.85 degrees, heading 159.22: the first reply captured from a HCM508B.
const Bytes kThreeByteReply = {
    0x68, 0x0D, 0x00, 0x84, 0x10, 0x02, 0x87, 0x10, 0x00, 0x85, 0x01, 0x59, 0x22, 0x3B};

TEST(BcdFrames, DecodesWhatAHcm508bSent) {
  std::vector<FrameAngles> angles;
  for (const Bytes& message : ReadHexFile("rion_hcm508b.hex")) {
    for (const BcdFrame& frame : DecodeAll(FrameFamily::kRion68, message)) {
      if (const auto decoded = DecodeAngles(FrameFamily::kRion68, frame)) {
        angles.push_back(*decoded);
      }
    }
  }
  ASSERT_EQ(angles.size(), 4u);  // the fifth reply was cut
  EXPECT_DOUBLE_EQ(angles[0].x_deg, -2.87);
  EXPECT_DOUBLE_EQ(angles[0].y_deg, -0.85);
  EXPECT_DOUBLE_EQ(angles[0].third, 159.22);
  EXPECT_FALSE(angles[0].third_is_temperature);
  EXPECT_DOUBLE_EQ(angles[1].third, 159.13);
  EXPECT_DOUBLE_EQ(angles[3].y_deg, -0.86);
}

TEST(BcdFrames, DecodesFourByteFieldsAsTheManualsDo) {
  struct Field {
    Bytes bytes;
    double deg;
  };
  for (const Field& field : {Field{{0x00, 0x02, 0x01, 0x30}, 2.0130},
                             Field{{0x10, 0x00, 0x51, 0x20}, -0.5120},
                             Field{{0x10, 0x26, 0x87, 0x60}, -26.8760},
                             Field{{0x00, 0x03, 0x99, 0x67}, 3.9967}}) {
    BcdFrame frame{0, 0x84, {}};
    for (int i = 0; i < 3; ++i) {
      for (const std::uint8_t byte : field.bytes) frame.data.push_back(byte);
    }
    const auto angles = DecodeAngles(FrameFamily::kBewis77, frame);
    ASSERT_TRUE(angles);
    EXPECT_DOUBLE_EQ(angles->x_deg, field.deg);
    EXPECT_DOUBLE_EQ(angles->y_deg, field.deg);
  }
}

TEST(BcdFrames, ReadsTheTemperatureOfAHca726) {
  // 68 0F a 84 X4 Y4 T3 SUM
  BcdFrame frame{0, 0x84, {}};
  for (const int byte : {0x00, 0x01, 0x23, 0x45, 0x10, 0x12, 0x34, 0x56, 0x10, 0x07, 0x25}) {
    frame.data.push_back(static_cast<std::uint8_t>(byte));
  }
  const Bytes sent = ToBytes(EncodeFrame(FrameFamily::kRion68, frame));
  EXPECT_EQ(sent.size(), 16u);
  EXPECT_EQ(sent[1], 0x0F);
  const auto frames = DecodeAll(FrameFamily::kRion68, sent);
  ASSERT_EQ(frames.size(), 1u);
  const auto angles = DecodeAngles(FrameFamily::kRion68, frames[0]);
  ASSERT_TRUE(angles);
  EXPECT_DOUBLE_EQ(angles->x_deg, 1.2345);
  EXPECT_DOUBLE_EQ(angles->y_deg, -12.3456);
  EXPECT_TRUE(angles->third_is_temperature);
  EXPECT_DOUBLE_EQ(angles->third, -7.25);
}

TEST(BcdFrames, SpeaksTheRequestsOfBothVendors) {
  EXPECT_THAT(ToBytes(AnglesRequest(FrameFamily::kRion68, 0)),
              ElementsAre(0x68, 0x04, 0x00, 0x04, 0x08));
  EXPECT_THAT(ToBytes(AnglesRequest(FrameFamily::kBewis77, 0)),
              ElementsAre(0x77, 0x04, 0x00, 0x04, 0x08));
  const auto settings = ReadHexFile("rion_settings.hex");
  EXPECT_THAT(ToBytes(OutputModeRequest(FrameFamily::kRion68, 0, 1)),
              ElementsAreArray(settings[0]));
  EXPECT_THAT(ToBytes(OutputModeRequest(FrameFamily::kRion68, 0, 0)),
              ElementsAreArray(settings[1]));
  EXPECT_THAT(ToBytes(OutputModeRequest(FrameFamily::kBewis77, 0, 1)),
              ElementsAreArray(ReadHexFile("bewis_as400.hex")[3]));
}

TEST(BcdFrames, EveryRecordedWholeMessageHasARightSum) {
  for (const auto& [name, family] : {std::pair{"rion_settings.hex", FrameFamily::kRion68},
                                     std::pair{"bewis_as400.hex", FrameFamily::kBewis77}}) {
    const auto messages = ReadHexFile(name);
    ASSERT_FALSE(messages.empty()) << name;
    for (const Bytes& message : messages) EXPECT_EQ(DecodeAll(family, message).size(), 1u) << name;
  }
}

TEST(BcdFrames, TakesNoOtherReplyForAngles) {
  const auto frames = DecodeAll(FrameFamily::kBewis77, ReadHexFile("bewis_as400.hex")[1]);
  ASSERT_EQ(frames.size(), 1u);
  const auto angles = DecodeAngles(FrameFamily::kBewis77, frames[0]);
  ASSERT_FALSE(angles);
  EXPECT_EQ(angles.error(), AngleFailure::kNotAngles);
}

TEST(BcdFrames, RefusesWhatIsNoDecimalDigit) {
  for (std::size_t nibble = 0; nibble < 18; ++nibble) {
    BcdFrame frame{0, 0x84, {}};
    for (std::size_t i = 4; i < 13; ++i) frame.data.push_back(kThreeByteReply[i]);
    std::uint8_t& byte = frame.data[nibble / 2];
    byte = static_cast<std::uint8_t>(nibble % 2 == 0 ? (byte & 0x0Fu) | 0xA0u
                                                     : (byte & 0xF0u) | 0x0Au);
    const auto angles = DecodeAngles(FrameFamily::kRion68, frame);
    ASSERT_FALSE(angles) << "nibble " << nibble;
    EXPECT_EQ(angles.error(), AngleFailure::kBadDigit);
  }
}

TEST(BcdFrames, RefusesAnUnknownLayout) {
  for (std::size_t size = 0; size <= 20; ++size) {
    BcdFrame frame{0, 0x84, {}};
    for (std::size_t i = 0; i < size; ++i) frame.data.push_back(0);
    const bool is_known = size == 9 || size == 11 || size == 12;
    EXPECT_EQ(DecodeAngles(FrameFamily::kRion68, frame).has_value(), is_known) << size;
  }
}

TEST(BcdFrames, CutAnywhereGivesNothingAndTheNextFrameIsFound) {
  for (std::size_t size = 0; size < kThreeByteReply.size(); ++size) {
    const Bytes cut(kThreeByteReply.begin(), kThreeByteReply.begin() + static_cast<long>(size));
    BcdFrameDecoder decoder(FrameFamily::kRion68);
    EXPECT_TRUE(DecodeAll(decoder, cut).empty()) << size;
    // Two more replies at once: the half one may swallow the beginning of the first, no more.
    DecodeAll(decoder, kThreeByteReply);
    EXPECT_FALSE(DecodeAll(decoder, kThreeByteReply).empty()) << size;
  }
}

TEST(BcdFrames, OneFlippedBitNeverChangesAnAngle) {
  for (std::size_t bit = 0; bit < kThreeByteReply.size() * 8; ++bit) {
    Bytes flipped = kThreeByteReply;
    flipped[bit / 8] = static_cast<std::uint8_t>(flipped[bit / 8] ^ (1u << (bit % 8)));
    for (const BcdFrame& frame : DecodeAll(FrameFamily::kRion68, flipped)) {
      ADD_FAILURE() << "accepted with bit " << bit << " flipped, command " << int{frame.command};
    }
  }
}

TEST(BcdFrames, FindsGluedFramesAndFramesBehindGarbage) {
  Bytes glued = kThreeByteReply;
  glued.insert(glued.end(), kThreeByteReply.begin(), kThreeByteReply.end());
  EXPECT_EQ(DecodeAll(FrameFamily::kRion68, glued).size(), 2u);

  // A false header with the length of a long frame hides a short and a whole frame at first.
  Bytes hidden = {0x68, 0x18, 0x68, 0x06, 0x00, 0x87, 0x00, 0x00, 0x8D};
  hidden.insert(hidden.end(), kThreeByteReply.begin(), kThreeByteReply.end());
  hidden.push_back(0xFF);
  hidden.push_back(0xFF);
  EXPECT_EQ(DecodeAll(FrameFamily::kRion68, hidden).size(), 2u);

  test::Random random("FindsFramesBehindGarbage");
  for (int round = 0; round < 2000; ++round) {
    Bytes stream;
    for (int i = random.Index(40); i > 0; --i) {
      stream.push_back(static_cast<std::uint8_t>(random.Index(256)));
    }
    for (int i = 0; i < 4; ++i) {
      stream.insert(stream.end(), kThreeByteReply.begin(), kThreeByteReply.end());
    }
    const auto frames = DecodeAll(FrameFamily::kRion68, stream);
    ASSERT_GE(frames.size(), 3u) << "round " << round;
  }
}

TEST(BcdFrames, TheLongestFrameFitsAndALongerLengthIsNoFrame) {
  BcdFrame longest{1, 2, {}};
  for (std::size_t i = 0; i + 4 < kFrameMaxLength; ++i) longest.data.push_back(0x68);
  const auto frames =
      DecodeAll(FrameFamily::kRion68, ToBytes(EncodeFrame(FrameFamily::kRion68, longest)));
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].data.size(), longest.data.size());
  BcdFrameDecoder decoder(FrameFamily::kRion68);
  EXPECT_TRUE(DecodeAll(decoder, {0x68, kFrameMaxLength + 1}).empty());
  EXPECT_EQ(decoder.bytes_held(), 0u);
}

TEST(BcdFrames, EncodingAndDecodingAgreeToTheLastDigit) {
  test::Random random("EncodingAndDecodingAgree");
  for (int round = 0; round < 2000; ++round) {
    for (const FrameLayout layout :
         {FrameLayout::kThreeByte, FrameLayout::kFourByteTemperature, FrameLayout::kFourByte}) {
      const FrameAngles sent{
          random.Uniform(-90, 90), random.Uniform(-90, 90), random.Uniform(-40, 85)};
      const Bytes bytes = ToBytes(EncodeFrame(FrameFamily::kRion68, EncodeAngles(7, layout, sent)));
      const auto frames = DecodeAll(FrameFamily::kRion68, bytes);
      ASSERT_EQ(frames.size(), 1u);
      EXPECT_EQ(frames[0].address, 7);
      const auto got = DecodeAngles(FrameFamily::kRion68, frames[0]);
      ASSERT_TRUE(got);
      const double half_digit = layout == FrameLayout::kThreeByte ? 0.00501 : 0.0000501;
      EXPECT_NEAR(got->x_deg, sent.x_deg, half_digit);
      EXPECT_NEAR(got->y_deg, sent.y_deg, half_digit);
      EXPECT_NEAR(got->third, sent.third, 0.00501);
    }
  }
}

}  // namespace
}  // namespace tbm
