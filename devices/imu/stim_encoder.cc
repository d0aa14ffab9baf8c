#include "devices/imu/stim_encoder.h"

#include <algorithm>
#include <cmath>

#include "pose/base/check.h"

namespace tbm {
namespace {

class Writer {
 public:
  void Put(std::uint32_t value, std::size_t width) {
    for (std::size_t i = width; i-- > 0;) {
      bytes_.push_back(static_cast<std::uint8_t>((value >> (8 * i)) & 0xFFu));
    }
  }
  void Put(const StimCluster& cluster, std::size_t width, bool has_status) {
    for (const std::int32_t count : cluster.counts) Put(static_cast<std::uint32_t>(count), width);
    if (has_status) Put(cluster.status, 1);
  }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }
  std::vector<std::uint8_t> Take() { return std::move(bytes_); }

 private:
  std::vector<std::uint8_t> bytes_;
};

void PutTemperatures(StimFamily family,
                     const StimLayout& layout,
                     const StimDatagram& datagram,
                     Writer* writer) {
  const bool has_status = family == StimFamily::kStim300;
  writer->Put(datagram.gyro_temperature.value_or(StimCluster{}), 2, has_status);
  if (layout.has_accel) {
    writer->Put(datagram.accel_temperature.value_or(StimCluster{}), 2, has_status);
  }
  if (layout.has_tilt) {
    writer->Put(datagram.tilt_temperature.value_or(StimCluster{}), 2, has_status);
  }
}

StimCluster TemperatureCluster(std::optional<double> celsius) {
  return ClusterOf(Eigen::Vector3d::Constant(celsius.value_or(0.0)), 1.0 / 256.0);
}

}  // namespace

std::vector<std::uint8_t> EncodeStim(StimFamily family,
                                     const StimDatagram& datagram,
                                     bool has_terminator) {
  const StimLayout* layout = FindStimLayout(family, datagram.id);
  TBM_CHECK(layout != nullptr);
  Writer writer;
  writer.Put(datagram.id, 1);
  writer.Put(datagram.gyro, 3, true);
  if (layout->has_accel) writer.Put(datagram.accel.value_or(StimCluster{}), 3, true);
  if (layout->has_tilt) writer.Put(datagram.tilt.value_or(StimCluster{}), 3, true);
  if (layout->has_temperature) PutTemperatures(family, *layout, datagram, &writer);
  if (layout->extra != StimExtra::kNone) {
    const StimExtraValue extra = datagram.extra.value_or(StimExtraValue{});
    writer.Put(extra.counts, 3);
    writer.Put(extra.status, 1);
  }
  if (layout->has_reserved) writer.Put(0, 3);
  if (layout->has_counter) writer.Put(datagram.counter.value_or(0), 1);
  if (layout->has_latency) writer.Put(datagram.latency_us.value_or(0), 2);
  if (family == StimFamily::kStim300) {
    writer.Put(StimCrc32(writer.bytes()), 4);
  } else {
    writer.Put(StimCrc8(writer.bytes()), 1);
  }
  if (has_terminator) writer.Put(0x0D0A, 2);
  return writer.Take();
}

StimCluster ClusterOf(const Eigen::Vector3d& value, double unit) {
  constexpr double kLargest = (1 << 23) - 1;
  StimCluster cluster;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double counts = std::round(value[static_cast<Eigen::Index>(axis)] / unit);
    cluster.counts[axis] = static_cast<std::int32_t>(std::clamp(counts, -kLargest - 1.0, kLargest));
  }
  return cluster;
}

StimDatagram StimFromReading(StimFamily family,
                             std::uint8_t id,
                             const StimReading& reading,
                             const StimScales& scales) {
  const StimLayout* layout = FindStimLayout(family, id);
  TBM_CHECK(layout != nullptr);
  const Eigen::Vector3d nothing = Eigen::Vector3d::Zero();
  StimDatagram datagram;
  datagram.id = id;
  datagram.gyro = ClusterOf(reading.rate_rad_s, GyroUnit_rad_s(scales));
  if (layout->has_accel) {
    datagram.accel =
        ClusterOf(reading.specific_force_m_s2.value_or(nothing), AccelUnit_m_s2(scales));
  }
  if (layout->has_tilt) {
    datagram.tilt = ClusterOf(reading.tilt_force_m_s2.value_or(nothing), TiltUnit_m_s2(scales));
  }
  if (layout->has_temperature) {
    datagram.gyro_temperature = TemperatureCluster(reading.gyro_temperature_celsius);
    if (layout->has_accel) {
      datagram.accel_temperature = TemperatureCluster(reading.accel_temperature_celsius);
    }
    if (layout->has_tilt) datagram.tilt_temperature = TemperatureCluster(std::nullopt);
  }
  if (layout->extra != StimExtra::kNone) datagram.extra.emplace();
  if (layout->has_counter) datagram.counter = 0;
  if (layout->has_latency) datagram.latency_us = 0;
  return datagram;
}

}  // namespace tbm
