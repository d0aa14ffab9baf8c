#include "guidance/app/live_network.h"

#include <CLI/CLI.hpp>

namespace tbm {

void AddNetworkOptions(CLI::App& command, LiveNetwork& network) {
  command.add_option("--domain", network.domain_id, "DDS domain")
      ->check(CLI::Range(0, 232))
      ->capture_default_str();
  command.add_option(
      "--interface", network.interfaces, "address or name of a network interface; 127.0.0.1");
  command.add_option(
      "--peer", network.peers, "address of a machine to look for; none: by multicast");
}

std::optional<dds::ParticipantConfig> ParticipantOn(const LiveNetwork& network,
                                                    const std::string& name,
                                                    const Console& console) {
  dds::ParticipantConfig config;
  config.domain_id = network.domain_id;
  config.name = name;
  if (!network.interfaces.empty()) config.interfaces = network.interfaces;
  config.peers = network.peers;
  const auto problems = dds::Problems(config);
  for (const std::string& problem : problems) Complain(console, problem);
  if (!problems.empty()) return {};
  return config;
}

}  // namespace tbm
