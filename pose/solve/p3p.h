#pragma once

#include <array>

#include <Eigen/Core>

#include "pose/base/fixed_vector.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

using P3pPoses = FixedVector<Rigid3, 4>;

// Every pose from which three known points appear in three known directions, all of them in front.
// `bearings` in `camera`, any positive length; `points` in `target` [m]. Up to four poses, in no
// particular order; none when the points stand on one line or no pose exists. Where two poses merge
// (the danger cylinder) half the digits go. Method and source: pose/docs/pose_from_leds.md, "P3P".
P3pPoses SolveP3p(const std::array<Eigen::Vector3d, 3>& bearings,
                  const std::array<Eigen::Vector3d, 3>& points);

}  // namespace tbm
