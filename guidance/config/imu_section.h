#pragma once

#include "devices/imu/stim_config.h"
#include "pose/rig/rig_yaml.h"

namespace tbm {

// A Sensonor unit's keys (devices/README.md), each with its fault. Only units that have
// accelerometers: without them there is no line.
void ReadImuSection(const YamlNode& node, StimConfig* config);

}  // namespace tbm
