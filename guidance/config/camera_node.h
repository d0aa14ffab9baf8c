#pragma once

#include "pose/rig/rig_yaml.h"

namespace tbm {

// The map with image_width, camera_matrix, ..: the member `camera` of a rig file or of a part of
// one, or the whole of a camera_info file. Where there is none, that is a fault and it does not
// exist.
YamlNode CameraNodeOf(const YamlNode& root);

}  // namespace tbm
