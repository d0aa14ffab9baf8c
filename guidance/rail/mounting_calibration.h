#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "guidance/rail/rail_recording.h"
#include "guidance/rail/rail_start.h"
#include "pose/base/result.h"

namespace tbm {

// How a camera is built to an inertial unit, and by how much its clock is off.
struct MountingCalibration {
  Eigen::Quaterniond camera_from_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d camera_in_imu_m = Eigen::Vector3d::Zero();
  double time_offset_s = 0.0;  // camera stamp minus imu time
  Eigen::Vector3d gyro_bias_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias_m_s2 = Eigen::Vector3d::Zero();
  // Of gyro bias [rad/s], accelerometer bias [m/s2], time offset [s], rotation about the camera's
  // axes [rad] and position [m], in this order.
  static constexpr int kTimeOffset = 6;
  static constexpr int kRotation = 7;
  static constexpr int kPosition = 10;
  Eigen::Matrix<double, 13, 13> covariance = Eigen::Matrix<double, 13, 13>::Zero();
  int rounds = 0;
  std::size_t images = 0;
  std::size_t points = 0;
  std::size_t points_left_out = 0;
  double chi2 = 0.0;  // of everything that was taken
  double dof = 0.0;
};

enum class MountingFault {
  kNoCamera,       // the set-up has no camera
  kTooFewImages,   // fewer than ten with four targets or more, or none while the trolley rests
  kStart,          // `start` says what is wrong with the beginning of the run
  kDegenerate,     // the run did not tell of something: `weak`
  kDoesNotFit,     // more than a tenth of the points fit nothing, or what is left is too far off
  kDoesNotSettle,  // each round ends elsewhere: the first guess is too far off
};

// What a run told too little of.
enum class MountingWeakness {
  kTimeOffset,  // drive or turn while targets are seen
  kRotation,    // targets in depth, or drive along the view; level by the inclinometer
  kPosition,    // turn about two axes while targets are seen
};
const char* MissingMotion(MountingWeakness weakness);

struct MountingFailure {
  MountingFault fault = MountingFault::kNoCamera;
  RailStartFailure start;
  std::vector<MountingWeakness> weak;
  double chi2_per_dof = 0.0;  // kDoesNotFit
};

struct MountingLimits {
  // How far from the truth the set-up's camera section may be at first (sigma).
  double first_rotation_rad = 0.02;
  double first_position_m = 0.05;
  double first_time_offset_s = 0.02;
  // How well each must be told in the end.
  double most_sigma_rotation_rad = 1e-3;
  double most_sigma_position_m = 8e-3;
  double most_sigma_time_offset_s = 2e-3;
};

// Rotation and lever arm between camera and unit (rail-line paper, Eqs. 16..21), and the offset of
// their clocks, from a run past surveyed targets, in one batch with the biases and with where the
// unit was at each image (docs/mounting.md). The set-up's camera is the first guess; its sigmas are
// not used.
Result<MountingCalibration, MountingFailure> CalibrateMounting(const RailSetup& setup,
                                                               const RailRecording& recording,
                                                               const MountingLimits& limits);

}  // namespace tbm
