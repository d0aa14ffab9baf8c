#include "devices/bus/serial_port.h"

#include <algorithm>
#include <cerrno>
#include <ctime>

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

namespace tbm {
namespace {

using std::chrono::steady_clock;

// A request is a few bytes: if the driver cannot take them in this time the port is stuck.
constexpr std::chrono::milliseconds kWriteLimit(250);

std::optional<speed_t> SpeedOf(int baud) {
  switch (baud) {
    case 1200:
      return B1200;
    case 2400:
      return B2400;
    case 4800:
      return B4800;
    case 9600:
      return B9600;
    case 19200:
      return B19200;
    case 38400:
      return B38400;
    case 57600:
      return B57600;
    case 115200:
      return B115200;
    case 230400:
      return B230400;
    case 460800:
      return B460800;
    case 921600:
      return B921600;
    default:
      return std::nullopt;
  }
}

bool Configure(int fd, const SerialSettings& settings) {
  const std::optional<speed_t> speed = SpeedOf(settings.baud);
  termios line{};
  if (!speed || tcgetattr(fd, &line) != 0) return false;
  cfmakeraw(&line);
  line.c_cflag |= CLOCAL | CREAD;
  line.c_cflag &= ~static_cast<tcflag_t>(CRTSCTS | PARENB | PARODD | CSTOPB | CSIZE);
  line.c_cflag |= CS8;
  line.c_iflag &= ~static_cast<tcflag_t>(IXON | IXOFF | IXANY | INPCK);
  if (settings.parity != Parity::kNone) {
    line.c_cflag |= PARENB;
    line.c_iflag |= INPCK;
  }
  if (settings.parity == Parity::kOdd) line.c_cflag |= PARODD;
  if (settings.stop_bits == 2) line.c_cflag |= CSTOPB;
  line.c_cc[VMIN] = 1;
  line.c_cc[VTIME] = 0;
  cfsetispeed(&line, *speed);
  cfsetospeed(&line, *speed);
  return tcsetattr(fd, TCSANOW, &line) == 0;
}

// Waits for `events`; the events that came, 0 after `until`, negative when the port is gone.
int WaitFor(int fd, short events, steady_clock::time_point until) {
  for (;;) {
    const auto left = std::max(until - steady_clock::now(), steady_clock::duration::zero());
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
    timespec wait{};
    wait.tv_sec = static_cast<time_t>(seconds.count());
    wait.tv_nsec = static_cast<long>(std::chrono::nanoseconds(left - seconds).count());
    pollfd entry{fd, events, 0};
    const int ready = ppoll(&entry, 1, &wait, nullptr);
    if (ready > 0) return entry.revents;
    if (ready == 0) return 0;
    if (errno != EINTR) return -1;
  }
}

}  // namespace

LinkFailure LinkFailureFromErrno(int error) {
  switch (error) {
    case EACCES:
    case EPERM:
      return LinkFailure::kDenied;
    case EBUSY:
    case EWOULDBLOCK:
      return LinkFailure::kBusy;
    case ENOENT:
    case ENODEV:
    case ENXIO:
    case EIO:
      return LinkFailure::kMissing;
    default:
      return LinkFailure::kBadSettings;
  }
}

bool LockPort(int fd) { return flock(fd, LOCK_EX | LOCK_NB) == 0; }

std::size_t BytesWaiting(int fd) {
  int waiting = 0;
  return ioctl(fd, FIONREAD, &waiting) == 0 && waiting > 0 ? static_cast<std::size_t>(waiting) : 0;
}

std::optional<LinkFailure> SerialPort::Open() {
  Close();
  fd_ = open(settings_.path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd_ < 0) return LinkFailureFromErrno(errno);
  if (!LockPort(fd_)) {
    Close();
    return LinkFailure::kBusy;
  }
  if (!Configure(fd_, settings_)) {
    Close();
    return LinkFailure::kBadSettings;
  }
  tcflush(fd_, TCIOFLUSH);
  return std::nullopt;
}

void SerialPort::Close() {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

std::optional<LinkFailure> SerialPort::Write(std::span<const std::uint8_t> bytes) {
  if (fd_ < 0) return LinkFailure::kHungUp;
  const auto until = steady_clock::now() + kWriteLimit;
  while (!bytes.empty()) {
    const int events = WaitFor(fd_, POLLOUT, until);
    if (events == 0) return LinkFailure::kTimeout;
    if (events < 0 || (events & (POLLHUP | POLLERR | POLLNVAL)) != 0) return LinkFailure::kHungUp;
    const ssize_t written = write(fd_, bytes.data(), bytes.size());
    if (written >= 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    } else if (errno != EAGAIN && errno != EINTR) {
      return LinkFailure::kHungUp;
    }
  }
  return std::nullopt;
}

Result<std::size_t, LinkFailure> SerialPort::Read(std::span<std::uint8_t> into, SteadyTime until) {
  if (fd_ < 0) return Failure{LinkFailure::kHungUp};
  for (;;) {
    const int events = WaitFor(fd_, POLLIN, until);
    if (events == 0) return Failure{LinkFailure::kTimeout};
    if (events < 0) return Failure{LinkFailure::kHungUp};
    const ssize_t count = read(fd_, into.data(), into.size());
    if (count > 0) return static_cast<std::size_t>(count);
    // Readable with nothing to read is how a terminal says that its other end is gone.
    if (count == 0 || (errno != EAGAIN && errno != EINTR)) return Failure{LinkFailure::kHungUp};
  }
}

std::size_t SerialPort::Discard() {
  if (fd_ < 0) return 0;
  const std::size_t waiting = BytesWaiting(fd_);
  tcflush(fd_, TCIFLUSH);
  return waiting;
}

}  // namespace tbm
