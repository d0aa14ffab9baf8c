#include "hmi_bridge/server/counters.h"

#include <string_view>

#include <fmt/format.h>

namespace tbm::hmi {
namespace {

constexpr std::array<std::string_view, kRefusals> kWords = {"too_many_connections",
                                                            "timeout",
                                                            "malformed",
                                                            "foreign_host",
                                                            "foreign_origin",
                                                            "not_logged_in",
                                                            "role",
                                                            "rate_limit",
                                                            "busy",
                                                            "tls"};

}  // namespace

std::string Counters::Text() const {
  std::string text;
  const auto head = [&text](std::string_view name, std::string_view type, std::string_view help) {
    text += fmt::format("# HELP {0} {2}\n# TYPE {0} {1}\n", name, type, help);
  };
  const auto put =
      [&](std::string_view name, std::string_view type, std::string_view help, auto value) {
        head(name, type, help);
        text += fmt::format("{} {}\n", name, value);
      };
  put("tbm_hmi_connections", "gauge", "TCP connections that are open", connections.load());
  head("tbm_hmi_clients", "gauge", "WebSocket clients");
  text += fmt::format("tbm_hmi_clients{{kind=\"live\"}} {}\n", live_clients.load());
  text += fmt::format("tbm_hmi_clients{{kind=\"foxglove\"}} {}\n", foxglove_clients.load());
  put("tbm_hmi_requests_total", "counter", "HTTP requests", requests.load());
  head("tbm_hmi_messages_total", "counter", "WebSocket messages sent");
  text += fmt::format("tbm_hmi_messages_total{{kind=\"live\"}} {}\n", live_messages.load());
  text += fmt::format("tbm_hmi_messages_total{{kind=\"foxglove\"}} {}\n", foxglove_messages.load());
  head("tbm_hmi_sent_bytes_total", "counter", "bytes of WebSocket messages sent");
  text += fmt::format("tbm_hmi_sent_bytes_total{{kind=\"live\"}} {}\n", live_bytes.load());
  text += fmt::format("tbm_hmi_sent_bytes_total{{kind=\"foxglove\"}} {}\n", foxglove_bytes.load());
  put("tbm_hmi_foxglove_dropped_total",
      "counter",
      "samples dropped because a tool was slow",
      foxglove_dropped.load());
  head("tbm_hmi_logins_total", "counter", "log-ins tried");
  text += fmt::format("tbm_hmi_logins_total{{outcome=\"good\"}} {}\n", logins_good.load());
  text += fmt::format("tbm_hmi_logins_total{{outcome=\"wrong\"}} {}\n", logins_wrong.load());
  head("tbm_hmi_refused_total", "counter", "requests and connections refused");
  for (std::size_t i = 0; i < kRefusals; ++i) {
    text +=
        fmt::format("tbm_hmi_refused_total{{reason=\"{}\"}} {}\n", kWords[i], refused[i].load());
  }
  return text;
}

}  // namespace tbm::hmi
