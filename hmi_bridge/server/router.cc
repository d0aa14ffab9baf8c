#include "hmi_bridge/server/router.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "hmi_bridge/server/json_text.h"
#include "hmi_bridge/server/live_feed.h"
#include "hmi_bridge/server/origin.h"
#include "hmi_bridge/server/query.h"

namespace tbm::hmi {
namespace {

constexpr std::string_view kJson = "application/json";
constexpr std::string_view kLiveProtocol = "tbm.console.v1";
constexpr std::string_view kReportsPlace = "/api/reports";
constexpr std::string_view kReports = "/api/reports/";  // ID/NAME
constexpr std::size_t kMostNested = 8;
constexpr std::string_view kFoxgloveProtocol = "foxglove.websocket.v1";
// Somebody who fills the log fills the disk.
constexpr int kEventsAtOnce = 20;
constexpr std::chrono::milliseconds kEventPeriod(1000);

Response Refused(const ApiFault& fault) {
  return ErrorResponse(fault.http_status, fault.code, fault.text);
}

Response Answer(int status, const ApiAnswer& answer) {
  if (const auto* fault = std::get_if<ApiFault>(&answer)) return Refused(*fault);
  return TextResponse(status, kJson, std::get<std::string>(answer));
}

std::string ForLog(std::string_view typed) {
  std::string shown(typed.substr(0, 40));
  std::replace_if(
      shown.begin(),
      shown.end(),
      [](char c) { return static_cast<unsigned char>(c) <= 0x20 || c == '"' || c == 0x7f; },
      '?');
  return shown;
}

Response NothingHere() { return ErrorResponse(404, "not_found", "there is nothing of this name"); }

// One name, as it is: nothing that leads to another folder, nothing that is decoded.
bool IsFileName(std::string_view name) {
  constexpr std::string_view kFine =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";
  return !name.empty() && name.size() <= 100 && name.front() != '.' &&
         name.find_first_not_of(kFine) == std::string_view::npos;
}

Response UpgradeRequired(std::string_view protocol) {
  Response response = ErrorResponse(
      426, "bad_request", fmt::format("this is a WebSocket with subprotocol {}", protocol));
  response.Set("Upgrade", "websocket");
  return response;
}

}  // namespace

const Router::Place Router::kPlaces[] = {
    {"/api/login", "POST", &Router::Login},
    {"/api/logout", "POST", &Router::Logout},
    {"/api/me", "GET", &Router::Me},
    {"/api/snapshot", "GET", &Router::Snapshot},
    {"/api/history", "GET", &Router::History},
    {"/api/advance", "GET", &Router::Advance},
    {"/api/commands", "POST", &Router::Commands},
    {kReportsPlace, "POST", &Router::Reports},
    {"/api/openapi.yaml", "GET", &Router::OpenApi},
    {"/api/live", "GET", &Router::Live},
    {"/foxglove", "GET", &Router::Foxglove},
    {"/metrics", "GET", &Router::Metrics},
    {"/healthz", "GET", &Router::Health},
};

std::string_view SessionCookie(bool is_tls) {
  // The prefix binds the cookie to this very host and to TLS: no neighbour can set one.
  return is_tls ? "__Host-tbm_session" : "tbm_session";
}

std::string MeText(const Identity& identity) {
  return fmt::format(R"({{"name":{},"role":"{}","expires_at_utc_ms":{}}})",
                     Quoted(identity.name),
                     Word(identity.role),
                     identity.expires_at_utc_ms);
}

Router::Router(const ServerOptions& options,
               const StaticFiles& files,
               ConsoleSource& source,
               AuthStore& auth,
               const Clock& clock,
               Counters& counters)
    : options_(options),
      files_(files),
      source_(source),
      auth_(auth),
      clock_(clock),
      counters_(counters),
      logins_(options.limits.logins_at_once, options.limits.login_period),
      commands_(options.limits.commands_at_once, options.limits.command_period),
      events_(kEventsAtOnce, kEventPeriod) {}

Routed Router::Route(const Request& request) {
  ++counters_.requests;
  if (!IsOurHost(request, options_.allowed_names)) {
    counters_.Refuse(Refusal::kForeignHost);
    Tell({ServerEvent::What::kForeignHost, "", request.peer.address, ForLog(request.host)});
    Response response =
        ErrorResponse(421, "forbidden", "this name is not one of this console's (allowed names)");
    response.must_close = true;
    return response;
  }
  // Nobody needs a body in pieces, and two opinions on where it ends are a way past a proxy.
  if (request.has_transfer_encoding) {
    counters_.Refuse(Refusal::kMalformed);
    Response response = ErrorResponse(400, "bad_request", "Transfer-Encoding is not taken");
    response.must_close = true;
    return response;
  }
  const bool is_get = request.method == "GET" || request.method == "HEAD";
  for (const Place& place : kPlaces) {
    if (request.path() != place.path) continue;
    if (place.method == (is_get ? "GET" : request.method)) return (this->*place.handler)(request);
    Response response = ErrorResponse(
        405, "bad_request", fmt::format("{} is asked with {}", place.path, place.method));
    response.Set("Allow", place.method == "GET" ? "GET, HEAD" : std::string(place.method));
    return response;
  }
  if (is_get && request.path().starts_with(kReports)) return ReportFile(request);
  if (auto file = files_.Answer(request)) {
    if (is_get) return *std::move(file);
    Response response = ErrorResponse(405, "bad_request", "a file is asked with GET");
    response.Set("Allow", "GET, HEAD");
    return response;
  }
  return NothingHere();
}

Response Router::Busy() {
  counters_.Refuse(Refusal::kBusy);
  Response response = ErrorResponse(503, "too_many", "too much at once; again in a few seconds");
  response.Set("Retry-After", "5");
  return response;
}

void Router::Tell(const ServerEvent& event) {
  {
    const std::lock_guard lock(mutex_);
    if (events_.Take(std::string(Word(event.what)), clock_.Steady())) return;
  }
  if (options_.on_event) options_.on_event(event);
}

std::optional<Identity> Router::Who(const Request& request) {
  if (!request.authorization.empty()) {
    return auth_.OfReadToken(BearerToken(request.authorization));
  }
  for (const std::string& token :
       CookieValues(request.cookie, SessionCookie(request.peer.is_tls))) {
    if (auto identity = auth_.OfSession(token)) return identity;
  }
  return std::nullopt;
}

Response Router::NotLoggedIn() {
  counters_.Refuse(Refusal::kNotLoggedIn);
  return ErrorResponse(401, "not_logged_in", "log in first");
}

Response Router::ForeignOrigin(const Request& request, std::string_view text) {
  counters_.Refuse(Refusal::kForeignOrigin);
  Tell({ServerEvent::What::kForeignOrigin, "", request.peer.address, ForLog(request.origin)});
  return ErrorResponse(403, "forbidden", text);
}

std::optional<Response> Router::WhyNotPost(const Request& request) {
  const bool is_own =
      request.has_origin ? IsOwnOrigin(request) : request.fetch_site == "same-origin";
  if (!is_own) return ForeignOrigin(request, "only this console's own page may ask for this");
  return std::nullopt;
}

Response Router::TooMany(std::string_view text, std::chrono::milliseconds wait) {
  counters_.Refuse(Refusal::kRateLimit);
  Response response = ErrorResponse(429, "too_many", text);
  response.Set("Retry-After",
               fmt::format("{}", std::chrono::ceil<std::chrono::seconds>(wait).count()));
  return response;
}

std::string Router::SetCookie(std::string_view token, bool is_tls, std::int64_t seconds) const {
  return fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict; Max-Age={}{}",
                     SessionCookie(is_tls),
                     token,
                     seconds,
                     is_tls ? "; Secure" : "");
}

