#include "tests/hmi_bridge/server/wire_client.h"

#include <array>
#include <cctype>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace tbm::hmi::test {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

struct WireClient::Wire {
  int descriptor = -1;
  SSL_CTX* context = nullptr;
  SSL* ssl = nullptr;

  ~Wire() {
    if (ssl != nullptr) SSL_free(ssl);
    if (context != nullptr) SSL_CTX_free(context);
    if (descriptor >= 0) ::close(descriptor);
  }
};

int Frame::close_code() const {
  if (opcode != 8 || payload.size() < 2) return 0;
  return static_cast<unsigned char>(payload[0]) << 8 | static_cast<unsigned char>(payload[1]);
}

WireClient::WireClient(std::uint16_t port, Tls tls, int receive_buffer_bytes)
    : wire_(std::make_unique<Wire>()) {
  const int descriptor = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (receive_buffer_bytes > 0) {
    ::setsockopt(
        descriptor, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof receive_buffer_bytes);
  }
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(descriptor, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
    ::close(descriptor);
    return;
  }
  wire_->descriptor = descriptor;
  if (tls == Tls::kNone) return;
  wire_->context = SSL_CTX_new(TLS_client_method());
  if (tls == Tls::kOnly11) {
    SSL_CTX_set_min_proto_version(wire_->context, TLS1_1_VERSION);
    SSL_CTX_set_max_proto_version(wire_->context, TLS1_1_VERSION);
    SSL_CTX_set_cipher_list(wire_->context, "ALL:@SECLEVEL=0");
  }
  if (tls == Tls::kOnly12) SSL_CTX_set_max_proto_version(wire_->context, TLS1_2_VERSION);
  wire_->ssl = SSL_new(wire_->context);
  SSL_set_fd(wire_->ssl, descriptor);
  if (SSL_connect(wire_->ssl) == 1) return;
  SSL_free(wire_->ssl);
  wire_->ssl = nullptr;
  ::close(descriptor);
  wire_->descriptor = -1;
}

WireClient::~WireClient() = default;

bool WireClient::is_open() const { return wire_->descriptor >= 0; }
int WireClient::descriptor() const { return wire_->descriptor; }

bool WireClient::Send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = wire_->ssl != nullptr
                             ? SSL_write(wire_->ssl, bytes.data(), static_cast<int>(bytes.size()))
                             : ::send(wire_->descriptor, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  return true;
}

bool WireClient::Fill(milliseconds patience) {
  pollfd ready = {wire_->descriptor, POLLIN, 0};
  const bool has_some = wire_->ssl != nullptr && SSL_pending(wire_->ssl) > 0;
  if (!has_some && ::poll(&ready, 1, static_cast<int>(patience.count())) != 1) return false;
  std::array<char, 65536> piece{};
  const ssize_t count = wire_->ssl != nullptr
                            ? SSL_read(wire_->ssl, piece.data(), static_cast<int>(piece.size()))
                            : ::recv(wire_->descriptor, piece.data(), piece.size(), 0);
  if (count <= 0) return false;
  buffer_.append(piece.data(), static_cast<std::size_t>(count));
  return true;
}

HttpAnswer WireClient::Answer(bool is_head) {
  constexpr milliseconds kPatience(20'000);
  std::size_t end = 0;
  while ((end = buffer_.find("\r\n\r\n")) == std::string::npos) {
    if (!Fill(kPatience)) return {};
  }
  HttpAnswer answer;
  const std::string head = buffer_.substr(0, end + 2);
  buffer_.erase(0, end + 4);
  answer.status = std::stoi("0" + head.substr(std::min<std::size_t>(9, head.size()), 3));
  for (std::size_t at = head.find("\r\n") + 2; at < head.size();) {
    const std::size_t line_end = head.find("\r\n", at);
    const std::size_t colon = head.find(": ", at);
    std::string name = head.substr(at, colon - at);
    for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    answer.headers[name] = head.substr(colon + 2, line_end - colon - 2);
    at = line_end + 2;
  }
  const auto length = answer.headers.find("content-length");
  const std::size_t size =
      is_head || length == answer.headers.end() ? 0 : std::stoul(length->second);
  while (buffer_.size() < size && Fill(kPatience)) {
  }
  answer.body = buffer_.substr(0, size);
  buffer_.erase(0, size);
  return answer;
}

HttpAnswer WireClient::Open(std::string_view path,
                            std::string_view subprotocol,
                            std::string_view headers) {
  Send("GET " + std::string(path) +
       " HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
       "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
       "Sec-WebSocket-Protocol: " +
       std::string(subprotocol) + "\r\n" + std::string(headers) + "\r\n");
  return Answer();
}

bool WireClient::SendFrame(int opcode, std::string_view payload, bool is_masked) {
  std::string frame(1, static_cast<char>(0x80 | opcode));
  const int mask_bit = is_masked ? 0x80 : 0;
  if (payload.size() < 126) {
    frame += static_cast<char>(mask_bit | static_cast<int>(payload.size()));
  } else {
    const bool is_short = payload.size() < 65536;
    frame += static_cast<char>(mask_bit | (is_short ? 126 : 127));
    for (int shift = is_short ? 8 : 56; shift >= 0; shift -= 8)
      frame += static_cast<char>(payload.size() >> shift);
  }
  constexpr std::array<char, 4> kMask = {0x11, 0x22, 0x33, 0x44};
  if (is_masked) frame.append(kMask.data(), kMask.size());
  for (std::size_t i = 0; i < payload.size(); ++i) {
    frame += is_masked ? static_cast<char>(payload[i] ^ kMask[i % 4]) : payload[i];
  }
  return Send(frame);
}

std::optional<Frame> WireClient::Read(milliseconds patience) {
  const auto until = steady_clock::now() + patience;
  while (true) {
    const auto byte = [this](std::size_t i) { return static_cast<unsigned char>(buffer_[i]); };
    if (buffer_.size() >= 2) {
      std::size_t head = 2;
      std::uint64_t size = byte(1) & 0x7fu;
      const std::size_t more = size == 126 ? 2 : size == 127 ? 8 : 0;
      if (buffer_.size() >= head + more) {
        if (more > 0) size = 0;
        for (std::size_t i = 0; i < more; ++i) size = size << 8 | byte(head + i);
        head += more;
        if (buffer_.size() >= head + size) {
          Frame frame{byte(0) & 0x0f, buffer_.substr(head, size)};
          buffer_.erase(0, head + size);
          return frame;
        }
      }
    }
    const auto left = std::chrono::duration_cast<milliseconds>(until - steady_clock::now());
    if (left.count() <= 0 || !Fill(left)) return std::nullopt;
  }
}

std::size_t WireClient::ReadAway(milliseconds patience) {
  buffer_.clear();
  return Fill(patience) ? buffer_.size() : 0;
}

bool WireClient::IsClosedWithin(milliseconds patience) {
  const auto until = steady_clock::now() + patience;
  while (steady_clock::now() < until) {
    buffer_.clear();
    pollfd ready = {wire_->descriptor, POLLIN, 0};
    const auto left = std::chrono::duration_cast<milliseconds>(until - steady_clock::now());
    if (::poll(&ready, 1, static_cast<int>(left.count())) != 1) return false;
    if (!Fill(milliseconds(0))) return true;
  }
  return false;
}

}  // namespace tbm::hmi::test
