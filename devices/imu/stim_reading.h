#pragma once

#include <optional>

#include <Eigen/Core>

#include "devices/imu/stim_datagram.h"

namespace tbm {

// What the counts of a cluster mean. Which one is set up in the unit; the datagram does not tell.
enum class StimOutput {
  kRate,       // rate or acceleration, of an instant or averaged over the sample
  kIncrement,  // turn or change of velocity over the sample
};

// One unit as it is set up.
struct StimScales {
  StimOutput gyro = StimOutput::kRate;
  StimOutput accel = StimOutput::kRate;
  StimOutput tilt = StimOutput::kRate;
  int accel_range_g = 10;  // 5, 10, 30 or 80
  double sample_rate_hz = 500.0;
};

inline constexpr double kStandardGravity_m_s2 = 9.80665;  // what the unit calls 1 g
inline constexpr double kStimGyroRange_deg_s = 400.0;
inline constexpr double kStimTiltRange_g = 1.7;

// One count, in SI; increments as the mean over the sample.
double GyroUnit_rad_s(const StimScales& scales);
double AccelUnit_m_s2(const StimScales& scales);
double TiltUnit_m_s2(const StimScales& scales);

struct StimReading {
  Eigen::Vector3d rate_rad_s = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> specific_force_m_s2;
  std::optional<Eigen::Vector3d> tilt_force_m_s2;   // empty when its status is bad
  std::optional<double> gyro_temperature_celsius;   // the same
  std::optional<double> accel_temperature_celsius;  // the same

  // By the status of gyros and accelerometers.
  bool is_starting_up = false;
  bool is_faulty = false;  // integrity or channel
  bool is_outside_conditions = false;
  // By that status, or because an axis is beyond the range that the unit is made for.
  bool is_overloaded = false;
};

StimReading ReadingFromStim(const StimDatagram& datagram, const StimScales& scales);

}  // namespace tbm
