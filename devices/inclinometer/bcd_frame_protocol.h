#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "pose/base/fixed_vector.h"
#include "pose/base/result.h"

namespace tbm {

// The serial frames of RION (header 0x68) and BEWIS (header 0x77) inclinometers:
//
//   header LEN ADDRESS COMMAND data.. SUM
//
// LEN counts the bytes from LEN to SUM, so a frame has LEN + 1 bytes; SUM is the low byte of the
// sum from LEN to the last data byte. The reply's command is the request's with the top bit set.
// Origin of every fact and the captured bytes: tests/data/recordings/inclinometer/README.md.
enum class FrameFamily : std::uint8_t { kRion68 = 0x68, kBewis77 = 0x77 };

inline constexpr std::size_t kFrameMinLength = 4;   // LEN of a frame without data
inline constexpr std::size_t kFrameMaxLength = 24;  // longer than any frame known of both families

struct BcdFrame {
  std::uint8_t address = 0;
  std::uint8_t command = 0;
  FixedVector<std::uint8_t, kFrameMaxLength> data;
};

using FrameBytes = FixedVector<std::uint8_t, kFrameMaxLength + 1>;

namespace frame_command {
inline constexpr std::uint8_t kReadAngles = 0x04;
inline constexpr std::uint8_t kSetOutput = 0x0C;  // one data byte: 0 answers requests, else a rate
inline constexpr std::uint8_t kReply = 0x80;
}  // namespace frame_command

FrameBytes EncodeFrame(FrameFamily family, const BcdFrame& frame);
FrameBytes AnglesRequest(FrameFamily family, std::uint8_t address);
FrameBytes OutputModeRequest(FrameFamily family, std::uint8_t address, std::uint8_t rate_code);

// Finds frames in a stream that may start in the middle of one, lose bytes and contain noise. After
// a wrong sum the search goes on at the byte after the false header, so a frame that began inside
// the noise is still found.
class BcdFrameDecoder {
 public:
  explicit BcdFrameDecoder(FrameFamily family) : family_(family) {}

  // The first whole frame with a right sum, if this byte completes one. Noise that looked like a
  // long frame can have hidden several: `for (auto f = d.Push(b); f; f = d.Next())` sees them all.
  std::optional<BcdFrame> Push(std::uint8_t byte);
  std::optional<BcdFrame> Next();

  // Forgets a half frame, for instance after a silence.
  void Reset() { held_.clear(); }

  std::uint64_t wrong_sums() const { return wrong_sums_; }
  std::uint64_t skipped_bytes() const { return skipped_bytes_; }
  std::size_t bytes_held() const { return held_.size(); }

 private:
  void DropFirst();
  void AlignToHeader();

  FrameFamily family_;
  FixedVector<std::uint8_t, kFrameMaxLength + 1> held_;
  std::uint64_t wrong_sums_ = 0;
  std::uint64_t skipped_bytes_ = 0;
};

enum class AngleFailure {
  kNotAngles,      // a whole frame, but not a reply to "read angles"
  kUnknownLength,  // no known layout has this many data bytes
  kBadDigit,       // a nibble above 9, or a sign that is neither 0 nor 1
};

struct FrameAngles {
  double x_deg = 0.0;
  double y_deg = 0.0;
  double third = 0.0;  // temperature, heading or z, by model
  bool third_is_temperature = false;
};

// Three fields; the layout is told by the number of data bytes:
//   9 = 3 + 3 + 3  SDDD.DD                     12 = 4 + 4 + 4  SDDD.DDDD
//  11 = 4 + 4 + 3  SDDD.DDDD twice, SDDD.DD    (S: 0 plus, 1 minus; everything else decimal digits)
Result<FrameAngles, AngleFailure> DecodeAngles(FrameFamily family, const BcdFrame& frame);

enum class FrameLayout { kThreeByte, kFourByteTemperature, kFourByte };

// The instrument's side. Angles are rounded to the last digit and clamped to +-999.99...
BcdFrame EncodeAngles(std::uint8_t address, FrameLayout layout, const FrameAngles& angles);

}  // namespace tbm
