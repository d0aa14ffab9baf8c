#include "devices/bus/tcp_server.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

namespace tbm {

using std::chrono::steady_clock;

TcpServer::TcpServer(std::string address, int port, PtyInstrument& instrument)
    : address_(std::move(address)), instrument_(instrument), port_(port) {
  wake_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return settled_; });
}

TcpServer::~TcpServer() {
  thread_.request_stop();
  Wake();
  thread_.join();
  close(wake_);
}

bool TcpServer::IsUp() const {
  const std::lock_guard lock(mutex_);
  return is_up_;
}

int TcpServer::port() const {
  const std::lock_guard lock(mutex_);
  return port_;
}

void TcpServer::Want(bool plugged) {
  std::unique_lock lock(mutex_);
  if (wanted_ == plugged) return;
  wanted_ = plugged;
  settled_ = false;
  Wake();
  changed_.wait(lock, [this] { return settled_; });
}

void TcpServer::Wake() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(wake_, &one, sizeof one);
}

void TcpServer::Run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    bool plugged = false;
    {
      const std::lock_guard lock(mutex_);
      plugged = wanted_;
    }
    if (plugged && listener_ < 0) Listen();
    if (!plugged) {
      DropClient();
      if (listener_ >= 0) close(listener_);
      listener_ = -1;
    }
    {
      const std::lock_guard lock(mutex_);
      is_up_ = listener_ >= 0;
      settled_ = wanted_ == plugged;
    }
    changed_.notify_all();
    Serve(stop);
  }
  DropClient();
  if (listener_ >= 0) close(listener_);
}

void TcpServer::Listen() {
  sockaddr_in where{};
  where.sin_family = AF_INET;
  {
    const std::lock_guard lock(mutex_);
    where.sin_port = htons(static_cast<std::uint16_t>(port_));
  }
  if (inet_pton(AF_INET, address_.c_str(), &where.sin_addr) != 1) return;
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const int on = 1;
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  auto* const address = reinterpret_cast<sockaddr*>(&where);
  socklen_t size = sizeof where;
  if (fd < 0 || bind(fd, address, size) != 0 || listen(fd, 1) != 0 ||
      getsockname(fd, address, &size) != 0) {
    if (fd >= 0) close(fd);
    return;
  }
  listener_ = fd;
  const std::lock_guard lock(mutex_);
  port_ = ntohs(where.sin_port);
}

// Until somebody wakes it: the plug is to be moved, or the server ends.
void TcpServer::Serve(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const auto wake = listener_ >= 0 ? Talk() : std::nullopt;
    timespec wait{};
    if (wake) {
      const auto left = std::max(*wake - steady_clock::now(), steady_clock::duration::zero());
      const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
      wait.tv_sec = static_cast<time_t>(seconds.count());
      wait.tv_nsec = static_cast<long>(std::chrono::nanoseconds(left - seconds).count());
    }
    // A negative descriptor is passed over.
    std::array<pollfd, 3> entries{
        {{wake_, POLLIN, 0}, {listener_, POLLIN, 0}, {client_, POLLIN, 0}}};
    ppoll(entries.data(), entries.size(), wake ? &wait : nullptr, nullptr);
    if ((entries[0].revents & POLLIN) != 0) {
      std::uint64_t count = 0;
      [[maybe_unused]] const ssize_t taken = read(wake_, &count, sizeof count);
      return;
    }
    if (client_ >= 0 && entries[2].revents != 0) Receive();
    if (listener_ >= 0 && (entries[1].revents & POLLIN) != 0) Accept();
  }
}

// Lets the instrument say what is due. When it wants to be called again.
std::optional<PtyOutbox::SteadyTime> TcpServer::Talk() {
  auto wake = instrument_.OnTurn(steady_clock::now(), outbox_);
  while (const auto message = outbox_.TakeDue(steady_clock::now())) {
    if (client_ < 0) continue;
    const ssize_t sent = send(client_, message->data(), message->size(), MSG_NOSIGNAL);
    if (sent != static_cast<ssize_t>(message->size())) DropClient();
  }
  if (outbox_.TakeHangUp()) DropClient();
  if (const auto due = outbox_.NextDue()) wake = wake ? std::min(*wake, *due) : due;
  return wake;
}

void TcpServer::Accept() {
  const int fd = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (fd < 0) return;
  DropClient();
  client_ = fd;
  const int on = 1;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  instrument_.OnPlug();
}

void TcpServer::Receive() {
  std::array<std::uint8_t, 512> bytes{};
  const ssize_t count = recv(client_, bytes.data(), bytes.size(), 0);
  if (count > 0) {
    instrument_.OnBytes(
        std::span(bytes.data(), static_cast<std::size_t>(count)), steady_clock::now(), outbox_);
  } else if (count == 0 || (errno != EAGAIN && errno != EINTR)) {
    DropClient();
  }
}

void TcpServer::DropClient() {
  outbox_.Clear();
  if (client_ >= 0) close(client_);
  client_ = -1;
}

}  // namespace tbm
