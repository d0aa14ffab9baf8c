#include "hmi_bridge/server/origin.h"

#include <algorithm>
#include <array>
#include <cctype>

#include "pose/base/parse_number.h"

namespace tbm::hmi {
namespace {

std::string Lower(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower;
}

bool IsPort(std::string_view text) {
  const auto port = ParseInteger(text);
  return port && text.front() != '+' && *port >= 1 && *port <= 65535;
}

}  // namespace

std::optional<std::string> HostName(std::string_view host) {
  std::string_view name = host;
  std::string_view rest;
  if (!host.empty() && host.front() == '[') {
    const std::size_t end = host.find(']');
    if (end == std::string_view::npos) return std::nullopt;
    name = host.substr(1, end - 1);
    rest = host.substr(end + 1);
    if (name.find_first_not_of("0123456789abcdefABCDEF:.") != std::string_view::npos) {
      return std::nullopt;
    }
  } else {
    const std::size_t colon = std::min(host.find(':'), host.size());
    name = host.substr(0, colon);
    rest = host.substr(colon);
    const auto is_fine = [](char c) {
      return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '.' || c == '_';
    };
    if (!std::all_of(name.begin(), name.end(), is_fine)) return std::nullopt;
  }
  if (name.empty() || name.size() > 253) return std::nullopt;
  if (!rest.empty() && (rest.front() != ':' || !IsPort(rest.substr(1)))) return std::nullopt;
  return Lower(name);
}

bool IsOurHost(const Request& request, const std::vector<std::string>& allowed_names) {
  if (!request.has_one_host) return false;
  const auto name = HostName(request.host);
  if (!name) return false;
  constexpr std::array<std::string_view, 3> kAlways = {"localhost", "127.0.0.1", "::1"};
  if (std::find(kAlways.begin(), kAlways.end(), *name) != kAlways.end()) return true;
  if (*name == request.peer.local_address) return true;
  return std::any_of(allowed_names.begin(), allowed_names.end(), [&](const std::string& allowed) {
    return Lower(allowed) == *name;
  });
}

bool IsOwnOrigin(const Request& request) {
  const std::string own = (request.peer.is_tls ? "https://" : "http://") + Lower(request.host);
  return request.has_origin && request.origin == own;
}

}  // namespace tbm::hmi
