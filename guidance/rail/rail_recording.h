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
#include "pose/geometry/rigid3.h"

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
  double sigma_rotation_rad = 0.0;  // of vehicle_from_imu, about the vehicle's y and z
};
// Looks at the ground beside the rail.
struct RailGroundCamera {
  CameraModel model;
  Eigen::Quaterniond camera_from_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d in_imu_m = Eigen::Vector3d::Zero();
  double sigma_rotation_rad = 0.0;  // of camera_from_imu, about the plumb line
  double height_m = 0.0;            // over the ground, > 0
  double sigma_height_m = 0.0;      // of it, > 0; the same along the whole run
  double sigma_m = 0.0;             // of a displacement, beside what its images say
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
  std::optional<RailGroundCamera> ground;
  RailStart start;
};

struct TrolleyTilt {
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

// How far the unit moved between two images of the ground.
struct GroundDisplacement {
  Timestamp from;
  Timestamp to;  // later
  Eigen::Vector2d told_m =
      Eigen::Vector2d::Zero();  // GroundVehicle's x and y, by the set-up's height
  double sigma_m = 0.0;         // of each, > 0
};

// vehicle_from_imu: z against the axis of the camera that looks at the ground. Along x and y the
// image tells how the ground moves.
inline Eigen::Quaterniond GroundVehicle(const RailGroundCamera& camera) {
  return TurnBetween(camera.camera_from_imu.conjugate() * Eigen::Vector3d::UnitZ(),
                     -Eigen::Vector3d::UnitZ());
}

// One run, each list in the order of time.
struct RailRecording {
  std::vector<ImuSample> imu;
  std::vector<TrolleyTilt> tilts;
  std::vector<TargetImage> images;
  std::vector<SurveyedTarget> targets;
  std::vector<OdometerReading> odometer;
  std::vector<GroundDisplacement> grounds;  // each begins when the one before has ended, or later
};

}  // namespace tbm
