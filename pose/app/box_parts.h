#pragma once

#include <string>

#include "devices/bus/sleeper.h"
#include "pose/app/box_config.h"
#include "pose/app/camera_box.h"
#include "pose/base/clock.h"
#include "pose/rig/rig.h"

namespace tbm {

// From the configuration to what main and the self-test run.

// SHA-256 in hexadecimal: what `sha256sum rig.yaml` prints.
std::string HashOf(const std::string& text);

// The devices and the recorder that the configuration names. `rig_yaml` is the rig file's text, for
// the recordings. Clock and sleeper outlive the parts.
BoxParts MakeParts(const BoxConfig& config,
                   const Rig& rig,
                   const std::string& rig_yaml,
                   const Clock& clock,
                   Sleeper& sleeper);

}  // namespace tbm
