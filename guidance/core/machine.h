#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "guidance/shield/coast.h"
#include "guidance/shield/front_shield.h"
#include "guidance/shield/rear_shield.h"
#include "guidance/shield/trend.h"
#include "pose/rig/rig.h"

namespace tbm {

inline constexpr std::size_t kMaxGuidedPoints = 16;

enum class ShieldName { kRear, kFront };

// A prism on the rear shield, as the total station's observations call it.
struct NamedPrism {
  std::string name;
  ShieldPrism prism;
};

// A point of the machine that is guided: cutter face, articulation, whatever the project adds.
struct MachinePoint {
  std::string name;
  ShieldName shield = ShieldName::kFront;
  Eigen::Vector3d p_in_shield = Eigen::Vector3d::Zero();  // [m] x forward, y left, z up
  double sigma_m = 0.0;                                   // of each coordinate
};

// How rings are counted: along the axis, in lengths of one ring, by the rear shield's datum.
struct RingCount {
  std::int64_t first_number = 1;
  double first_chainage_m = 0.0;  // internal, where ring `first_number` begins
  double length_m = 0.0;          // > 0
};

// An alarm limit: raised above the one, cleared below the other, in SI units.
struct AlarmLimit {
  double raise_above = 0.0;
  double clear_below = 0.0;
};

// In which time each source renews itself, and when it is too old to be used.
struct SourceLimits {
  double period_s = 1.0;
  double stale_after_s = 10.0;
};

// Where everything is built into the machine, and by what rules it is watched: what machine.yaml
// says, in SI units. Immutable after loading.
struct Machine {
  std::string machine_id;
  MachineGeometry geometry;
  std::vector<NamedPrism> prisms;    // 1 .. kMaxPrisms, names differ
  std::vector<MachinePoint> points;  // 1 .. kMaxGuidedPoints, names differ
  std::size_t steer_by = 0;          // into points; on the front shield
  std::optional<RingCount> rings;
  // Forward distance from the rear shield's datum to the front shield's with the telescopic joint
  // closed; the stroke counts from there.
  std::optional<double> closed_joint_m;

  SourceLimits station{30.0, 900.0};
  SourceLimits camera{0.5, 120.0};
  SourceLimits tilt{0.5, 10.0};
  double useful_sigma_m = 0.025;  // of a deviation: beyond it nothing is published as valid
  CoastOptions coast;
  TrackOptions track;
  double trend_length_m = 5.0;
  // Observations that lie further apart in time do not make one fix of the rear shield.
  double fix_window_s = 60.0;

  AlarmLimit deviation_m{0.050, 0.045};            // of steer_by, right and up together
  AlarmLimit predicted_deviation_m{0.080, 0.070};  // 10 m ahead
  AlarmLimit roll_rad{0.0175, 0.0150};             // of the front shield, either way
  AlarmLimit sigma_m{0.015, 0.012};                // of steer_by's deviation
};

}  // namespace tbm
