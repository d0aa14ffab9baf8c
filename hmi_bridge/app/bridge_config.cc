#include "hmi_bridge/app/bridge_config.h"

#include <chrono>
#include <cstdint>
#include <optional>

#include <arpa/inet.h>
#include <fmt/format.h>

#include "pose/base/parse_number.h"
#include "pose/rig/dds_section.h"
#include "pose/rig/rig_yaml.h"
#include "pose/rig/yaml_section.h"

namespace tbm::hmi {
namespace {

// "127.0.0.1:8080", "[::1]:8080".
std::optional<ListenAddress> AddressOf(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos) return {};
  const auto port = ParseInteger(std::string_view(text).substr(colon + 1));
  if (!port || *port < 0 || *port > 65535) return {};
  ListenAddress listen{text.substr(0, colon), static_cast<std::uint16_t>(*port)};
  in_addr v4{};
  if (inet_pton(AF_INET, listen.address.c_str(), &v4) == 1) return listen;
  if (listen.address.size() < 2 || listen.address.front() != '[' || listen.address.back() != ']') {
    return {};
  }
  listen.address = listen.address.substr(1, listen.address.size() - 2);
  in6_addr v6{};
  if (inet_pton(AF_INET6, listen.address.c_str(), &v6) != 1) return {};
  return listen;
}

void ReadListen(YamlSection& section, const YamlNode& root, BridgeConfig* config) {
  std::vector<std::string> texts;
  for (const ListenAddress& listen : config->listen) {
    texts.push_back(fmt::format("{}:{}", listen.address, listen.port));
  }
  section.Texts("listen", &texts);
  config->listen.clear();
  for (const std::string& text : texts) {
    if (const auto listen = AddressOf(text)) {
      config->listen.push_back(*listen);
    } else {
      root.Fault(fmt::format(
          "listen: '{}' is no address and port, such as 127.0.0.1:8080 or [::1]:8080", text));
    }
  }
  if (texts.empty()) root.Fault("listen: empty; name at least one, such as [127.0.0.1:8080]");
}

void ReadTls(const YamlNode& node, const std::string& file, BridgeConfig* config) {
  if (!IsSection(node)) return;
  YamlSection section(node);
  section.Flag("self_signed", &config->tls_self_signed);
  section.Text("certificate", &config->tls_certificate_file);
  section.Text("key", &config->tls_key_file);
  section.RefuseOthers();
  config->tls_certificate_file = BesideFile(file, config->tls_certificate_file);
  config->tls_key_file = BesideFile(file, config->tls_key_file);
  if (config->tls_certificate_file.empty() != config->tls_key_file.empty()) {
    node.Fault("certificate and key belong together: give both files, or none");
  }
  if (config->tls_self_signed && !config->tls_certificate_file.empty()) {
    node.Fault("self_signed: true and a certificate: one of them");
  }
}

// A day as "2026-05-01": its first moment, UTC.
std::optional<Timestamp> DayOf(const std::string& text) {
  using namespace std::chrono;
  if (text.size() != 10 || text[4] != '-' || text[7] != '-') return {};
  const auto number = [&](std::size_t at, std::size_t size) {
    return ParseInteger(std::string_view(text).substr(at, size));
  };
  const auto y = number(0, 4);
  const auto m = number(5, 2);
  const auto d = number(8, 2);
  if (!y || !m || !d || *y < 2000 || *y > 2100 || *m < 1 || *d < 1) return {};
  const year_month_day date(
      year(static_cast<int>(*y)), month(static_cast<unsigned>(*m)), day(static_cast<unsigned>(*d)));
  if (!date.ok()) return {};
  return Timestamp{duration_cast<Duration>(sys_days(date).time_since_epoch()).count()};
}

void ReadCalibrations(const YamlNode& node, BridgeConfig* config) {
  if (!node.exists()) return;
  if (!node.IsList()) {
    node.Fault("is no list, such as [{what: camera, done_on: 2026-05-01, valid_days: 365}]");
    return;
  }
  for (const YamlNode& item : node.Items()) {
    if (!IsSection(item)) continue;
    YamlSection section(item);
    Calibration calibration;
    calibration.what =
        section.Require("what", "what is calibrated, e.g. camera").Text().value_or("");
    const YamlNode done_on = section.Require("done_on", "a day such as 2026-05-01");
    int valid_days = 365;
    section.Integer("valid_days", 1, 3660, &valid_days);
    section.RefuseOthers();
    const auto text = done_on.Text();
    const auto day = text ? DayOf(*text) : std::nullopt;
    if (text && !day) done_on.Fault(fmt::format("'{}' is no day such as 2026-05-01", *text));
    if (!day) continue;
    calibration.done_at = *day;
    calibration.due_at = *day + std::chrono::hours(24 * valid_days);
    config->calibrations.push_back(calibration);
  }
}

BridgeConfig Read(const YamlNode& root, const std::string& file) {
  BridgeConfig config;
  if (!root.IsMap()) {
    root.Fault("is not a map; hmi_bridge/app/example/hmi_bridge.yaml shows what belongs here");
    return config;
  }
  YamlSection section(root);
  if (const auto machine =
          section.Require("machine", "path of the machine file, e.g. machine.yaml").Text()) {
    config.machine_file = BesideFile(file, *machine);
  }
  if (const auto state =
          section.Require("state", "a folder for accounts and the audit log, e.g. console")
              .Text()) {
    config.state_folder = BesideFile(file, *state);
  }
  ReadListen(section, root, &config);
  section.Texts("names", &config.names);
  ReadTls(section.Know("tls"), file, &config);
  section.Text("web", &config.web_folder);
  config.web_folder = BesideFile(file, config.web_folder);
  section.Text("journal", &config.journal_folder);
  config.journal_folder = BesideFile(file, config.journal_folder);
  ReadCalibrations(section.Know("calibrations"), &config);
  ReadDdsSection(section.Know("dds"), &config.dds);
  section.RefuseOthers();
  return config;
}

}  // namespace

Result<BridgeConfig, RigFileFaults> ParseBridgeConfig(std::string_view yaml,
                                                      const std::string& file) {
  return ReadYaml(yaml, file, [&](const YamlNode& root) { return Read(root, file); });
}

Result<BridgeConfig, RigFileFaults> LoadBridgeConfig(const std::string& path) {
  const auto text = ReadConfigText(path, "hmi_bridge.yaml");
  if (!text) return Failure{text.error()};
  return ParseBridgeConfig(*text, path);
}

}  // namespace tbm::hmi
