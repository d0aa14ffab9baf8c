#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "pose/base/result.h"
#include "pose/calibrate/tilt_rotation.h"

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

struct TargetCalibration {
  std::vector<Eigen::Vector3d> led_in_target_m;
  std::vector<double> led_sigma_m;  // of one coordinate, the frame being that of all LEDs together
  double chi2 = 0.0;                // of the LEDs
  int dof = 0;
  // The LED and placement that fit worst, and by how many sigma.
  std::size_t worst_led = 0;
  std::size_t worst_placement = 0;
  double worst_sigmas = 0.0;
  // How the housing is built to the board; empty where no placement was tilted enough.
  std::optional<Eigen::Matrix3d> housing_from_target;
  Eigen::Matrix3d mounting_covariance = Eigen::Matrix3d::Zero();  // [rad2], about the board's axes
  std::optional<TiltRotationFault> mounting_missing;              // why it is empty
};

enum class TargetCalibrationFault {
  kTooFewLeds,  // a placement with fewer than three LEDs, or an LED that was never measured
  kOnOneLine,   // LEDs of a placement stand on one line: how it was turned is not known
  kDoesNotFit,  // an LED or a placement is off by more than measuring explains
  kOtherBoard,  // the LEDs are not where the nominal ones are, by any placement
};

struct TargetCalibrationFailure {
  TargetCalibrationFault fault = TargetCalibrationFault::kTooFewLeds;
  std::size_t led = 0;        // the one meant, by its place in the list
  std::size_t placement = 0;  // the same
  double off_m = 0.0;         // kDoesNotFit, kOtherBoard: by how much
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