Routed Router::Login(const Request& request) {
  if (auto refusal = WhyNotPost(request)) return *std::move(refusal);
  if (!IsJson(request.content_type)) {
    return ErrorResponse(415, "bad_request", "the body must be application/json");
  }
  const auto login = ParseLogin(request.body);
  if (!login) return Refused(login.error());
  const std::string by_address = "address " + RateKey(request.peer.address);
  const std::string by_name = "name " + login->name.substr(0, 40);
  std::optional<std::chrono::milliseconds> wait;
  {
    const std::lock_guard lock(mutex_);
    wait = logins_.Take(by_address, clock_.Steady());
    if (!wait) {
      wait = logins_.Take(by_name, clock_.Steady());
      if (wait) logins_.GiveBack(by_address);
    }
  }
  if (wait) {
    Tell({ServerEvent::What::kLoginLimited, ForLog(login->name), request.peer.address, ""});
    return TooMany("too many log-ins tried; wait", *wait);
  }
  return Later{Later::Where::kHashing, [this, login = *login, request, by_address, by_name] {
                 Response response = FinishLogin(login.name, login.password, request);
                 if (response.status == 200) {
                   const std::lock_guard lock(mutex_);
                   logins_.GiveBack(by_address);
                   logins_.GiveBack(by_name);
                 }
                 return response;
               }};
}

