#pragma once

#include <string>

#include "pose/base/time.h"

namespace tbm::hmi {

// Until when something that was calibrated is good: the site's own rule, not a measurement.
struct Calibration {
  std::string what;
  Timestamp done_at;
  Timestamp due_at;
};

}  // namespace tbm::hmi
