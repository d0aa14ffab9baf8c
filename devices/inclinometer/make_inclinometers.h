#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "devices/bus/sleeper.h"
#include "devices/inclinometer/inclinometer.h"
#include "devices/inclinometer/inclinometer_config.h"
#include "devices/inclinometer/sim_inclinometer.h"
#include "pose/base/clock.h"

namespace tbm {

// What `sim` and `replay` need instead of a port, by the instrument's name.
struct InclinometerSources {
  std::map<std::string, TiltTruth> truths;
  std::uint64_t seed = 1;
  std::map<std::string, std::vector<TiltSample>> recordings;
  Timestamp replay_start;
  double replay_speed = 1.0;
};

// One driver for each config, in their order. Opens nothing yet: that is the first Read's, so a
// process starts without its instruments. Configs must be free of FindFaults and FindSharingFaults,
// and sources must name every `sim` and `replay`. Clock and sleeper must outlive the drivers. Each
// driver may have its own thread, also those that share a wire. Called from an app only.
std::vector<std::unique_ptr<Inclinometer>> MakeInclinometers(
    std::span<const InclinometerConfig> configs,
    const InclinometerSources& sources,
    const Clock& clock,
    Sleeper& sleeper);

}  // namespace tbm
