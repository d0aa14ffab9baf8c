#pragma once

#include "devices/bus/byte_link.h"

namespace tbm {

// A serial port of the machine by POSIX termios: raw, eight bits, no flow control, locked against
// a second process. Waiting is ppoll, so an idle or unplugged line costs no processor time.
class SerialPort final : public ByteLink {
 public:
  explicit SerialPort(SerialSettings settings) : settings_(std::move(settings)) {}
  ~SerialPort() override { Close(); }
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  std::optional<LinkFailure> Open() override;
  void Close() override;
  bool IsOpen() const override { return fd_ >= 0; }
  std::optional<LinkFailure> Write(std::span<const std::uint8_t> bytes) override;
  Result<std::size_t, LinkFailure> Read(std::span<std::uint8_t> into, SteadyTime until) override;
  std::size_t Discard() override;

 private:
  SerialSettings settings_;
  int fd_ = -1;
};

// Why open(2) or a first ioctl failed, from errno.
LinkFailure LinkFailureFromErrno(int error);

// Takes the advisory lock that keeps a second process of ours off the port; false when it is taken.
bool LockPort(int fd);

// Bytes that have come in on `fd` and were not read; 0 also when the port is gone.
std::size_t BytesWaiting(int fd);

}  // namespace tbm
