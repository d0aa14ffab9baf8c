#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "pose/rig/rig.h"
#include "pose/rig/rig_file.h"

namespace tbm {

// The files that a rig file is put together from. Each holds sections of a rig file, and under
// `calibrated` what they rest on; a whole rig file is each of them too. Sections that are not asked
// for are passed over; in those that are, a key that nobody reads is a fault, and so is a sigma
// that is missing: who is sure of a number writes 0. All faults are collected.

// What `tbm calibrate camera` writes, or a camera_info file with residual_px and
// intrinsics_sigma_px added.
struct CameraPart {
  Rig rig;  // its camera, and what that is worth
  // Covariance of fx fy cx cy [px2], k1 k2 p1 p2 k3, where the file knows it.
  std::optional<Eigen::Matrix<double, 9, 9>> intrinsics;
};
Result<CameraPart, RigFileFaults> ParseCameraPart(std::string_view yaml, const std::string& file);
Result<CameraPart, RigFileFaults> LoadCameraPart(const std::string& path);

// What `tbm calibrate tilt` writes: inclinometers.camera.
struct TiltPart {
  TiltMount mount;
  // That the rotation was found with, and belongs to: `calibrated.camera`, or in a whole rig file
  // its own. A file with neither is refused.
  CameraModel camera;
  std::string camera_key;
  int camera_line = 0;
};
Result<TiltPart, RigFileFaults> ParseTiltPart(std::string_view yaml, const std::string& file);
Result<TiltPart, RigFileFaults> LoadTiltPart(const std::string& path);

// What `tbm calibrate target` writes: target, inclinometers.target.
struct TargetPart {
  std::vector<Led> leds;
  TiltMount mount;
};
Result<TargetPart, RigFileFaults> ParseTargetPart(std::string_view yaml, const std::string& file);
Result<TargetPart, RigFileFaults> LoadTargetPart(const std::string& path);

// What only a person knows: points, rig_name.
struct PointsPart {
  std::string rig_name;            // empty when there is none
  std::vector<NamedPoint> points;  // one at least
};
Result<PointsPart, RigFileFaults> ParsePointsPart(std::string_view yaml, const std::string& file);
Result<PointsPart, RigFileFaults> LoadPointsPart(const std::string& path);

// The LEDs of a rig file or of a target part as they stand, with or without sigma.
Result<std::vector<Led>, RigFileFaults> ParseLeds(std::string_view yaml, const std::string& file);
Result<std::vector<Led>, RigFileFaults> LoadLeds(const std::string& path);

}  // namespace tbm
