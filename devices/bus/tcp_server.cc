#include "devices/bus/tcp_server.h"

#include <algorithm>
#include <array>
#include <cerrno>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace tbm {

using std::chrono::steady_clock;

TcpServer::TcpServer(std::string address, int port, PtyInstrument& instrument)
    : address_(std::move(address)), instrument_(instrument), port_(port) {
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
  plug_.WaitSettled();
}

TcpServer::~TcpServer() {
  thread_.request_stop();
  plug_.Wake();
  thread_.join();
}

int TcpServer::port() const {
  const std::lock_guard lock(mutex_);
  return port_;
}

void TcpServer::Run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const bool plugged = plug_.IsWanted();
    if (plugged && listener_ < 0) Listen();
    if (!plugged) {
      DropClient();
      if (listener_ >= 0) close(listener_);
      listener_ = -1;
    }
    plug_.Settle(plugged, listener_ >= 0);
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
    std::array<pollfd, 3> entries{{{}, {listener_, POLLIN, 0}, {client_, POLLIN, 0}}};
    if (plug_.Sleep(entries, wake)) return;
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
