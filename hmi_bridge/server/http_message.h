#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tbm::hmi {

// Who is at the other end, and by which way he came.
struct Peer {
  std::string address;
  std::string local_address;  // of ours, which he has connected to
  bool is_loopback = false;
  bool is_tls = false;
};

// What of a request decides anything. A header that was not sent is empty.
struct Request {
  std::string method;
  std::string target;
  bool is_upgrade = false;  // asks for a WebSocket
  bool is_keep_alive = false;
  bool has_one_host = true;  // two would be two opinions
  bool has_transfer_encoding = false;
  std::string host;
  std::string origin;
  bool has_origin = false;
  std::string cookie;
  std::string authorization;
  std::string content_type;
  std::string accept_encoding;
  std::string if_none_match;
  std::string fetch_site;    // Sec-Fetch-Site
  std::string subprotocols;  // Sec-WebSocket-Protocol
  std::string body;
  Peer peer;

  std::string_view path() const;
  std::string_view query() const;  // without '?'
};

struct Response {
  int status = 200;
  std::vector<std::pair<std::string, std::string>> headers;
  std::shared_ptr<const std::string> body;  // null: empty
  bool must_close = false;

  void Set(std::string name, std::string value) {
    headers.emplace_back(std::move(name), std::move(value));
  }
};

Response TextResponse(int status, std::string_view content_type, std::string text);
// openapi.yaml, `Error`.
Response ErrorResponse(int status, std::string_view code, std::string_view text);

// The lines before the body, with what every answer says. Of a header that would break a line
// nothing is sent.
std::string ResponseHead(const Response& response, bool is_tls, bool keeps_alive);
// What every answer says about security, WebSocket's answer included.
std::vector<std::pair<std::string_view, std::string_view>> SecurityHeaders(bool is_tls);

// The first value of a cookie's name is the most specific one, but whoever serves another port of
// this host may have set it: all are told.
std::vector<std::string> CookieValues(std::string_view header, std::string_view name);
// Of `Authorization: Bearer TOKEN`; empty without.
std::string_view BearerToken(std::string_view header);
// Whether a list of words with commas holds it.
bool ListHolds(std::string_view header, std::string_view word);
bool TakesGzip(std::string_view accept_encoding);
bool IsJson(std::string_view content_type);

}  // namespace tbm::hmi
