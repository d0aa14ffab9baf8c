#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "pose/base/result.h"
#include "pose/calibrate/tilt_rotation.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

// One placement of the LED board before a total station (frame `site`: z up, levelled).
struct TargetPlacement {
  // In the order of the LEDs; empty where one was not measured.
  std::vector<std::optional<Eigen::Vector3d>> led_in_site_m;
  double sigma_m = 0.0;  // of one coordinate of a measured LED, > 0
  // What the board's inclinometer felt meanwhile; empty where it was not read.
  std::optional<Eigen::Vector3d> up_in_housing;
  double tilt_sigma_rad = 0.0;  // of each of its angles, > 0
};

// A measured LED against what all placements together say of it.
struct TargetSighting {
  std::size_t placement = 0;
  std::size_t led = 0;
  Eigen::Vector3d off_in_site_m = Eigen::Vector3d::Zero();  // measured minus adjusted
  // By how much chi2 would fall without it, in how many directions others control it (0 .. 3), and
  // how far it is, in those, from where all others put it.
  double misfit = 0.0;
  int controlled = 0;
  double from_others_m = 0.0;
};

// An LED's point in one placement.
struct TargetPoint {
  std::size_t placement = 0;
  std::size_t led = 0;
};

// A point that measuring does not explain.
struct WrongTargetPoint {
  TargetPoint point;
  double off_m = 0.0;  // from where all others put it, the other wrong ones left out
  // Contradict it as badly, and one of them may be wrong instead: two placements, or three LEDs.
  std::vector<TargetPoint> or_rather;
};

struct TargetCalibration {
  std::vector<Eigen::Vector3d> led_in_target_m;
  std::vector<double> led_sigma_m;  // of one coordinate, the frame being that of all LEDs together
  std::vector<Rigid3> site_from_target;  // of each placement
  std::vector<TargetSighting> sightings;
  double chi2 = 0.0;  // of the LEDs
  int dof = 0;        // 0: one placement, nothing controls it
  // By this, at most three, the points scatter more than was declared; every sigma of the LEDs is
  // multiplied with it.
  double sigma_factor = 1.0;
  // How the housing is built to the board; empty where no placement was tilted enough.
  std::optional<Eigen::Matrix3d> housing_from_target;
  Eigen::Matrix3d mounting_covariance = Eigen::Matrix3d::Zero();  // [rad2], about the board's axes
  double mounting_factor = 1.0;  // the same of the readings; the covariance has it
  // Why it is empty; its `wrong` count placements.
  std::optional<TiltRotationFailure> mounting_missing;
};

enum class TargetCalibrationFault {
  kTooFewLeds,     // a placement with fewer than three LEDs
  kNeverMeasured,  // an LED that stands in no placement
  kOnOneLine,      // LEDs of a placement stand on one line: how it was turned is not known
  kExchanged,      // points of a placement carry one another's names
  kMirrored,       // the points are a mirror image of the board: two of the columns exchanged
  kDoesNotFit,     // points are off by more than measuring explains
  kScatters,       // all of them are, and none can be blamed
  kOtherBoard,     // the LEDs are not where the nominal ones are, by any placement
};

struct TargetCalibrationFailure {
  TargetCalibrationFault fault = TargetCalibrationFault::kTooFewLeds;
  std::size_t led = 0;                  // the one meant, by its place in the list
  std::size_t placement = 0;            // the same
  double off_m = 0.0;                   // kOtherBoard: by how much
  std::vector<WrongTargetPoint> wrong;  // kDoesNotFit: one or more. kScatters: the worst point
  double sigma_factor = 1.0;            // kScatters: by this, more than three
  std::vector<std::size_t> really;      // kExchanged: which LED the point with each LED's name is
  double scale = 1.0;  // kOtherBoard: size of what was measured by that of the board
};

// LED coordinates and the inclinometer's mounting from total-station points. The target frame stays
// that of `nominal_m` (the drawing, or the last calibration): the new LEDs lie on it as well as a
// rigid shift and turn allow. One placement gives the coordinates; the mounting takes two that are
// tilted differently. Free network adjustment of all placements at once, inner constraints.
// `most_off_m`: how far a drawing may be from what was built.
Result<TargetCalibration, TargetCalibrationFailure> CalibrateTarget(
    std::span<const Eigen::Vector3d> nominal_m,
    std::span<const TargetPlacement> placements,
    double most_off_m = 0.02);

}  // namespace tbm
