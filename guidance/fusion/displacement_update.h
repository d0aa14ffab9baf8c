#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "guidance/fusion/fusion_filter.h"

namespace tbm {

// How far the ground went by between two images of a camera that looks down on it (patent
// CN106052584, steps 2 and 3). Frame `vehicle`: x along the rail, y left, z up.
struct ImageDisplacement {
  Eigen::Vector2d told_m = Eigen::Vector2d::Zero();  // in vehicle x and y, by the assumed height
  double span_s = 0.0;                               // between the images, > 0
  double sigma_m = 0.0;                              // of each, > 0
};

// Takes it as the mean velocity over the span (docs/filter.md, "Image displacement"). `at_first`:
// the motion at the first image, as the filter had it then; the filter stands at the second. True
// displacement over told one is one plus the state's image scale: height is never known well
// enough.
FusionVerdict UpdateByImageDisplacement(FusionFilter& filter,
                                        const Eigen::Quaterniond& vehicle_from_imu,
                                        const Motion& at_first,
                                        const ImageDisplacement& displacement);

}  // namespace tbm
