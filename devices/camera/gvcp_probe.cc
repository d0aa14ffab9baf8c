#include "devices/camera/gvcp_probe.h"

#include <array>
#include <chrono>
#include <cstdint>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace tbm {
namespace {

constexpr std::uint16_t kControlPort = 3956;

// A UDP socket that hears `address` only; -1 when there is no route.
class ConnectedSocket {
 public:
  explicit ConnectedSocket(const std::string& address) : fd_(socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in peer{};
    peer.sin_family = AF_INET;
    peer.sin_port = htons(kControlPort);
    if (fd_ < 0) return;
    if (inet_pton(AF_INET, address.c_str(), &peer.sin_addr) != 1 ||
        connect(fd_, reinterpret_cast<const sockaddr*>(&peer), sizeof(peer)) != 0) {
      close(fd_);
      fd_ = -1;
    }
  }
  ~ConnectedSocket() {
    if (fd_ >= 0) close(fd_);
  }
  ConnectedSocket(const ConnectedSocket&) = delete;
  ConnectedSocket& operator=(const ConnectedSocket&) = delete;

  int fd() const { return fd_; }

 private:
  int fd_;
};

}  // namespace

bool AnswersDiscovery(const std::string& address, Duration timeout) {
  const ConnectedSocket socket(address);
  if (socket.fd() < 0) return false;
  // key 0x42, answer wanted, command DISCOVERY 0x0002, no payload, request id 0x7B4D.
  const std::array<std::uint8_t, 8> request = {0x42, 0x01, 0x00, 0x02, 0x00, 0x00, 0x7B, 0x4D};
  if (send(socket.fd(), request.data(), request.size(), 0) < 0) return false;

  const auto deadline = std::chrono::steady_clock::now() + timeout;
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        deadline - std::chrono::steady_clock::now());
    if (left.count() < 0) return false;
    pollfd waiting{socket.fd(), POLLIN, 0};
    if (poll(&waiting, 1, static_cast<int>(left.count())) <= 0) return false;
    std::array<std::uint8_t, 1024> answer{};
    const ssize_t size = recv(socket.fd(), answer.data(), answer.size(), 0);
    if (size < 0) return false;  // "port unreachable" came back: a computer, but no camera
    // DISCOVERY_ACK 0x0003 to our id.
    if (size >= 8 && answer[2] == 0x00 && answer[3] == 0x03 && answer[6] == 0x7B &&
        answer[7] == 0x4D) {
      return true;
    }
  }
}

std::string InterfaceTowards(const std::string& address) {
  const ConnectedSocket socket(address);
  if (socket.fd() < 0) return {};
  sockaddr_in own{};
  socklen_t size = sizeof(own);
  if (getsockname(socket.fd(), reinterpret_cast<sockaddr*>(&own), &size) != 0) return {};
  std::array<char, INET_ADDRSTRLEN> text{};
  if (inet_ntop(AF_INET, &own.sin_addr, text.data(), text.size()) == nullptr) return {};
  return text.data();
}

int GrantedSocketBuffer(int wanted_bytes) {
  const int fd = socket(AF_INET, SOCK_DGRAM, 0);
  if (fd < 0) return -1;
  setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &wanted_bytes, sizeof(wanted_bytes));
  int granted_bytes = -2;
  socklen_t size = sizeof(granted_bytes);
  getsockopt(fd, SOL_SOCKET, SO_RCVBUF, &granted_bytes, &size);
  close(fd);
  return granted_bytes / 2;  // the kernel doubles what it grants, for its own records
}

}  // namespace tbm
