#pragma once

#include "guidance/app/calibrate_command.h"

namespace CLI {
class App;
}

namespace tbm {

// All options of `tbm calibrate`, filled in by the parser.
struct CalibrateRequests {
  CalibrateCameraRequest camera;
  CalibrateTiltRequest tilt;
  CalibrateTargetRequest target;
  CalibrateRigRequest rig;
  CalibrateImuRequest imu;
};

// Adds `calibrate` with its commands camera, tilt, target, rig and imu.
CLI::App* AddCalibrate(CLI::App& app, CalibrateRequests& requests);

// Runs the one that was parsed; `calibrate` is what AddCalibrate returned.
ExitCode RunCalibrate(const CLI::App& calibrate,
                      const CalibrateRequests& requests,
                      const Console& console);

}  // namespace tbm
