#pragma once

#include <vector>

#include "devices/imu/stim_reading.h"

namespace tbm {

// The unit's side. What the layout of the datagram's identifier has no place for is left out, what
// it lacks goes out as zero. The identifier must be one of the family.
std::vector<std::uint8_t> EncodeStim(StimFamily family,
                                     const StimDatagram& datagram,
                                     bool has_terminator);

// The nearest counts, at most as large as 24 bits can say.
StimCluster ClusterOf(const Eigen::Vector3d& value, double unit);

// A datagram with everything its identifier has a place for; status bytes zero.
StimDatagram StimFromReading(StimFamily family,
                             std::uint8_t id,
                             const StimReading& reading,
                             const StimScales& scales);

}  // namespace tbm
