#include "hmi_bridge/server/http_message.h"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include "hmi_bridge/server/json_text.h"
#include "pose/base/check.h"

namespace tbm::hmi {
namespace {

std::string_view Trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

bool SameWord(std::string_view one, std::string_view other) {
  return std::equal(one.begin(), one.end(), other.begin(), other.end(), [](char a, char b) {
    return std::tolower(static_cast<unsigned char>(a)) ==
           std::tolower(static_cast<unsigned char>(b));
  });
}

// Calls `take` for each piece between separators.
template <class Take>
void EachPiece(std::string_view list, char separator, Take take) {
  while (!list.empty()) {
    const std::size_t end = list.find(separator);
    take(Trimmed(list.substr(0, end)));
    if (end == std::string_view::npos) return;
    list.remove_prefix(end + 1);
  }
}

std::string_view Phrase(int status) {
  switch (status) {
    case 200:
      return "OK";
    case 202:
      return "Accepted";
    case 204:
      return "No Content";
    case 304:
      return "Not Modified";
    case 400:
      return "Bad Request";
    case 401:
      return "Unauthorized";
    case 403:
      return "Forbidden";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 413:
      return "Payload Too Large";
    case 415:
      return "Unsupported Media Type";
    case 421:
      return "Misdirected Request";
    case 426:
      return "Upgrade Required";
    case 429:
      return "Too Many Requests";
    case 431:
      return "Request Header Fields Too Large";
    case 503:
      return "Service Unavailable";
    default:
      return status < 500 ? "Refused" : "Failed";
  }
}

bool BreaksLine(std::string_view text) {
  return std::any_of(text.begin(), text.end(), [](char c) {
    return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
  });
}

}  // namespace

std::string_view Request::path() const {
  return std::string_view(target).substr(0, target.find('?'));
}

std::string_view Request::query() const {
  const std::size_t mark = target.find('?');
  return mark == std::string::npos ? std::string_view() : std::string_view(target).substr(mark + 1);
}

Response TextResponse(int status, std::string_view content_type, std::string text) {
  Response response;
  response.status = status;
  response.Set("Content-Type", std::string(content_type));
  response.Set("Cache-Control", "no-store");
  response.body = std::make_shared<const std::string>(std::move(text));
  return response;
}

Response ErrorResponse(int status, std::string_view code, std::string_view text) {
  return TextResponse(status,
                      "application/json",
                      fmt::format(R"({{"error":{},"text":{}}})", Quoted(code), Quoted(text)));
}

std::vector<std::pair<std::string_view, std::string_view>> SecurityHeaders(bool is_tls) {
  std::vector<std::pair<std::string_view, std::string_view>> headers = {
      {"Content-Security-Policy",
       "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
       "font-src 'self'; connect-src 'self'; media-src 'self' data:; manifest-src 'self'; "
       "frame-ancestors 'none'; base-uri 'none'; form-action 'self'"},
      {"X-Content-Type-Options", "nosniff"},
      {"X-Frame-Options", "DENY"},
      {"Referrer-Policy", "no-referrer"},
      {"Cross-Origin-Opener-Policy", "same-origin"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Permissions-Policy", "camera=(), geolocation=(), microphone=(), payment=(), usb=()"}};
  if (is_tls) headers.emplace_back("Strict-Transport-Security", "max-age=31536000");
  return headers;
}

std::string ResponseHead(const Response& response, bool is_tls, bool keeps_alive) {
  std::string head = fmt::format("HTTP/1.1 {} {}\r\n", response.status, Phrase(response.status));
  for (const auto& [name, value] : SecurityHeaders(is_tls)) {
    head += fmt::format("{}: {}\r\n", name, value);
  }
  for (const auto& [name, value] : response.headers) {
    if (!BreaksLine(name) && !BreaksLine(value)) head += fmt::format("{}: {}\r\n", name, value);
  }
  // These two have no body, and a length would be one of a body that is elsewhere.
  if (response.status != 204 && response.status != 304) {
    head += fmt::format("Content-Length: {}\r\n", response.body ? response.body->size() : 0);
  }
  head += keeps_alive ? "Connection: keep-alive\r\n\r\n" : "Connection: close\r\n\r\n";
  return head;
}

std::vector<std::string> CookieValues(std::string_view header, std::string_view name) {
  std::vector<std::string> values;
  EachPiece(header, ';', [&](std::string_view piece) {
    const std::size_t mark = piece.find('=');
    if (mark == std::string_view::npos || Trimmed(piece.substr(0, mark)) != name) return;
    if (values.size() < 4) values.emplace_back(Trimmed(piece.substr(mark + 1)));
  });
  return values;
}

std::string_view BearerToken(std::string_view header) {
  constexpr std::string_view kScheme = "Bearer ";
  if (header.size() <= kScheme.size() || !SameWord(header.substr(0, kScheme.size()), kScheme)) {
    return {};
  }
  return Trimmed(header.substr(kScheme.size()));
}

bool ListHolds(std::string_view header, std::string_view word) {
  bool holds = false;
  EachPiece(header, ',', [&](std::string_view piece) { holds = holds || piece == word; });
  return holds;
}

bool TakesGzip(std::string_view accept_encoding) {
  bool takes = false;
  EachPiece(accept_encoding, ',', [&](std::string_view piece) {
    const std::string_view coding = Trimmed(piece.substr(0, piece.find(';')));
    if (!SameWord(coding, "gzip")) return;
    // "q=0", "q=0.000": no.
    const std::size_t q = piece.find("q=");
    takes = q == std::string_view::npos ||
            piece.substr(q + 2).find_first_not_of("0. ") != std::string_view::npos;
  });
  return takes;
}

bool IsJson(std::string_view content_type) {
  return SameWord(Trimmed(content_type.substr(0, content_type.find(';'))), "application/json");
}

}  // namespace tbm::hmi
