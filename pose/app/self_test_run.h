#pragma once

#include "devices/bus/sleeper.h"
#include "pose/app/box_config.h"
#include "pose/base/clock.h"
#include "pose/rig/rig.h"

namespace tbm {

// `camera_box --self-test`: runs the box for `seconds` once its camera streams (waits 15 s for
// that), without recording and without its topics, tries DDS with one event on the box's own topic,
// and prints what was found. True when nothing is bad.
bool RunSelfTest(
    const BoxConfig& config, const Rig& rig, double seconds, const Clock& clock, Sleeper& sleeper);

}  // namespace tbm
