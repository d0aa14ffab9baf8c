#include "guidance/app/live_network.h"

namespace tbm {

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
