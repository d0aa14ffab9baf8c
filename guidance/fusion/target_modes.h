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
// Fills in `by_mode` of the targets with `most` columns, or fewer where fewer matter. What is left
// out moves the camera by `left_out_m`: root mean square over the views, of each coordinate in the
// world; also where a view shows a single target. Without a view: no columns, and zero.
struct TargetModes {
  int count = 0;
  Eigen::Vector3d left_out_m = Eigen::Vector3d::Zero();
};
TargetModes FindTargetModes(std::span<const TargetView> views,
                            const CameraModel& camera,
                            double residual_px,
                            int most,
                            std::vector<SurveyedTarget>* targets);

// By how much the errors of the survey move the camera of one view whose place only its targets
// tell [m]: sigma of each coordinate in the world. `level_sigma_rad` > 0: how well gravity tells
// its attitude; about the vertical little more is known than the targets say.
Eigen::Vector3d SurveySigma(const TargetView& view,
                            const CameraModel& camera,
                            double residual_px,
                            double level_sigma_rad,
                            const std::vector<SurveyedTarget>& targets);

}  // namespace tbm
