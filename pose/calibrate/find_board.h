#pragma once

#include <vector>

#include <Eigen/Core>

#include "pose/base/result.h"
#include "pose/calibrate/board.h"
#include "pose/centres/image_view.h"

namespace tbm {

enum class FindBoardFailure {
  kNotSeen,   // no board of this kind with this many points; part of it covered or out of the image
  kTooSmall,  // seen, but its points are closer than some pixels: too far away
  kNoImage,   // no pixels, or fewer than 16 along a side
};
const char* Text(FindBoardFailure failure);

// Pixels of all points in the order of BoardPoints, right-handed as the board is, the first square
// between points dark. Where the board looks the same turned, which end comes first is open.
//
// Chessboards: OpenCV's sector finder, then its older one, then cornerSubPix. Circles: OpenCV's
// grid finder on blobs, dark ones or bright ones, then the middle of each circle's area in grey
// values. Worst error on rendered boards: pose/docs/calibration.md, section 1.
Result<std::vector<Eigen::Vector2d>, FindBoardFailure> FindBoard(const ImageView& image,
                                                                 const Board& board);

}  // namespace tbm
