#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace tbm {

// Datagrams of Sensonor inertial units on RS-422, in their normal mode. Numbers are big-endian.
//
// STIM300 (data sheet TS1524 r31):
//
//   ID gyro [accel] [tilt] [gyro temp] [accel temp] [tilt temp] [AUX or PPS] counter latency CRC-32
//
// A cluster is three signed 24-bit counts and its status byte, a temperature cluster three signed
// 16-bit counts and its status byte, AUX and PPS 24 bits and a status byte; counter 8 bits, latency
// 16 bits in microseconds. The CRC is over all before it and over as many zero bytes, which are not
// sent, as make a multiple of four.
//
// STIM210, and by assumption STIM202, speak otherwise under some of the same identifiers:
//
//   ID gyro [temperatures without a status byte] [three bytes of unknown use] [counter] [latency]
//   CRC-8
//
// CR LF may follow either, as the unit is set up. The counter counts the unit's internal samples,
// 2000 a second, not datagrams.
enum class StimFamily { kStim300, kStim210 };

inline constexpr std::size_t kStimMaxLength = 63;

enum class StimExtra { kNone, kAux, kPps };

// What stands behind an identifier, beside the gyros.
struct StimLayout {
  std::uint8_t id = 0;
  bool has_accel = false;
  bool has_tilt = false;
  bool has_temperature = false;
  StimExtra extra = StimExtra::kNone;
  bool has_reserved = false;  // STIM210: three bytes
  bool has_counter = true;
  bool has_latency = true;
};

std::span<const StimLayout> StimLayouts(StimFamily family);
const StimLayout* FindStimLayout(StimFamily family, std::uint8_t id);  // null: no such identifier
// With identifier and checksum, without CR LF.
std::size_t StimLength(StimFamily family, const StimLayout& layout);

// CRC-32/MPEG-2 of the bytes and as many zeros as make a multiple of four.
std::uint32_t StimCrc32(std::span<const std::uint8_t> bytes);
// Polynomial 0x07, start 0xFF, nothing reflected.
std::uint8_t StimCrc8(std::span<const std::uint8_t> bytes);

namespace stim_status {
inline constexpr std::uint8_t kIntegrity = 0x80;
inline constexpr std::uint8_t kStartUp = 0x40;
inline constexpr std::uint8_t kOutsideConditions = 0x20;
inline constexpr std::uint8_t kOverload = 0x10;
inline constexpr std::uint8_t kChannel = 0x08;
inline constexpr std::uint8_t kAxes = 0x07;  // which: z, y, x
}  // namespace stim_status

struct StimCluster {
  std::array<std::int32_t, 3> counts{};  // x, y, z
  std::uint8_t status = 0;

  bool operator==(const StimCluster&) const = default;
};

struct StimExtraValue {
  std::uint32_t counts = 0;  // 24 bits as sent; AUX is signed: 5 V / 2^24 a count
  std::uint8_t status = 0;

  bool operator==(const StimExtraValue&) const = default;
};

struct StimDatagram {
  std::uint8_t id = 0;
  StimCluster gyro;
  std::optional<StimCluster> accel;
  std::optional<StimCluster> tilt;
  std::optional<StimCluster> gyro_temperature;  // 1/256 degree Celsius
  std::optional<StimCluster> accel_temperature;
  std::optional<StimCluster> tilt_temperature;
  std::optional<StimExtraValue> extra;
  std::optional<std::uint8_t> counter;
  std::optional<std::uint16_t> latency_us;

  // By the decoder: it began where the one before had ended.
  bool follows = false;

  bool operator==(const StimDatagram&) const = default;
};

struct StimCounts {
  std::uint64_t datagrams = 0;    // with a right checksum
  std::uint64_t wrong_crcs = 0;   // where a datagram was due and began, its checksum is wrong
  std::uint64_t lost = 0;         // by jumps of the counter, modulo 256
  std::uint64_t starting_up = 0;  // with that bit in any cluster's status
  std::uint64_t overloads = 0;    // the same
  std::uint64_t skipped_bytes = 0;
  std::uint64_t terminator_bytes = 0;  // CR LF between datagrams
};

// Finds datagrams in a stream that may start in the middle of one, lose bytes and contain noise.
// After a wrong checksum the search goes on at the byte after the false identifier, so a datagram
// that began inside the noise is still found.
//
// Eight bits of checksum let one piece of noise in 256 pass. Where a STIM210 datagram does not
// follow one of its own kind it is believed only when behind it stands its identifier again, or CR:
// it comes out with the first byte of the next one, and one alone between two pieces of noise is
// lost.
class StimDecoder {
 public:
  // `counter_step`: by how much the counter grows from one datagram to the next, 1 to 128.
  StimDecoder(StimFamily family, int counter_step)
      : family_(family), counter_step_(static_cast<unsigned>(counter_step)) {}

  // The first whole datagram with a right checksum, if this byte completes one. Noise that looked
  // like the beginning of one can have hidden others:
  // `for (auto d = decoder.Push(b); d; d = decoder.Next())` sees them all.
  std::optional<StimDatagram> Push(std::uint8_t byte);
  std::optional<StimDatagram> Next();

  // Forgets what it holds and the counter, for instance after the port was opened. Not the counts.
  void Reset();

  const StimCounts& counts() const { return counts_; }
  std::size_t bytes_held() const { return size_; }

 private:
  enum class Look { kGood, kBad, kTooShort };

  Look LookAt(const StimLayout& layout) const;
  bool HasRightCrc(std::size_t length) const;
  std::optional<StimDatagram> Take(const StimLayout& layout);
  void Count(const StimDatagram& datagram);
  void Skip();
  void Drop(std::size_t count);

  const StimFamily family_;
  const unsigned counter_step_;
  std::array<std::uint8_t, kStimMaxLength + 1> held_{};
  std::size_t size_ = 0;
  bool in_sync_ = false;  // the first byte held stands where a datagram (or CR LF) is due
  std::uint8_t last_id_ = 0;
  std::optional<std::uint8_t> last_counter_;
  StimCounts counts_;
};

}  // namespace tbm
