#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "pose/base/result.h"

namespace tbm {

enum class LinkFailure {
  kMissing,      // no such device file: the adapter is unplugged or the path is wrong
  kDenied,       // the file may not be opened by this user
  kBusy,         // another process has locked the port
  kBadSettings,  // not a serial port, or it refuses baud rate, parity or stop bits
  kHungUp,       // was open and is gone; only Close and Open help
  kTimeout,      // nothing came (or could be sent) in time; the link itself is fine
};

enum class Parity { kNone, kEven, kOdd };

// Always eight data bits.
struct SerialSettings {
  std::string path;  // e.g. /dev/serial/by-id/..., which survives replugging; ttyUSB0 does not
  int baud = 9600;   // one of kBaudRates
  Parity parity = Parity::kNone;
  int stop_bits = 1;  // 1 or 2

  // Time that `characters` need on the wire, with start, parity and stop bits.
  std::chrono::nanoseconds LineTime(std::size_t characters) const {
    const int bits = 1 + 8 + (parity == Parity::kNone ? 0 : 1) + stop_bits;
    return std::chrono::nanoseconds(
        static_cast<std::int64_t>(1e9 * static_cast<double>(characters) *
                                  static_cast<double>(bits) / static_cast<double>(baud)));
  }
};

inline constexpr int kBaudRates[] = {
    1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600};

// A two-way stream of bytes to an instrument. Used by one thread at a time. Tests hand in a fake
// whose waiting moves a fake clock.
class ByteLink {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  virtual ~ByteLink() = default;

  // Opens and empties the link; nothing that was said before is ever read. Empty when it worked.
  virtual std::optional<LinkFailure> Open() = 0;
  virtual void Close() = 0;
  virtual bool IsOpen() const = 0;

  virtual std::optional<LinkFailure> Write(std::span<const std::uint8_t> bytes) = 0;

  // Waits for at least one byte, at the latest until `until`, without using the processor.
  virtual Result<std::size_t, LinkFailure> Read(std::span<std::uint8_t> into, SteadyTime until) = 0;

  // Throws away what has come in and was not read. How many bytes that were.
  virtual std::size_t Discard() = 0;
};

}  // namespace tbm
