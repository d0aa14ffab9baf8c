#include "devices/imu/stim_reading.h"

#include <algorithm>
#include <cmath>

#include "pose/base/angle.h"
#include "pose/base/check.h"

namespace tbm {
namespace {

constexpr double kDegPerTemperatureCount = 1.0 / 256.0;

// One count of acceleration is 2^-n g, one of an increment of velocity 2^-(n + 3) m/s.
int AccelExponent(int range_g) {
  if (range_g == 5) return 20;
  if (range_g == 10) return 19;
  if (range_g == 30) return 18;
  TBM_CHECK(range_g == 80);
  return 16;
}

double ForceUnit_m_s2(StimOutput output, int exponent, double sample_rate_hz) {
  if (output == StimOutput::kRate) return std::ldexp(kStandardGravity_m_s2, -exponent);
  return std::ldexp(sample_rate_hz, -(exponent + 3));
}

Eigen::Vector3d Scaled(const StimCluster& cluster, double unit) {
  return unit * Eigen::Vector3d(cluster.counts[0], cluster.counts[1], cluster.counts[2]);
}

bool HasAny(const StimCluster& cluster, unsigned bits) { return (cluster.status & bits) != 0; }

bool IsUsable(const StimCluster& cluster) {
  return !HasAny(cluster,
                 stim_status::kIntegrity | stim_status::kStartUp | stim_status::kOverload |
                     stim_status::kChannel);
}

// Of every output and range, what a saturated converter ends at is beyond the range.
bool IsBeyond(const StimCluster& cluster, double unit, double range) {
  return std::ranges::any_of(cluster.counts,
                             [&](std::int32_t count) { return std::abs(count * unit) >= range; });
}

std::optional<double> Temperature(const std::optional<StimCluster>& cluster) {
  if (!cluster || !IsUsable(*cluster)) return std::nullopt;
  return Scaled(*cluster, kDegPerTemperatureCount).mean();
}

}  // namespace

double GyroUnit_rad_s(const StimScales& scales) {
  if (scales.gyro == StimOutput::kRate) return DegToRad(std::ldexp(1.0, -14));
  return DegToRad(std::ldexp(scales.sample_rate_hz, -21));
}

double AccelUnit_m_s2(const StimScales& scales) {
  return ForceUnit_m_s2(scales.accel, AccelExponent(scales.accel_range_g), scales.sample_rate_hz);
}

double TiltUnit_m_s2(const StimScales& scales) {
  return ForceUnit_m_s2(scales.tilt, 22, scales.sample_rate_hz);
}

StimReading ReadingFromStim(const StimDatagram& datagram, const StimScales& scales) {
  StimReading reading;
  unsigned status = datagram.gyro.status;
  const double gyro_unit = GyroUnit_rad_s(scales);
  reading.rate_rad_s = Scaled(datagram.gyro, gyro_unit);
  reading.is_overloaded = IsBeyond(datagram.gyro, gyro_unit, DegToRad(kStimGyroRange_deg_s));
  if (datagram.accel) {
    status |= datagram.accel->status;
    const double unit = AccelUnit_m_s2(scales);
    reading.specific_force_m_s2 = Scaled(*datagram.accel, unit);
    const double range_m_s2 = scales.accel_range_g * kStandardGravity_m_s2;
    if (IsBeyond(*datagram.accel, unit, range_m_s2)) reading.is_overloaded = true;
  }
  if (datagram.tilt && IsUsable(*datagram.tilt)) {
    const double unit = TiltUnit_m_s2(scales);
    if (!IsBeyond(*datagram.tilt, unit, kStimTiltRange_g * kStandardGravity_m_s2)) {
      reading.tilt_force_m_s2 = Scaled(*datagram.tilt, unit);
    }
  }
  reading.gyro_temperature_celsius = Temperature(datagram.gyro_temperature);
  reading.accel_temperature_celsius = Temperature(datagram.accel_temperature);
  reading.is_starting_up = (status & stim_status::kStartUp) != 0;
  reading.is_faulty = (status & (stim_status::kIntegrity | stim_status::kChannel)) != 0;
  reading.is_outside_conditions = (status & stim_status::kOutsideConditions) != 0;
  if ((status & stim_status::kOverload) != 0) reading.is_overloaded = true;
  return reading;
}

}  // namespace tbm
