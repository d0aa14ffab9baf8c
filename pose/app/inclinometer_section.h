#pragma once

#include "devices/inclinometer/inclinometer_config.h"
#include "pose/rig/rig_yaml.h"

namespace tbm {

// One inclinometer's keys, each with its fault; those between several are the caller's
// (FindSharingFaults).
void ReadInclinometerSection(const YamlNode& node, InclinometerConfig* config);

}  // namespace tbm
