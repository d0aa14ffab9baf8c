#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "hmi_bridge/server/auth_store.h"
#include "hmi_bridge/server/console_source.h"
#include "hmi_bridge/server/counters.h"
#include "hmi_bridge/server/http_message.h"
#include "hmi_bridge/server/rate_limit.h"
#include "hmi_bridge/server/server_options.h"
#include "hmi_bridge/server/static_files.h"
#include "pose/base/clock.h"

namespace tbm::hmi {

// An answer that takes long: to be made on another thread.
struct Later {
  enum class Where { kHashing, kWriting };
  Where where = Where::kHashing;
  std::function<Response()> make;
};

// The connection becomes a WebSocket.
struct Upgrade {
  enum class To { kLive, kFoxglove };
  To to = To::kLive;
  Identity identity;
};

using Routed = std::variant<Response, Later, Upgrade>;

// Decides what a request gets. Knows no sockets; safe from several threads.
class Router {
 public:
  Router(const ServerOptions& options,
         const StaticFiles& files,
         ConsoleSource& source,
         AuthStore& auth,
         const Clock& clock,
         Counters& counters);

  Routed Route(const Request& request);
  // How many bytes of a body are read at all, asked when only its head has come.
  std::size_t BodyLimit(const Request& head);
  // For what there is no place to wait any more.
  Response Busy();

 private:
  using Handler = Routed (Router::*)(const Request&);
  struct Place {
    std::string_view path;
    std::string_view method;  // GET includes HEAD
    Handler handler;
  };
  static const Place kPlaces[];

  Routed Login(const Request& request);
  Routed Logout(const Request& request);
  Routed Me(const Request& request);
  Routed Snapshot(const Request& request);
  Routed History(const Request& request);
  Routed Advance(const Request& request);
  Routed Commands(const Request& request);
  Routed Reports(const Request& request);
  Routed ReportFile(const Request& request);
  Routed OpenApi(const Request& request);
  Routed Metrics(const Request& request);
  Routed Health(const Request& request);
  Routed Live(const Request& request);
  Routed Foxglove(const Request& request);

  std::optional<Identity> Who(const Request& request);
  Response NotLoggedIn();
  Response ForeignOrigin(const Request& request, std::string_view text);
  std::optional<Response> WhyNotPost(const Request& request);
  // The same for what is asked in somebody's name: JSON, and not too often.
  std::optional<Response> WhyNotAsk(const Request& request, const Identity& identity);
  Response TooMany(std::string_view text, std::chrono::milliseconds wait);
  Response FinishLogin(const std::string& name,
                       const std::string& password,
                       const Request& request);
  std::string SetCookie(std::string_view token, bool is_tls, std::int64_t seconds) const;
  void Tell(const ServerEvent& event);

  const ServerOptions& options_;
  const StaticFiles& files_;
  ConsoleSource& source_;
  AuthStore& auth_;
  const Clock& clock_;
  Counters& counters_;

  std::mutex mutex_;  // of the limits
  RateLimit logins_;
  RateLimit commands_;
  RateLimit events_;
};

std::string_view SessionCookie(bool is_tls);
std::string MeText(const Identity& identity);

}  // namespace tbm::hmi
