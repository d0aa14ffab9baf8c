#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "pose/base/result.h"
#include "pose/calibrate/target_calibration.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

// Where the board stood in one placement, from its LEDs' nominal places alone: site_from_target.
// Which placement that is the caller knows: failures say 0.
// What does not fit within `most_off_m` is looked into: names exchanged (all orders of up to seven
// LEDs are tried, pairs of more), a mirror image, one LED alone, another board. An exchange that is
// a turn of the whole board cannot be seen.
Result<Rigid3, TargetCalibrationFailure> StartTarget(
    std::span<const Eigen::Vector3d> nominal_m,
    std::span<const std::optional<Eigen::Vector3d>> led_in_site_m,
    double most_off_m);

}  // namespace tbm
