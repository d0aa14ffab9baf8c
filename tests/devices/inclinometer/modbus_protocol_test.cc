#include "devices/inclinometer/modbus_protocol.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/devices/inclinometer/recordings.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using test::Bytes;
using testing::ElementsAre;

// Frames of the Modbus over Serial Line specification and of every vendor's manual.
TEST(Modbus, CrcIsTheStandardOne) {
  const std::string check = "123456789";
  EXPECT_EQ(ModbusCrc(Bytes(check.begin(), check.end())), 0x4B37);
  EXPECT_EQ(ModbusCrc(Bytes{0x01, 0x03, 0x00, 0x00, 0x00, 0x0A}), 0xCDC5);
}

TEST(Modbus, ParsesARequest) {
  const auto request = ParseModbusRequest(Bytes{0x01, 0x03, 0x00, 0x00, 0x00, 0x0A, 0xC5, 0xCD});
  ASSERT_TRUE(request);
  EXPECT_EQ(request->slave_id, 1);
  EXPECT_EQ(request->function, 3);
  EXPECT_EQ(request->first_register, 0);
  EXPECT_EQ(request->count, 10);
}

TEST(Modbus, RefusesARequestCutOrWithOneBitFlipped) {
  const Bytes good = {0x01, 0x03, 0x00, 0x00, 0x00, 0x0A, 0xC5, 0xCD};
  for (std::size_t size = 0; size < good.size(); ++size) {
    EXPECT_FALSE(ParseModbusRequest(std::span(good).first(size)));
  }
  for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
    Bytes flipped = good;
    flipped[bit / 8] = static_cast<std::uint8_t>(flipped[bit / 8] ^ (1u << (bit % 8)));
    EXPECT_FALSE(ParseModbusRequest(flipped)) << "bit " << bit;
  }
}

TEST(Modbus, EncodesAReplyAndAnException) {
  const ModbusReadRequest request{0x11, 3, 0x6B, 3};
  // The worked example of the Modbus specification for function 3.
  EXPECT_THAT(EncodeModbusReply(request, std::vector<std::uint16_t>{0xAE41, 0x5652, 0x4340}),
              ElementsAre(0x11, 0x03, 0x06, 0xAE, 0x41, 0x56, 0x52, 0x43, 0x40, 0x49, 0xAD));
  EXPECT_EQ(EncodeModbusReply(request, std::vector<std::uint16_t>(3)).size(),
            ModbusReadReplySize(3));
  const auto exception = EncodeModbusException(request, 2);
  EXPECT_EQ(exception.size(), 5u);
  EXPECT_EQ(exception[1], 0x83);
  EXPECT_EQ(exception[2], 2);
}

ModbusRegisterMap Map(RegisterFormat format, WordOrder order, double deg_per_lsb) {
  ModbusRegisterMap map;
  map.format = format;
  map.word_order = order;
  map.rad_per_lsb = DegToRad(deg_per_lsb);
  map.beta_register = 100;
  map.gamma_register = 100 + map.WordsPerAngle();
  return map;
}

double BetaDeg(const ModbusRegisterMap& map, std::vector<std::uint16_t> registers) {
  return RadToDeg(DecodeRegisters(map, registers).angles.beta_rad);
}

TEST(Modbus, DecodesEveryFormatFromKnownBits) {
  const auto high = WordOrder::kHighFirst;
  const auto low = WordOrder::kLowFirst;
  EXPECT_NEAR(BetaDeg(Map(RegisterFormat::kInt16, high, 0.01), {0xFFFF, 0}), -0.01, 1e-12);
  EXPECT_NEAR(BetaDeg(Map(RegisterFormat::kInt16, high, 0.01), {0x8000, 0}), -327.68, 1e-9);
  EXPECT_NEAR(BetaDeg(Map(RegisterFormat::kUint16, high, 0.001), {0xFFFF, 0}), 65.535, 1e-9);
  EXPECT_NEAR(
      BetaDeg(Map(RegisterFormat::kInt32, high, 0.0001), {0xFFFF, 0xFFFE, 0, 0}), -0.0002, 1e-12);
  EXPECT_NEAR(
      BetaDeg(Map(RegisterFormat::kInt32, low, 0.0001), {0xFFFE, 0xFFFF, 0, 0}), -0.0002, 1e-12);
  // -12.5 is C1480000.
  EXPECT_NEAR(BetaDeg(Map(RegisterFormat::kFloat32, high, 1.0), {0xC148, 0, 0, 0}), -12.5, 1e-9);
  EXPECT_NEAR(BetaDeg(Map(RegisterFormat::kFloat32, low, 1.0), {0, 0xC148, 0, 0}), -12.5, 1e-9);
}

