#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tbm::hmi {

struct ListenAddress {
  std::string address = "127.0.0.1";  // IPv4 or IPv6
  std::uint16_t port = 0;             // 0: the system chooses one
};

struct TlsFiles {
  std::string certificate_pem;  // with the chain behind it
  std::string key_pem;
};

// What an honest console never comes near.
struct ServerLimits {
  std::size_t connections = 256;
  std::size_t connections_per_address = 64;  // loopback: all
  std::size_t header_bytes = 8 * 1024;
  std::size_t body_bytes = 16 * 1024;
  std::size_t report_bytes = 300 * 1024;     // of who is logged in and asks for a report
  std::size_t live_client_bytes = 4 * 1024;  // in one message of a console
  std::size_t foxglove_client_bytes = 16 * 1024;
  std::size_t waiting_samples = 256;  // for one tool
  std::size_t waiting_bytes = 2 * 1024 * 1024;
  std::chrono::milliseconds request{10'000};  // from its first byte to its last, TLS' included
  std::chrono::milliseconds idle{30'000};     // between requests
  std::chrono::milliseconds answer{30'000};   // to take all of an answer
  std::chrono::milliseconds write{10'000};    // to take one message
  std::chrono::milliseconds silence{20'000};  // without any sign; asked for one at half of it
  std::chrono::milliseconds live_period{100};
  // What is told within this belongs together and goes out as one.
  std::chrono::milliseconds gather{8};
  std::chrono::milliseconds heartbeat{1'000};
  int logins_at_once = 5;
  std::chrono::milliseconds login_period{10'000};
  int commands_at_once = 10;
  std::chrono::milliseconds command_period{1'000};
  std::size_t waiting_logins = 8;
};

// What happened, for the log. Never holds a password or a token.
struct ServerEvent {
  enum class What {
    kLoggedIn,
    kLoginWrong,
    kLoginLimited,
    kLoggedOut,
    kForeignOrigin,
    kForeignHost,
    kStateFault,  // a file of the state folder; `text` says which and what
    kAcceptFault,
  };
  What what = What::kLoggedIn;
  std::string name;  // as it was typed, cut and without control characters; empty: none
  std::string address;
  std::string text;
};
std::string_view Word(ServerEvent::What what);

struct ServerOptions {
  std::vector<ListenAddress> listen = {{}};
  std::optional<TlsFiles> tls;
  std::string web_folder;  // of the built page; empty: none is served
  std::string openapi_text;
  std::vector<std::string> allowed_names;  // of this computer, as a browser's address line has them
  std::string product = "tbm";             // what tools are told
  ServerLimits limits;
  std::function<void(const ServerEvent&)> on_event;  // from any thread
};

// All that is wrong with it, a sentence each. Opens no port. `tls_follows`: a certificate is still
// to be made.
std::vector<std::string> Problems(const ServerOptions& options, bool tls_follows = false);

}  // namespace tbm::hmi
