#include "hmi_bridge/server/server_options.h"

#include <array>

#include <arpa/inet.h>
#include <fmt/format.h>

#include "hmi_bridge/server/origin.h"
#include "hmi_bridge/server/static_files.h"
#include "hmi_bridge/server/tls_files.h"

namespace tbm::hmi {
namespace {

enum class Reach { kNone, kLoopback, kNetwork };

Reach ReachOf(const std::string& address) {
  in_addr v4 = {};
  if (inet_pton(AF_INET, address.c_str(), &v4) == 1) {
    return (ntohl(v4.s_addr) >> 24) == 127 ? Reach::kLoopback : Reach::kNetwork;
  }
  in6_addr v6 = {};
  if (inet_pton(AF_INET6, address.c_str(), &v6) != 1) return Reach::kNone;
  return IN6_IS_ADDR_LOOPBACK(&v6) ? Reach::kLoopback : Reach::kNetwork;
}

}  // namespace

std::string_view Word(ServerEvent::What what) {
  switch (what) {
    case ServerEvent::What::kLoggedIn:
      return "logged_in";
    case ServerEvent::What::kLoginWrong:
      return "login_wrong";
    case ServerEvent::What::kLoginLimited:
      return "login_limited";
    case ServerEvent::What::kLoggedOut:
      return "logged_out";
    case ServerEvent::What::kForeignOrigin:
      return "foreign_origin";
    case ServerEvent::What::kForeignHost:
      return "foreign_host";
    case ServerEvent::What::kStateFault:
      return "state_fault";
    case ServerEvent::What::kAcceptFault:
      return "accept_fault";
  }
  return "unknown";
}

std::vector<std::string> Problems(const ServerOptions& options, bool tls_follows) {
  std::vector<std::string> problems;
  if (options.listen.empty()) problems.emplace_back("there is no address to listen on");
  for (const ListenAddress& listen : options.listen) {
    const Reach reach = ReachOf(listen.address);
    if (reach == Reach::kNone) {
      problems.push_back(fmt::format(
          "listen address '{}' is no IPv4 or IPv6 address, such as 127.0.0.1", listen.address));
    }
    if (reach == Reach::kNetwork && !options.tls && !tls_follows) {
      problems.push_back(fmt::format(
          "listen address {} is reached from the network: passwords would cross it readable by "
          "everybody; give a certificate and key, or listen on 127.0.0.1",
          listen.address));
    }
  }
  for (const std::string& name : options.allowed_names) {
    const auto host = HostName(name);
    if (!host || name.find(':') != std::string::npos) {
      problems.push_back(
          fmt::format("allowed name '{}' is no host's name (without scheme and port)", name));
    }
  }
  if (options.tls) {
    if (const auto fault = WhyNotTls(*options.tls)) problems.push_back(*fault);
  }
  if (!options.web_folder.empty()) {
    const auto files = StaticFiles::Read(options.web_folder);
    if (!files) problems.push_back(files.error());
  }
  return problems;
}

}  // namespace tbm::hmi
