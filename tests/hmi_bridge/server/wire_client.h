#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace tbm::hmi::test {

struct HttpAnswer {
  int status = 0;                              // 0: the connection ended without one
  std::map<std::string, std::string> headers;  // names in small letters
  std::string body;
};

struct Frame {
  int opcode = 0;  // 1 text, 2 binary, 8 close, 9 ping, 10 pong
  std::string payload;

  int close_code() const;
};

// The other end of a console's wire: says exactly the bytes it is told to, right or wrong.
class WireClient {
 public:
  enum class Tls { kNone, kAny, kOnly11, kOnly12 };

  explicit WireClient(std::uint16_t port, Tls tls = Tls::kNone, int receive_buffer_bytes = 0);
  ~WireClient();
  WireClient(const WireClient&) = delete;
  WireClient& operator=(const WireClient&) = delete;

  bool is_open() const;
  bool Send(std::string_view bytes);
  // Reads one answer; `is_head`: it has no body whatever it says.
  HttpAnswer Answer(bool is_head = false);
  HttpAnswer Ask(std::string_view request) {
    Send(request);
    return Answer();
  }
  // Asks for a WebSocket.
  HttpAnswer Open(std::string_view path, std::string_view subprotocol, std::string_view headers);
  bool SendFrame(int opcode, std::string_view payload, bool is_masked = true);
  // The next frame, of whatever kind; pings are not answered.
  std::optional<Frame> Read(std::chrono::milliseconds patience = std::chrono::seconds(10));
  // Whether the other end closes within that time; what comes before is read away.
  bool IsClosedWithin(std::chrono::milliseconds patience);
  // Bytes of the next piece that comes, without looking into them; 0: none came.
  std::size_t ReadAway(std::chrono::milliseconds patience);
  int descriptor() const;

 private:
  bool Fill(std::chrono::milliseconds patience);

  struct Wire;
  std::unique_ptr<Wire> wire_;
  std::string buffer_;
};

}  // namespace tbm::hmi::test
