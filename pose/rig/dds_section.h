#pragma once

#include "pose/rig/dds_network.h"
#include "pose/rig/rig_yaml.h"

namespace tbm {

// The section `dds`: domain, interfaces, initial_peers.
void ReadDdsSection(const YamlNode& node, DdsNetwork* network);

}  // namespace tbm
