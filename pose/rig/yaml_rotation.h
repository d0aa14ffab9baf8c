#pragma once

#include <optional>

#include <Eigen/Core>

#include "pose/rig/rig_yaml.h"

namespace tbm {

// Nine numbers row by row as the nearest rotation. Empty, and a fault, where they are none.
std::optional<Eigen::Matrix3d> RotationOf(const YamlNode& node);

}  // namespace tbm
