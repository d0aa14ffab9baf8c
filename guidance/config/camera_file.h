#pragma once

#include <string>
#include <string_view>

#include "pose/rig/rig_file.h"

namespace tbm {

// The camera alone out of a file: a rig file, the camera part of one, or a camera_info file of ROS
// that has the same keys without `camera:` around them. Other keys are passed over. All faults are
// collected.
Result<CameraModel, RigFileFaults> ParseCameraFile(std::string_view yaml, const std::string& file);
Result<CameraModel, RigFileFaults> LoadCameraFile(const std::string& path);

}  // namespace tbm
