#pragma once

#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "guidance/fusion/target_pixels.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

// From where an image was taken, roughly, and which targets it shows.
struct TargetView {
  Rigid3 camera_from_world;
  std::vector<int> targets;
};

// Errors of the survey are the same in every image: a hundred images do not average them away, and
// a sigma that takes them for noise is too small. All coordinates as states would be three for each
// target; but only few of their combinations move the camera at all. Those become states: numbers
// of mean 0 and sigma 1 (docs/filter.md, "Targets that are not where they should be").
//
// Fills in `by_mode` of the targets with `most` columns, or fewer where fewer matter. Answers what
// is left out: the root mean square over the views by which the remaining combinations move the
// camera [m]. Without a view of four targets: no columns, and zero.
struct TargetModes {
  int count = 0;
  double left_out_m = 0.0;
};
TargetModes FindTargetModes(std::span<const TargetView> views,
                            const CameraModel& camera,
                            double residual_px,
                            int most,
                            std::vector<SurveyedTarget>* targets);

}  // namespace tbm
