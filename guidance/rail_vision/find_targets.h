#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "guidance/rail_vision/target_gates.h"
#include "guidance/rail_vision/target_mark.h"
#include "pose/centres/find_centres.h"
#include "pose/centres/image_view.h"
#include "pose/geometry/camera_model.h"

namespace tbm {

struct SoughtTarget {
  TargetMark mark;
  Eigen::Vector3d in_world_m = Eigen::Vector3d::Zero();  // z up
  double sigma_m = 0.0;                                  // of each coordinate
};

// What is known before the image is looked at. Without an expectation only what names itself is
// found: coded targets, and boards of a form that no other board has, where they do not look the
// same turned or `up_in_camera` tells their upper side.
struct TargetsAhead {
  std::optional<ExpectedImage> expected;
  std::optional<Eigen::Vector3d> up_in_camera;
};

enum class TargetRefusal {
  kNotFound,       // nothing that looks like it where it is expected
  kAmbiguous,      // two fit, or one fits two targets, or chance might have put it there
  kTooFar,         // it is seen, but not where it can be: another place, or names exchanged
  kTooSmall,       // too few pixels for its form
  kAtEdge,         // at the edge of the image, not whole
  kCovered,        // seen, but too much of its edge is hidden or blurred
  kNoExpectation,  // does not name itself, and nobody knows where it would be
  kTilted,         // a circle so large and so tilted that the two places where its middle may be
                   // are too far from each other
};
std::string_view Word(TargetRefusal refusal);  // "not_found", ..

struct TargetSeen {
  std::size_t target = 0;
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();  // distorted, as TargetPixel
  double sigma_px = 0.0;                               // of one coordinate, from the image itself
};
struct TargetNotSeen {
  std::size_t target = 0;
  TargetRefusal why = TargetRefusal::kNotFound;
};
// Targets that are expected outside of the image are in neither list.
struct TargetsInImage {
  std::vector<TargetSeen> seen;  // in the order of the targets
  std::vector<TargetNotSeen> refused;
};

// Finds surveyed targets in an image (docs/vision.md). Never guesses: where two answers fit there
// is none. Holds its work space; one caller; the same image gives the same bits.
class TargetFinder {
 public:
  TargetFinder();
  TargetsInImage Find(const ImageView& image,
                      const CameraModel& camera,
                      std::span<const SoughtTarget> targets,
                      const TargetsAhead& ahead);

 private:
  CentreFinder centres_;
};

}  // namespace tbm
