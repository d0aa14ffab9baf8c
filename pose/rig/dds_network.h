#pragma once

#include <string>
#include <vector>

namespace tbm {

// How a process speaks DDS, as its configuration says it. Mirrors idl/cpp's options, so that a
// configuration is readable without DDS.
struct DdsNetwork {
  int domain = 25;
  std::vector<std::string> interfaces = {"127.0.0.1"};  // IPv4 addresses; nothing else is used
  std::vector<std::string> initial_peers;               // for networks without multicast
};

}  // namespace tbm
