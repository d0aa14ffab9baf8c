#pragma once

#include <cstdint>

#include "tests/guidance/rail_vision/scene_picture.h"

namespace tbm::test {

// 640 x 480, looking at about 0.4 x 0.3 m from half a metre above.
CameraModel GroundCamera();

// world_from_camera of one that looks straight down: the image's upper edge lies to the world's x.
Eigen::Quaterniond LookingDown();

// Ballast: grains of all sizes at the height 0, 20 m around the origin.
Patch GroundPatch(std::uint64_t seed);

}  // namespace tbm::test
