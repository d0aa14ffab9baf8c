#pragma once

#include <memory>

#include "devices/bus/sleeper.h"
#include "devices/total_station/total_station.h"
#include "devices/total_station/total_station_config.h"
#include "pose/base/clock.h"

namespace tbm {

// The driver that the config names, not connected yet: a process starts without its instrument. The
// config must have passed CheckTotalStationConfig. Clock and sleeper must outlive the driver.
// Called from an app only.
std::unique_ptr<TotalStation> MakeTotalStation(const TotalStationConfig& config,
                                               const Clock& clock,
                                               Sleeper& sleeper);

}  // namespace tbm
