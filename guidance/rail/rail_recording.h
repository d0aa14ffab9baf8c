#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "guidance/fusion/fusion_filter.h"
#include "guidance/fusion/odometer_update.h"
#include "guidance/fusion/target_pixels.h"
#include "guidance/fusion/tilt_update.h"
#include "pose/geometry/camera_model.h"

namespace tbm {

// The trolley: its sensors, how they are built in and how good they are (rail.yaml).
struct RailCamera {
  CameraModel model;
  double residual_px = 0.1;  // sigma of one coordinate of an image point, > 0
  Eigen::Quaterniond camera_from_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d in_imu_m = Eigen::Vector3d::Zero();
  double sigma_rotation_rad = 0.0;
  double sigma_position_m = 0.0;
  double time_offset_s = 0.0;  // camera stamp minus imu time
  double sigma_time_offset_s = 0.0;
};
struct RailImu {
  double rate_hz = 200.0;
  ImuNoise noise;
  double gyro_bias_sigma_rad_s = 0.0;
  double accel_bias_sigma_m_s2 = 0.0;
};
struct RailOdometer {
  OdometerMounting mounting;  // its sigma_m_s follows from `sigma_m` and the time between readings
  double sigma_m = 0.0;       // of one reading, > 0
  double sigma_scale = 0.0;   // of true distance over told distance
};
struct RailStart {
  Eigen::Vector3d position_world_m = Eigen::Vector3d::Zero();  // of the unit
  double sigma_position_m = 0.0;
  std::optional<double> heading_rad;  // of the unit's x in the world, from x towards y
  double sigma_heading_rad = 0.0;     // of it, > 0 where it is given
  double at_rest_s = 0.0;             // from the first sample on
};
struct RailSetup {
  double gravity_m_s2 = 9.80665;
  RailImu imu;
  std::optional<TiltMounting> tilt;
  std::optional<RailCamera> camera;
  std::optional<RailOdometer> odometer;
  RailStart start;
};

struct TiltSample {
  Timestamp sensed_at;
  TiltAngles angles;
};
struct TargetImage {
  Timestamp stamped_at;  // by the camera's clock
  std::vector<TargetPixel> pixels;
};

struct OdometerReading {
  Timestamp sensed_at;
  double distance_m = 0.0;  // since any beginning, forwards positive
};

// One run, each list in the order of time.
struct RailRecording {
  std::vector<ImuSample> imu;
  std::vector<TiltSample> tilts;
  std::vector<TargetImage> images;
  std::vector<SurveyedTarget> targets;
  std::vector<OdometerReading> odometer;
};

}  // namespace tbm
