#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "pose/base/result.h"
#include "pose/centres/image_view.h"
#include "pose/geometry/camera_model.h"

namespace tbm {

// What one image of the ground shows: points that can be known again (SIFT), in the ideal image
// plane.
struct GroundFeatures {
  std::vector<Eigen::Vector2d> points;  // normalised
  std::vector<float> descriptors;       // kDescriptor of each, one after the other
  double contrast_dn = 0.0;             // sigma of the grey values
  static constexpr int kDescriptor = 128;
};
GroundFeatures FindGroundFeatures(const ImageView& image, const CameraModel& camera);

enum class GroundFailure {
  kNoTexture,      // the ground looks everywhere the same, or there is no light
  kBlurred,        // there are light and dark, but nothing sharp to be known again
  kTooFewMatches,  // the images hardly overlap, or do not show the same
  kNotAPlane,      // what matches does not move as a plane that is nearly level, seen from that
                   // attitude, does
};
const char* Word(GroundFailure failure);  // "no_texture", ..

// From which attitudes two images were taken, and how well the turn between them is known.
struct GroundAttitudes {
  Eigen::Quaterniond world_from_first;  // of the camera; world: z up
  Eigen::Quaterniond world_from_second;
  double sigma_turn_rad = 1e-4;  // of the turn from one to the other, about each axis, > 0
};

// How the camera moved over the ground, in heights of the camera above it, square to the ground:
// the height is not seen in the images.
struct GroundMotion {
  Eigen::Vector3d moved;       // second place from the first, in the first camera's axes
  Eigen::Matrix3d covariance;  // of it
  Eigen::Vector3d turn_rad;  // of the second camera, beyond what its attitude says, about its axes
  std::size_t matches = 0;
  std::size_t inliers = 0;
  double rms_px = 0.0;  // of one coordinate
};

// The patent's steps (CN106052584): FLANN matches of SIFT features that are clearly nearer than the
// next best, RANSAC for a projective matrix, its least squares on the inliers. Of the matrix only
// what the ground's plane and the known attitudes leave open is then estimated: three numbers of
// shift, three of a turn that is small, and two of the ground's grade and cross-fall, some percent
// (docs/vision.md). Random choices start from a fixed
// seed: the same images give the same bits.
Result<GroundMotion, GroundFailure> MeasureGroundMotion(const GroundFeatures& first,
                                                        const GroundFeatures& second,
                                                        const CameraModel& camera,
                                                        const GroundAttitudes& attitudes);

}  // namespace tbm
