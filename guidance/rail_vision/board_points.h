#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "guidance/rail_vision/find_targets.h"
#include "guidance/rail_vision/target_gates.h"
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

// Whether the images of two boards may look alike: a board may lie on its side.
bool IsSameForm(const SoughtBoard& a, const SoughtBoard& b);

// A board that is seen whole, or why it is not taken.
struct BoardOutcome {
  std::vector<TargetSeen> seen;             // its surveyed points
  std::vector<Eigen::Vector2d> corners_px;  // all points of what fits: more than one board's where
                                            // that is ambiguous
  TargetRefusal why = TargetRefusal::kNotFound;
};
// Whether something in the image fits both.
bool HaveTheSame(const BoardOutcome& a, const BoardOutcome& b);

// `gates`: none where nothing is expected. Where there is room for a second board of this form, it
// is looked for too: two that fit are ambiguous.
BoardOutcome FindWholeBoard(const cv::Mat& grey,
                            const CameraModel& camera,
                            std::span<const SoughtTarget> targets,
                            const SoughtBoard& board,
                            const TargetGates* gates,
                            const std::optional<Eigen::Vector3d>& up_in_camera);

// Of a board that is partly hidden the points whose gates are narrower than a third of the pitch,
// each by itself.
std::vector<TargetSeen> FindBoardPoints(const cv::Mat& grey,
                                        std::span<const SoughtTarget> targets,
                                        const SoughtBoard& board,
                                        const TargetGates& gates);

}  // namespace tbm
