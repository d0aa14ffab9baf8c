#include "devices/inclinometer/bcd_frame_protocol.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pose/base/check.h"

namespace tbm {
namespace {

constexpr std::size_t kFrameOverhead = 4;  // LEN, address, command and sum

std::uint8_t SumOf(std::span<const std::uint8_t> bytes) {
  unsigned sum = 0;
  for (const std::uint8_t byte : bytes) sum += byte;
  return static_cast<std::uint8_t>(sum & 0xFFu);
}

// First nibble sign, then digits, the last `decimals` of them behind the point.
std::optional<double> DecodeBcd(std::span<const std::uint8_t> bytes, int decimals) {
  const unsigned sign = bytes[0] >> 4u;
  if (sign > 1) return std::nullopt;
  std::int64_t value = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const unsigned high = i == 0 ? 0u : static_cast<unsigned>(bytes[i] >> 4u);
    const unsigned low = bytes[i] & 0x0Fu;
    if (high > 9 || low > 9) return std::nullopt;
    value = value * 100 + static_cast<std::int64_t>(high * 10 + low);
  }
  const double magnitude = static_cast<double>(value) / std::pow(10.0, decimals);
  return sign == 1 ? -magnitude : magnitude;
}

void AppendBcd(double value, std::size_t size, int decimals, BcdFrame* frame) {
  const double largest = std::pow(10.0, static_cast<double>(2 * size - 1)) - 1.0;
  const double scaled = std::min(std::round(std::abs(value) * std::pow(10.0, decimals)), largest);
  auto digits = static_cast<std::int64_t>(scaled);
  std::array<std::uint8_t, 4> bytes{};
  for (std::size_t i = size; i-- > 0;) {
    bytes[i] = static_cast<std::uint8_t>(((digits / 10 % 10) << 4) | (digits % 10));
    digits /= 100;
  }
  if (value < 0.0 && scaled > 0.0) bytes[0] = static_cast<std::uint8_t>(bytes[0] | 0x10u);
  for (std::size_t i = 0; i < size; ++i) frame->data.push_back(bytes[i]);
}

}  // namespace

FrameBytes EncodeFrame(FrameFamily family, const BcdFrame& frame) {
  TBM_CHECK(frame.data.size() + kFrameOverhead <= kFrameMaxLength);
  FrameBytes bytes;
  bytes.push_back(static_cast<std::uint8_t>(family));
  bytes.push_back(static_cast<std::uint8_t>(frame.data.size() + kFrameOverhead));
  bytes.push_back(frame.address);
  bytes.push_back(frame.command);
  for (const std::uint8_t byte : frame.data) bytes.push_back(byte);
  bytes.push_back(SumOf(std::span(bytes.data() + 1, bytes.size() - 1)));
  return bytes;
}

FrameBytes AnglesRequest(FrameFamily family, std::uint8_t address) {
  return EncodeFrame(family, {address, frame_command::kReadAngles, {}});
}

FrameBytes OutputModeRequest(FrameFamily family, std::uint8_t address, std::uint8_t rate_code) {
  BcdFrame frame{address, frame_command::kSetOutput, {}};
  frame.data.push_back(rate_code);
  return EncodeFrame(family, frame);
}

void BcdFrameDecoder::DropFirst() {
  held_.erase(0);
  ++skipped_bytes_;
}

// Afterwards the first byte held is a header, and the length behind it is possible.
void BcdFrameDecoder::AlignToHeader() {
  while (!held_.empty()) {
    const bool is_header = held_[0] == static_cast<std::uint8_t>(family_);
    const bool is_length_possible =
        held_.size() < 2 || (held_[1] >= kFrameMinLength && held_[1] <= kFrameMaxLength);
    if (is_header && is_length_possible) return;
    DropFirst();
  }
}

std::optional<BcdFrame> BcdFrameDecoder::Push(std::uint8_t byte) {
  held_.push_back(byte);
  return Next();
}

std::optional<BcdFrame> BcdFrameDecoder::Next() {
  AlignToHeader();
  while (held_.size() >= 2 && held_.size() >= held_[1] + 1u) {
    const std::size_t length = held_[1];
    if (SumOf(std::span(held_.data() + 1, length - 1)) != held_[length]) {
      ++wrong_sums_;
      DropFirst();
      AlignToHeader();
      continue;
    }
    BcdFrame frame{held_[2], held_[3], {}};
    for (std::size_t i = 4; i < length; ++i) frame.data.push_back(held_[i]);
    for (std::size_t i = 0; i < length + 1; ++i) held_.erase(0);
    return frame;
  }
  return std::nullopt;
}

Result<FrameAngles, AngleFailure> DecodeAngles(FrameFamily family, const BcdFrame& frame) {
  if (frame.command != (frame_command::kReadAngles | frame_command::kReply)) {
    return Failure{AngleFailure::kNotAngles};
  }
  const std::size_t size = frame.data.size();
  if (size != 9 && size != 11 && size != 12) return Failure{AngleFailure::kUnknownLength};

  const std::size_t angle_size = size == 9 ? 3 : 4;
  const int angle_decimals = size == 9 ? 2 : 4;
  const std::size_t third_size = size - 2 * angle_size;
  const std::span<const std::uint8_t> data(frame.data.data(), size);
  const auto x = DecodeBcd(data.subspan(0, angle_size), angle_decimals);
  const auto y = DecodeBcd(data.subspan(angle_size, angle_size), angle_decimals);
  const auto third = DecodeBcd(data.subspan(2 * angle_size, third_size), third_size == 3 ? 2 : 4);
  if (!x || !y || !third) return Failure{AngleFailure::kBadDigit};
  return FrameAngles{*x, *y, *third, family == FrameFamily::kRion68 && size != 9};
}

BcdFrame EncodeAngles(std::uint8_t address, FrameLayout layout, const FrameAngles& angles) {
  BcdFrame frame{address, frame_command::kReadAngles | frame_command::kReply, {}};
  const bool is_three = layout == FrameLayout::kThreeByte;
  const bool is_third_three = layout != FrameLayout::kFourByte;
  AppendBcd(angles.x_deg, is_three ? 3 : 4, is_three ? 2 : 4, &frame);
  AppendBcd(angles.y_deg, is_three ? 3 : 4, is_three ? 2 : 4, &frame);
  AppendBcd(angles.third, is_third_three ? 3 : 4, is_third_three ? 2 : 4, &frame);
  return frame;
}

}  // namespace tbm
