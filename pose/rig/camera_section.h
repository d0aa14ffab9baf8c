#pragma once

#include <functional>
#include <set>
#include <string_view>

#include "pose/geometry/camera_model.h"
#include "pose/rig/rig_yaml.h"

namespace tbm {

// Told of each map with the keys that are known in it, for whoever warns of the others.
using KnownKeys = std::function<void(const YamlNode& map, const std::set<std::string_view>& known)>;

// Image size, matrix and distortion of a camera in the layout of ROS' camera_info, which is that of
// OpenCV's calibration files too. True when `model` is whole and can be inverted over the image;
// what is wrong stands in the node's list of faults.
bool ReadCameraModel(const YamlNode& camera, const KnownKeys& known, CameraModel* model);

}  // namespace tbm