TEST(Modbus, TakesTheOffsetAway) {
  ModbusRegisterMap map = Map(RegisterFormat::kUint16, WordOrder::kHighFirst, 0.01);
  map.offset_lsb = 20000;
  EXPECT_NEAR(BetaDeg(map, {20150, 20000}), 1.5, 1e-12);
  EXPECT_NEAR(BetaDeg(map, {19850, 20000}), -1.5, 1e-12);
}

TEST(Modbus, ANanStaysANan) {
  const ModbusRegisterMap map = Map(RegisterFormat::kFloat32, WordOrder::kHighFirst, 1.0);
  EXPECT_TRUE(std::isnan(BetaDeg(map, {0x7FC0, 0, 0, 0})));
}

TEST(Modbus, ReadsAllRegistersInOneSpan) {
  ModbusRegisterMap map = Map(RegisterFormat::kInt32, WordOrder::kHighFirst, 0.0001);
  map.beta_register = 12;
  map.gamma_register = 10;
  map.temperature_register = 16;
  EXPECT_EQ(map.First(), 10);
  EXPECT_EQ(map.Count(), 7);
  const RegisterReading reading =
      DecodeRegisters(map, std::vector<std::uint16_t>{0, 20000, 0, 30000, 9, 9, 0xFF38});
  EXPECT_NEAR(RadToDeg(reading.angles.gamma_rad), 2.0, 1e-12);
  EXPECT_NEAR(RadToDeg(reading.angles.beta_rad), 3.0, 1e-12);
  EXPECT_NEAR(reading.temperature_celsius.value_or(0), -20.0, 1e-12);
}

TEST(Modbus, EncodingAndDecodingAgree) {
  test::Random random("ModbusEncodingAndDecodingAgree");
  for (const RegisterFormat format :
       {RegisterFormat::kInt16, RegisterFormat::kInt32, RegisterFormat::kFloat32}) {
    for (const WordOrder order : {WordOrder::kHighFirst, WordOrder::kLowFirst}) {
      const bool is_float = format == RegisterFormat::kFloat32;
      const ModbusRegisterMap map = Map(format, order, is_float ? 1.0 : 0.001);
      for (int round = 0; round < 500; ++round) {
        const Inclination sent{DegToRad(random.Uniform(-30, 30)),
                               DegToRad(random.Uniform(-30, 30))};
        const auto got = DecodeRegisters(map, EncodeRegisters(map, {sent, std::nullopt})).angles;
        EXPECT_NEAR(RadToDeg(got.beta_rad), RadToDeg(sent.beta_rad), is_float ? 1e-5 : 0.000501);
        EXPECT_NEAR(RadToDeg(got.gamma_rad), RadToDeg(sent.gamma_rad), is_float ? 1e-5 : 0.000501);
      }
    }
  }
}

TEST(Modbus, AnAngleBeyondTheFormatIsClampedNotWrapped) {
  const ModbusRegisterMap map = Map(RegisterFormat::kInt16, WordOrder::kHighFirst, 0.001);
  const auto registers = EncodeRegisters(map, {{DegToRad(180.0), DegToRad(-180.0)}, std::nullopt});
  EXPECT_THAT(registers, ElementsAre(0x7FFF, 0x8000));
}

}  // namespace
}  // namespace tbm
