#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "guidance/fusion/fusion_filter.h"
#include "pose/geometry/camera_model.h"

namespace tbm {

// A surveyed point that the camera may see.
struct SurveyedTarget {
  std::string name;
  Eigen::Vector3d in_world_m = Eigen::Vector3d::Zero();
  double sigma_m = 0.0;  // of each coordinate, >= 0
  // What the modes of the state move it by [m per unit]; no columns: it is taken as it stands.
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, FusionLayout::kMostModes> by_mode;
};

// An image point of a target, as it was measured (distorted).
struct TargetPixel {
  int target = 0;  // index into the targets
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  // Of one coordinate, where it is known of this point; counts where it is worse than that of all.
  double sigma_px = 0.0;
};

// One of them that was not taken.
struct RejectedPixel {
  int target = 0;
  std::string_view why_not;  // "behind_camera", "far_from_prediction", "does_not_fit"
  double off_px = 0.0;       // from where the state puts it; NaN: it puts it nowhere
};

struct TargetsVerdict {
  FusionVerdict verdict;
  int taken = 0;
  std::vector<RejectedPixel> rejected;
};

// Where the state puts a target: pixel, and its derivative by the whole error state. The exposure
// was at `sensed_at` minus the state's time offset; the filter stands at `sensed_at`.
struct PixelPrediction {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, FusionLayout::kMost> by_error;
  Eigen::Matrix<double, 2, 3> by_target_px_per_m;
};
struct PixelExposure {
  const FusionLayout& layout;
  const CameraModel& camera;
  Eigen::Vector3d rate_rad_s;  // without its bias
  bool is_moving = false;      // what does not move says nothing of the clock
};
Result<PixelPrediction, CameraModelFailure> PredictPixel(const PixelExposure& exposure,
                                                         const FusionState& state,
                                                         const SurveyedTarget& target);
Result<PixelPrediction, CameraModelFailure> PredictPixel(const FusionFilter& filter,
                                                         const CameraModel& camera,
                                                         const SurveyedTarget& target);

// All targets of one image (docs/filter.md, "Target pixels"). A point that lies further from its
// prediction than state and camera allow is left out, then whatever does not fit what the others
// say; an image of which less than half is left is not taken at all.
// `residual_px` > 0: sigma of one coordinate of an image point. The filter has been brought forward
// to the stamp of the image.
TargetsVerdict UpdateByTargets(FusionFilter& filter,
                               const CameraModel& camera,
                               double residual_px,
                               std::span<const SurveyedTarget> targets,
                               std::span<const TargetPixel> pixels);

}  // namespace tbm
