#pragma once

#include <optional>
#include <string>
#include <vector>

#include "guidance/app/console.h"
#include "idl/cpp/participant.h"

namespace tbm {

// Where a command meets the live system.
struct LiveNetwork {
  int domain_id = 25;
  std::vector<std::string> interfaces;  // empty: 127.0.0.1
  std::vector<std::string> peers;       // empty: by multicast
};

// How a participant of this name takes part. Empty after complaining of what cannot be.
std::optional<dds::ParticipantConfig> ParticipantOn(const LiveNetwork& network,
                                                    const std::string& name,
                                                    const Console& console);

}  // namespace tbm
