#include "tests/devices/camera/gv_proxy.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace tbm::test {
namespace {

constexpr std::uint16_t kControlPort = 3956;
constexpr std::size_t kHeader = 8;
constexpr int kSocketBuffer = 8'000'000;
constexpr std::size_t kFramesKept = 4;

// GVCP commands and registers (GigE Vision 1.2).
constexpr std::uint16_t kReadRegister = 0x0080;
constexpr std::uint16_t kReadRegisterAck = 0x0081;
constexpr std::uint16_t kWriteRegister = 0x0082;
constexpr std::uint16_t kPacketResend = 0x0040;
constexpr std::uint32_t kStreamPort = 0x0d00;
constexpr std::uint32_t kStreamAddress = 0x0d18;
constexpr std::uint32_t kCapabilities = 0x0934;
constexpr std::uint32_t kCanResend = 0x4;

std::uint16_t Read16(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes[at] << 8 | bytes[at + 1]);
}
std::uint32_t Read32(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  return static_cast<std::uint32_t>(Read16(bytes, at)) << 16 | Read16(bytes, at + 2);
}
void Write32(std::vector<std::uint8_t>& bytes, std::size_t at, std::uint32_t value) {
  for (std::size_t i = 0; i < 4; ++i)
    bytes[at + i] = static_cast<std::uint8_t>(value >> (24 - 8 * i));
}

sockaddr_in Address(const std::string& ip, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  inet_pton(AF_INET, ip.c_str(), &address.sin_addr);
  return address;
}

int BoundSocket(const std::string& ip, std::uint16_t port) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
  const sockaddr_in own = Address(ip, port);
  if (fd >= 0 && bind(fd, reinterpret_cast<const sockaddr*>(&own), sizeof(own)) != 0) {
    close(fd);
    return -1;
  }
  setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &kSocketBuffer, sizeof(kSocketBuffer));
  return fd;
}

}  // namespace

