#pragma once

#include <string>

#include "devices/sim/camera_view.h"
#include "devices/sim/world.h"
#include "pose/rig/rig.h"

namespace tbm::test {

// A machine with a small, cheap image for tests of the transport: five LEDs three metres away.
Rig SmallRig(int width_px = 320, int height_px = 256);

// The same as the text of a rig file.
std::string SmallRigYaml();

std::shared_ptr<const sim::World> SmallWorld(int width_px = 320, int height_px = 256);

// LEDs that reach 150 DN at 5 ms, and no hot pixels.
sim::ViewOptions PlainView();

}  // namespace tbm::test
