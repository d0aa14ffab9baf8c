#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "guidance/rail_vision/find_targets.h"
#include "guidance/rail_vision/target_gates.h"
#include "pose/centres/image_view.h"
#include "pose/geometry/camera_model.h"

namespace cv {
class Mat;
}

namespace tbm {

// A board of which some points, or all, are among the targets.
struct SoughtBoard {
  std::string name;
  int columns = 0;
  int rows = 0;
  std::vector<std::size_t> targets;
};
std::vector<SoughtBoard> BoardsAmong(std::span<const SoughtTarget> targets);

// The points of a board, those that are found. `gates`: none where nothing is expected. Whole
// boards are found wherever they are in their gates; of one that is partly hidden the points whose
// gates are narrower than a third of the pitch, each by itself.
struct BoardOutcome {
  std::vector<TargetSeen> seen;
  TargetRefusal why = TargetRefusal::kNotFound;  // of those that are not
};
BoardOutcome FindBoardPoints(const ImageView& image,
                             const cv::Mat& grey,
                             const CameraModel& camera,
                             std::span<const SoughtTarget> targets,
                             const SoughtBoard& board,
                             const TargetGates* gates,
                             const std::optional<Eigen::Vector3d>& up_in_camera);

}  // namespace tbm