GvProxy::GvProxy(std::string own_address, std::string camera_address, const std::string& stream)
    : own_address_(std::move(own_address)), random_(stream) {
  control_ = BoundSocket(own_address_, kControlPort);
  stream_ = BoundSocket(own_address_, 0);
  upstream_ = BoundSocket(own_address_, 0);
  const sockaddr_in camera = Address(camera_address, kControlPort);
  if (connect(upstream_, reinterpret_cast<const sockaddr*>(&camera), sizeof(camera)) != 0) return;
  sockaddr_in own{};
  socklen_t size = sizeof(own);
  getsockname(stream_, reinterpret_cast<sockaddr*>(&own), &size);
  stream_port_ = ntohs(own.sin_port);
  if (is_up()) thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

GvProxy::~GvProxy() {
  thread_ = std::jthread();
  for (const int fd : {control_, upstream_, stream_}) {
    if (fd >= 0) close(fd);
  }
}

void GvProxy::Run(const std::stop_token& stop) {
  Bytes packet;
  while (!stop.stop_requested()) {
    std::array<pollfd, 3> waiting = {
        pollfd{control_, POLLIN, 0}, pollfd{upstream_, POLLIN, 0}, pollfd{stream_, POLLIN, 0}};
    poll(waiting.data(), waiting.size(), 50);
    for (std::size_t i = 0; i < waiting.size(); ++i) {
      for (int burst = 0; burst < 64; ++burst) {
        packet.resize(65536);
        sockaddr_in from{};
        socklen_t size = sizeof(from);
        const ssize_t count = recvfrom(waiting[i].fd,
                                       packet.data(),
                                       packet.size(),
                                       0,
                                       reinterpret_cast<sockaddr*>(&from),
                                       &size);
        if (count <= 0) break;
        packet.resize(static_cast<std::size_t>(count));
        if (is_black_hole || packet.size() < kHeader) continue;
        if (i == 0) {
          client_control_ = from;
          FromClient(packet);
        } else if (i == 1) {
          FromCamera(packet);
        } else {
          FromStream(packet);
        }
      }
    }
  }
}

void GvProxy::FromClient(Bytes& packet) {
  if (Happens(control_drop)) return;
  const std::uint16_t command = Read16(packet, 2);
  if (command == kPacketResend && answers_resend) return Resend(packet);
  if (command == kReadRegister && packet.size() >= kHeader + 4) {
    asked_register_[Read16(packet, 6)] = Read32(packet, kHeader);
  }
  if (command == kWriteRegister) RewriteDestination(packet);
  send(upstream_, packet.data(), packet.size(), 0);
}

void GvProxy::RewriteDestination(Bytes& packet) {
  for (std::size_t at = kHeader; at + 8 <= packet.size(); at += 8) {
    const std::uint32_t address = Read32(packet, at);
    const std::uint32_t value = Read32(packet, at + 4);
    if (address == kStreamAddress && value != 0) {
      client_stream_.sin_family = AF_INET;
      client_stream_.sin_addr.s_addr = htonl(value);
      Write32(packet, at + 4, ntohl(Address(own_address_, 0).sin_addr.s_addr));
    } else if (address == kStreamPort && value != 0) {
      client_stream_.sin_port = htons(static_cast<std::uint16_t>(value));
      Write32(packet, at + 4, stream_port_);
    }
  }
}

void GvProxy::FromCamera(Bytes& packet) {
  if (Happens(control_drop)) return;
  if (Read16(packet, 2) == kReadRegisterAck && packet.size() >= kHeader + 4) {
    const auto asked = asked_register_.find(Read16(packet, 6));
    if (asked != asked_register_.end() && asked->second == kCapabilities && answers_resend) {
      Write32(packet, kHeader, Read32(packet, kHeader) | kCanResend);
    }
  }
  sendto(control_,
         packet.data(),
         packet.size(),
         0,
         reinterpret_cast<const sockaddr*>(&client_control_),
         sizeof(client_control_));
}

void GvProxy::FromStream(Bytes& packet) {
  Remember(packet);
  if (Happens(drop)) {
    ++dropped_;
    return;
  }
  if (Happens(corrupt) && packet.size() > kHeader + 64) {
    packet[kHeader + static_cast<std::size_t>(
                         random_.Index(static_cast<int>(packet.size() - kHeader)))] ^= 0xFF;
  }
  if (held_) {
    SendStream(packet);
    SendStream(*held_);
    held_.reset();
    return;
  }
  if (Happens(reorder)) {
    held_ = packet;
    return;
  }
  SendStream(packet);
  if (Happens(duplicate)) SendStream(packet);
}

void GvProxy::Remember(const Bytes& packet) {
  if (!answers_resend) return;
  const std::uint16_t frame = Read16(packet, 2);
  const std::uint32_t number = Read32(packet, 4) & 0xFFFFFF;
  if (!recent_frames_.contains(frame)) {
    frame_order_.push_back(frame);
    if (frame_order_.size() > kFramesKept) {
      recent_frames_.erase(frame_order_.front());
      frame_order_.erase(frame_order_.begin());
    }
  }
  std::vector<Bytes>& packets = recent_frames_[frame];
  if (packets.size() <= number) packets.resize(number + 1);
  packets[number] = packet;
}

// Payload: frame id, first and last packet, 32 bits each. Resent packets get lost like any other.
void GvProxy::Resend(const Bytes& request) {
  if (request.size() < kHeader + 12) return;
  const auto frame = recent_frames_.find(static_cast<std::uint16_t>(Read32(request, kHeader)));
  if (frame == recent_frames_.end()) return;
  const std::uint32_t first = Read32(request, kHeader + 4) & 0xFFFFFF;
  const std::uint32_t last = Read32(request, kHeader + 8) & 0xFFFFFF;
  for (std::uint32_t i = first; i <= last && i < frame->second.size(); ++i) {
    if (frame->second[i].empty() || Happens(drop)) continue;
    ++resent_;
    SendStream(frame->second[i]);
  }
}

void GvProxy::SendStream(const Bytes& packet) {
  sendto(stream_,
         packet.data(),
         packet.size(),
         0,
         reinterpret_cast<const sockaddr*>(&client_stream_),
         sizeof(client_stream_));
}

}  // namespace tbm::test
