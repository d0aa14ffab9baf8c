#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include <boost/asio/buffer.hpp>

#include "hmi_bridge/server/auth_store.h"
#include "hmi_bridge/server/http_parse.h"
#include "hmi_bridge/server/router.h"
#include "tests/hmi_bridge/server/fake_source.h"
#include "tests/support/fake_clock.h"
#include "tests/support/temp_folder.h"

namespace {

using namespace tbm::hmi;

// Bytes as they come through the parser and the router, one request after the other, without
// sockets. Nobody is logged in but whoever finds out the word "letmepass": then what is behind the
// session is reached as well.
struct Bench {
  tbm::test::TempFolder folder;
  tbm::test::FakeClock clock;
  std::unique_ptr<AuthStore> auth;
  ServerOptions options;
  StaticFiles files;
  test::FakeSource source;
  Counters counters;
  std::unique_ptr<Router> router;
  std::string token;

  Bench() {
    AuthLimits cheap;
    cheap.log2_n = kLeastLog2N;
    auth = std::move(AuthStore::Open(folder / "state", clock, cheap)).value();
    auth->AddUser("sue", Role::kSurveyor, "grease and granite");
    token = (*auth->LogIn("sue", "grease and granite"))->token;
    options.openapi_text = "openapi: 3.1.0\n";
    router = std::make_unique<Router>(options, files, source, *auth, clock, counters);
  }
};

// Whoever splits an answer has won: its head is lines "name: value", each once.
void CheckHead(const std::string& head) {
  if (!head.starts_with("HTTP/1.1 ") || !head.ends_with("\r\n\r\n")) __builtin_trap();
  for (std::size_t i = 0; i < head.size(); ++i) {
    const bool is_cr = head[i] == '\r';
    const bool is_lf = head[i] == '\n';
    if (is_cr && (i + 1 >= head.size() || head[i + 1] != '\n')) __builtin_trap();
    if (is_lf && (i == 0 || head[i - 1] != '\r')) __builtin_trap();
  }
  if (head.find("\r\n\r\n") + 4 != head.size()) __builtin_trap();
  if (head.find("\r\nContent-Security-Policy: ") == std::string::npos) __builtin_trap();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Bench& bench = *new Bench;
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  for (int requests = 0; requests < 4 && !rest.empty(); ++requests) {
    BeastParser parser;
    Limit(parser, bench.options.limits);
    parser.eager(true);
    boost::system::error_code error;
    while (!rest.empty() && !parser.is_done()) {
      const std::size_t used = parser.put(boost::asio::buffer(rest.data(), rest.size()), error);
      rest.remove_prefix(used);
      if (error || used == 0) break;
    }
    if (error || !parser.is_done()) {
      if (error)
        CheckHead(ResponseHead(
            ErrorResponse(StatusOf(error), "bad_request", error.message()), false, false));
      return 0;
    }
    Request request = RequestFrom(parser.get(), {"127.0.0.1", "127.0.0.1", true, false});
    if (request.body.size() > bench.options.limits.report_bytes) __builtin_trap();
    const bool is_inside = request.cookie.find("letmepass") != std::string::npos;
    if (is_inside) request.cookie = "tbm_session=" + bench.token;
    if (request.body.size() > bench.router->BodyLimit(request)) return 0;
    Routed routed = bench.router->Route(request);
    if (const auto* upgrade = std::get_if<Upgrade>(&routed)) {
      if (!is_inside || upgrade->identity.name != "sue") __builtin_trap();
      return 0;
    }
    // Log-ins are left out: each would cost a password's time.
    if (std::holds_alternative<Later>(routed)) {
      auto& later = std::get<Later>(routed);
      if (later.where == Later::Where::kWriting && request.path() != "/api/logout") {
        CheckHead(ResponseHead(later.make(), false, true));
      }
      bench.clock.Advance(std::chrono::seconds(10));
    } else {
      CheckHead(ResponseHead(std::get<Response>(routed), false, request.is_keep_alive));
    }
    if (std::get_if<Response>(&routed) != nullptr && std::get<Response>(routed).status == 200 &&
        request.path() == "/api/snapshot" && !is_inside) {
      __builtin_trap();
    }
  }
  return 0;
}
