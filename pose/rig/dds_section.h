#pragma once

#include <string>
#include <vector>

#include "pose/rig/rig_yaml.h"

namespace tbm {

// How a process speaks DDS, as its configuration says it. Mirrors idl/cpp's options, so that a
// configuration is readable without DDS.
struct DdsNetwork {
  int domain = 25;
  std::vector<std::string> interfaces = {"127.0.0.1"};  // IPv4 addresses; nothing else is used
  std::vector<std::string> initial_peers;               // for networks without multicast
};

// The section `dds`: domain, interfaces, initial_peers.
void ReadDdsSection(const YamlNode& node, DdsNetwork* network);

}  // namespace tbm
