#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pose/geometry/rigid3.h"

namespace tbm {

// The ninths of an image, row by row.
enum class ImagePart {
  kUpperLeft,
  kUpperMiddle,
  kUpperRight,
  kLeft,
  kMiddle,
  kRight,
  kLowerLeft,
  kLowerMiddle,
  kLowerRight
};
inline constexpr int kImageParts = 9;
const char* Name(ImagePart part);  // "upper left"

// What a set of board pictures tells of a lens: where in the image points were seen, and how far
// the boards were tilted to it.
struct Coverage {
  // Each ninth has two by two cells; it is covered when points lie in at least three of them.
  static constexpr int kCells = 6;                // along each side
  static constexpr double kLeastTilt_rad = 0.14;  // 8 degrees

  std::array<int, static_cast<std::size_t>(kCells) * kCells> points{};  // row by row
  double share = 0.0;                                                   // of cells with points
  std::vector<ImagePart> missing;
  // Root mean square over the pictures of the board's tilt about the image's horizontal axis (upper
  // edge near, then far) and about its vertical one (left edge near, then far). NaN where no
  // picture could be placed.
  double tilt_about_u_rad = std::numeric_limits<double>::quiet_NaN();
  double tilt_about_v_rad = std::numeric_limits<double>::quiet_NaN();

  bool IsTilted() const {
    return tilt_about_u_rad >= kLeastTilt_rad && tilt_about_v_rad >= kLeastTilt_rad;
  }
};

// `views`: the pixels of each picture.
Coverage CoverageOf(std::span<const std::vector<Eigen::Vector2d>> views,
                    int image_width_px,
                    int image_height_px);
void SetTilts(std::span<const Rigid3> camera_from_boards, Coverage* coverage);

// What pictures are still to be taken: "bring the board to the upper left and the right of the
// image; tilt it so that its upper edge .." Empty when nothing is missing.
std::string MissingPictures(const Coverage& coverage);

}  // namespace tbm
