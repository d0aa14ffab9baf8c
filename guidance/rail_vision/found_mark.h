#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "guidance/rail_vision/target_mark.h"
#include "pose/geometry/camera_model.h"

namespace cv {
class Mat;
}

namespace tbm {

// A mark in an image: what it is called by itself, not by where it lies.
struct FoundMark {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();  // picture of its middle, distorted
  double sigma_px = 0.0;                               // of one coordinate
  double diameter_px = 0.0;                            // of a circle
  double bias_px = 0.0;  // part of sigma: the same in every image that is taken from there
  int code = -1;         // of a coded mark
};

// Discs of `least_px` to `most_px` across, dark or light, whole within the image. An edge by its
// half-way grey values, an ellipse through them without the lens' distortion. The middle of a
// circle's picture is not the picture of its middle: an ellipse tells the circle's plane but for
// its sign, so the point half way between both answers is taken, and half of their distance is the
// bias.
std::vector<FoundMark> FindCircles(const cv::Mat& grey,
                                   const CameraModel& camera,
                                   double least_px,
                                   double most_px);

// Markers of ArUco's dictionary 4x4_50 that are at least kLeastMarker_px wide: a straight line
// through the half-way grey values of each side, corners where they meet, the middle where the
// diagonals do, which is the picture of the middle however it is seen.
inline constexpr double kLeastMarker_px = 16.0;
inline constexpr double kLeastCircle_px = 7.0;
struct FoundCodes {
  std::vector<FoundMark> marks;
  std::vector<int> too_small;  // codes read on markers narrower than that
  std::vector<int> unclear;    // codes read on markers whose sides are no straight edges: covered
};
FoundCodes FindCodes(const cv::Mat& grey, const CameraModel& camera);

}  // namespace tbm
