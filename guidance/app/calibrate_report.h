#pragma once

#include <string>
#include <vector>

#include "guidance/app/calibrate_input.h"
#include "pose/calibrate/camera_calibration.h"
#include "pose/calibrate/tilt_rotation.h"

namespace tbm {

// The camera part of a rig file, and below it, under `calibrated`, what the numbers are worth.
std::string CameraYaml(const CameraCalibration& found,
                       const FoundBoards& boards,
                       const std::string& board);
// For the person who waits: residual, each parameter with its sigma, pictures left out.
std::string CameraSummary(const CameraCalibration& found, const FoundBoards& boards);

// The inclinometer part of a rig file that belongs to the camera, and what it is worth.
struct TiltResult {
  TiltRotation rotation;
  double sigma_deg = 0.0;             // of one reading
  std::vector<double> sign;           // as in a rig file
  std::vector<std::string> pictures;  // side by side with the rotation's readings
  double residual_px = 0.0;
  CameraModel camera;  // that it was found with
  bool up_was_given = false;
};
std::string TiltYaml(const TiltResult& result);
// For the person who waits: sigmas, and what each picture's reading is off.
std::string TiltSummary(const TiltResult& result);

}  // namespace tbm
