#pragma once

#include <functional>
#include <stop_token>

#include "pose/base/clock.h"

namespace tbm {

// Runs the process' main loop until SIGINT or SIGTERM, which HoldSignals has held since the start,
// or until it returns by itself, and tells systemd: with each call of `on_alive` that it lives, at
// the end that it stops.
using ServiceLoop =
    std::function<void(const std::stop_token& stop, const std::function<void()>& on_alive)>;
void RunService(const Clock& clock, const ServiceLoop& loop);

}  // namespace tbm