Response Router::FinishLogin(const std::string& name,
                             const std::string& password,
                             const Request& request) {
  const auto opened = auth_.LogIn(name, password);
  if (!opened) {
    Tell({ServerEvent::What::kStateFault, ForLog(name), request.peer.address, opened.error()});
    return ErrorResponse(503, "cannot_send", "the bridge cannot keep a session: see its log");
  }
  if (!opened->has_value()) {
    ++counters_.logins_wrong;
    Tell({ServerEvent::What::kLoginWrong, ForLog(name), request.peer.address, ""});
    return ErrorResponse(401, "wrong_password", "name or password is wrong");
  }
  ++counters_.logins_good;
  Tell({ServerEvent::What::kLoggedIn, ForLog(name), request.peer.address, ""});
  // Who logs in anew leaves the session that the browser had.
  for (const std::string& token :
       CookieValues(request.cookie, SessionCookie(request.peer.is_tls))) {
    if (const auto old = auth_.OfSession(token)) auth_.LogOut(old->token_sha256);
  }
  constexpr std::int64_t kWeek_s = 7 * 24 * 3600;
  Response response = TextResponse(200, kJson, MeText((*opened)->identity));
  response.Set("Set-Cookie", SetCookie((*opened)->token, request.peer.is_tls, kWeek_s));
  return response;
}

Routed Router::Logout(const Request& request) {
  if (auto refusal = WhyNotPost(request)) return *std::move(refusal);
  return Later{Later::Where::kWriting, [this, request] {
                 Response response;
                 response.status = 204;
                 for (const std::string& token :
                      CookieValues(request.cookie, SessionCookie(request.peer.is_tls))) {
                   const auto identity = auth_.OfSession(token);
                   if (!identity) continue;
                   const auto fault = auth_.LogOut(identity->token_sha256);
                   Tell({fault ? ServerEvent::What::kStateFault : ServerEvent::What::kLoggedOut,
                         identity->name,
                         request.peer.address,
                         fault.value_or("")});
                 }
                 response.Set("Set-Cookie", SetCookie("", request.peer.is_tls, 0));
                 response.Set("Cache-Control", "no-store");
                 return response;
               }};
}

Routed Router::Me(const Request& request) {
  const auto identity = Who(request);
  if (!identity) return NotLoggedIn();
  return TextResponse(200, kJson, MeText(*identity));
}

Routed Router::Snapshot(const Request& request) {
  if (!Who(request)) return NotLoggedIn();
  LiveFeed feed;
  return TextResponse(200, kJson, feed.Next(source_.Now()));
}

Routed Router::History(const Request& request) {
  if (!Who(request)) return NotLoggedIn();
  const auto question = ParseHistoryQuestion(request.query());
  if (!question) return Refused(question.error());
  return Answer(200, source_.History(*question));
}

Routed Router::Advance(const Request& request) {
  if (!Who(request)) return NotLoggedIn();
  const auto question = ParseAdvanceQuestion(request.query());
  if (!question) return Refused(question.error());
  return Answer(200, source_.Advance(*question));
}

std::optional<Response> Router::WhyNotAsk(const Request& request, const Identity& identity) {
  if (auto refusal = WhyNotPost(request)) return refusal;
  if (!IsJson(request.content_type)) {
    return ErrorResponse(415, "bad_request", "the body must be application/json");
  }
  if (NestsDeeperThan(request.body, kMostNested)) {
    return ErrorResponse(400, "bad_request", "the body is nested too deeply");
  }
  std::optional<std::chrono::milliseconds> wait;
  {
    const std::lock_guard lock(mutex_);
    wait = commands_.Take(identity.name, clock_.Steady());
  }
  if (wait) return TooMany("too many commands; wait", *wait);
  return std::nullopt;
}

