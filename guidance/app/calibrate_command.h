#pragma once

#include <string>
#include <vector>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct CalibrateCameraRequest {
  std::string folder;    // of pictures
  std::string board;     // "chessboard:9x6:25"
  std::string out;       // the camera part of a rig file
  std::string picture;   // PNG of the residuals; empty: none
  std::string coverage;  // PNG; empty: only when there is no calibration, beside `out`
  bool with_k3 = false;
  bool force = false;
};

// `tbm calibrate camera`: intrinsics from pictures of a board. kBadInput, with a picture of what is
// missing, where the pictures do not say enough.
ExitCode RunCalibrateCamera(const CalibrateCameraRequest& request, const Console& console);

struct CalibrateTiltRequest {
  std::string folder;  // of pictures and tilt.csv
  std::string board;
  std::string camera;  // its file
  std::string out;
  double sigma_deg = 0.005;               // of a reading, where tilt.csv has no sigma_deg
  std::vector<double> sign = {1.0, 1.0};  // of beta and gamma, as in a rig file
  std::vector<double> up_in_board;        // empty: not known
  double up_sigma_deg = 0.02;
  bool force = false;
};

// `tbm calibrate tilt`: rotation between camera and inclinometer from pictures of a board at rest.
// kBadInput, with the missing motion named, where the placements do not say enough.
ExitCode RunCalibrateTilt(const CalibrateTiltRequest& request, const Console& console);

}  // namespace tbm
