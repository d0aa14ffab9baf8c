#include "pose/rig/dds_section.h"

#include <arpa/inet.h>
#include <fmt/format.h>

#include "pose/rig/yaml_section.h"

namespace tbm {

void ReadDdsSection(const YamlNode& node, DdsNetwork* network) {
  if (!IsSection(node)) return;
  YamlSection section(node);
  section.Integer("domain", 0, 232, &network->domain);
  section.Texts("interfaces", &network->interfaces);
  section.Texts("initial_peers", &network->initial_peers);
  section.RefuseOthers();
  if (network->interfaces.empty()) {
    node.Fault("interfaces: empty; name at least one address of this computer, e.g. [127.0.0.1]");
  }
  for (const auto* list : {&network->interfaces, &network->initial_peers}) {
    for (const std::string& address : *list) {
      in_addr parsed{};
      if (inet_pton(AF_INET, address.c_str(), &parsed) == 1) continue;
      node.Fault(fmt::format("'{}' is not an IPv4 address such as 127.0.0.1", address));
    }
  }
}

}  // namespace tbm