Routed Router::Commands(const Request& request) {
  const auto identity = Who(request);
  if (!identity) return NotLoggedIn();
  if (auto refusal = WhyNotAsk(request, *identity)) return *std::move(refusal);
  const auto command = ParseCommand(request.body);
  if (!command) return Refused(command.error());
  return Later{Later::Where::kWriting, [this, command = *command, identity = *identity] {
                 Response response =
                     Answer(202, source_.Ask(command, identity.name, identity.role));
                 if (response.status == 403) counters_.Refuse(Refusal::kRole);
                 return response;
               }};
}

Routed Router::Reports(const Request& request) {
  const auto identity = Who(request);
  if (!identity) return NotLoggedIn();
  if (auto refusal = WhyNotAsk(request, *identity)) return *std::move(refusal);
  return Later{Later::Where::kWriting, [this, body = request.body, identity = *identity] {
                 Response response =
                     Answer(202, source_.StartReport(body, identity.name, identity.role));
                 if (response.status == 403) counters_.Refuse(Refusal::kRole);
                 return response;
               }};
}

Routed Router::ReportFile(const Request& request) {
  if (!Who(request)) return NotLoggedIn();
  const std::string_view rest = request.path().substr(kReports.size());
  const std::size_t slash = rest.find('/');
  const std::string_view id = rest.substr(0, slash);
  const std::string_view name = slash == std::string_view::npos ? "" : rest.substr(slash + 1);
  if (!IsFileName(id) || !IsFileName(name)) return NothingHere();
  return Later{Later::Where::kWriting, [this, id = std::string(id), name = std::string(name)] {
                 auto file = source_.ReportFile(id, name);
                 if (file == nullptr) return NothingHere();
                 Response response;
                 response.Set("Content-Type", std::string(ContentTypeOf(name)));
                 response.Set("Content-Disposition",
                              name.ends_with(".png") ? "inline" : "attachment");
                 response.Set("Cache-Control", "no-store");
                 response.body = std::move(file);
                 return response;
               }};
}

std::size_t Router::BodyLimit(const Request& head) {
  const ServerLimits& limits = options_.limits;
  const bool is_report = head.method == "POST" && head.path() == kReportsPlace && Who(head);
  return is_report ? std::max(limits.report_bytes, limits.body_bytes) : limits.body_bytes;
}

Routed Router::OpenApi(const Request&) {
  return TextResponse(200, "application/yaml", options_.openapi_text);
}

Routed Router::Metrics(const Request& request) {
  if (!Who(request)) return NotLoggedIn();
  return TextResponse(
      200, "text/plain; version=0.0.4; charset=utf-8", source_.Metrics() + counters_.Text());
}

Routed Router::Health(const Request&) { return TextResponse(200, "text/plain", "ok"); }

Routed Router::Live(const Request& request) {
  const bool is_token = !request.authorization.empty();
  if (request.has_origin ? !IsOwnOrigin(request) : !is_token) {
    return ForeignOrigin(request, "only this console's own page may listen with a cookie");
  }
  const auto identity = Who(request);
  if (!identity) return NotLoggedIn();
  if (!request.is_upgrade || !ListHolds(request.subprotocols, kLiveProtocol)) {
    return UpgradeRequired(kLiveProtocol);
  }
  return Upgrade{Upgrade::To::kLive, *identity};
}

Routed Router::Foxglove(const Request& request) {
  const auto query = Query::Parse(request.query());
  if (!query) return Refused(query.error());
  if (const auto fault = query->OnlyThese({"token"})) return Refused(*fault);
  const std::string* token = query->Find("token");
  const bool is_token = token != nullptr || !request.authorization.empty();
  // A token in hand is the proof; a cookie is sent along by whoever makes the browser ask.
  if (!is_token && !IsOwnOrigin(request)) {
    return ForeignOrigin(request, "from elsewhere this needs a read token");
  }
  const auto identity = token != nullptr ? auth_.OfReadToken(*token) : Who(request);
  if (!identity) return NotLoggedIn();
  if (!request.is_upgrade || !ListHolds(request.subprotocols, kFoxgloveProtocol)) {
    return UpgradeRequired(kFoxgloveProtocol);
  }
  return Upgrade{Upgrade::To::kFoxglove, *identity};
}

}  // namespace tbm::hmi
