#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pose/base/result.h"
#include "pose/calibrate/board.h"
#include "pose/calibrate/coverage.h"
#include "pose/calibrate/view_fit.h"
#include "pose/geometry/camera_model.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

struct CameraCalibrationOptions {
  bool with_k3 = false;  // for lenses of more than 90 degrees; elsewhere it only takes from k2
  double most_residual_px = 1.5;
  double most_focal_sigma = 0.005;  // sigma of fx and fy over fx and fy
};

struct CalibrationPicture {
  bool used = true;       // false: left out because it does not fit the others
  bool is_placed = true;  // false: nothing below is known
  Rigid3 camera_from_board;
  double rms_px = 0.0;                        // of one coordinate
  std::vector<Eigen::Vector2d> residuals_px;  // found minus expected
};

struct CameraCalibration {
  CameraModel camera;
  // Of fx fy cx cy k1 k2 p1 p2 k3, scaled by the residual. Row and column of k3 are zero where it
  // was not asked for: it is then no estimate.
  IntrinsicMatrix covariance = IntrinsicMatrix::Zero();
  double residual_px = 0.0;  // sigma of one coordinate: sqrt(sum / dof)
  int dof = 0;
  std::vector<CalibrationPicture> pictures;  // as they were given
  Coverage coverage;                         // of those used
};

enum class CameraCalibrationFault {
  kTooFew,     // under five pictures with a board
  kUncovered,  // parts of the image have no points: Coverage::missing
  kTooFlat,    // the boards are hardly tilted: focal length and distance cannot be told apart
  kTooWeak,    // tilted and covered, and the focal length is still not known well enough
  kDisagree,   // more than a third of the pictures do not fit the others
  kTooCoarse,  // they agree, and badly: the residual is above what was allowed
  kNoFit,      // no camera fits at all
  kFolds,      // the distortion found cannot be undone everywhere in the image
};

struct CameraCalibrationFailure {
  CameraCalibrationFault fault = CameraCalibrationFault::kNoFit;
  Coverage coverage;                  // of all pictures; for the picture of what is missing
  std::vector<std::size_t> left_out;  // pictures that do not fit
  double residual_px = 0.0;           // NaN where there is none
  double focal_sigma = 0.0;           // over the focal length; NaN where there is none
};

// What is to be done, for the person with the board; MissingPictures is in it.
std::string Advice(const CameraCalibrationFailure& failure);

// Camera from pictures of one board: `views` has the pixels of all its points for each picture.
//
// OpenCV's calibrateCamera is the start; Gauss-Newton on all parameters and placements at once
// follows, which gives the covariance of the whole (placements eliminated). A picture whose
// residual is more than three times the median is left out and all is done again. Measured over
// forty draws: pose/docs/calibration.md, section 2.
Result<CameraCalibration, CameraCalibrationFailure> CalibrateCamera(
    const Board& board,
    std::span<const std::vector<Eigen::Vector2d>> views,
    int image_width_px,
    int image_height_px,
    const CameraCalibrationOptions& options);

}  // namespace tbm
