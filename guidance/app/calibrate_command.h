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

struct CalibrateTargetRequest {
  std::string folder;                     // of a file of points for each placement, and tilt.csv
  std::string nominal;                    // rig file, or a table of the drawing
  std::string out;                        // the target's part of a rig file
  std::string report;                     // folder; empty: only print
  double sigma_mm = 0.3;                  // of one coordinate of a measured LED
  double most_off_mm = 20.0;              // how far the drawing may be from what was built
  double sigma_deg = 0.005;               // of a reading, where tilt.csv has no sigma_deg
  std::vector<double> sign = {1.0, 1.0};  // of beta and gamma, as in a rig file
  bool force = false;
};

// `tbm calibrate target`: the LEDs' places, and how the board's inclinometer is built to them, from
// total-station points. kBadInput, with file, LED and size of what is wrong, where they do not fit.
ExitCode RunCalibrateTarget(const CalibrateTargetRequest& request, const Console& console);

struct CalibrateRigRequest {
  std::string camera;  // files of the other three, and of what a person knows
  std::string tilt;
  std::string target;
  std::string points;
  std::string name;         // empty: the points' file says it
  std::string out;          // the rig file
  std::string report;       // folder; empty: only print
  double distance_m = 4.0;  // from the camera to the LEDs, of the budget
  double centre_sigma_px = 0.05;
  std::vector<double> facing;  // empty: found from the LEDs and points
  bool force = false;
};

// `tbm calibrate rig`: a rig file of its parts, and what it is worth at its points.
ExitCode RunCalibrateRig(const CalibrateRigRequest& request, const Console& console);

struct CalibrateImuRequest {
  std::string run;  // folder, as of `tbm line`
  std::string out;  // a rail.yaml; its .json beside it
  // How far the camera's section may be off, one sigma.
  double first_rotation_deg = 1.0;
  double first_position_mm = 50.0;
  double first_time_offset_ms = 20.0;
  bool force = false;
};

// `tbm calibrate imu`: how a trolley's camera is built to its inertial unit, and the offset of
// their clocks, from a run past targets. kBadInput, with the missing motion named, where the run
// does not say enough.
ExitCode RunCalibrateImu(const CalibrateImuRequest& request, const Console& console);

}  // namespace tbm
