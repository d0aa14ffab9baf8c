#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "guidance/station/reduce.h"
#include "guidance/station/reference_check.h"
#include "guidance/station/set_up.h"
#include "pose/base/time.h"

namespace tbm {

// A reference in the tunnel, as surveyed.
struct NamedReference {
  std::string name;
  Reference reference;
  // Measured with each set-up and each check, and never used by a set-up: it proves the others.
  bool is_control = false;
};

// How one reference stood in a set-up and in the last check.
struct KeptReference {
  std::string name;
  bool is_used = false;
  std::string reason;  // left_out, moved, not_seen, control; empty: nothing odd
  std::optional<SightingResidual> residual;
};

// A set-up as it is kept: enough to compare later readings with, and to come back after a restart.
struct KeptSetUp {
  std::uint64_t number = 0;  // from 1, never used again
  Station station;
  StationCovariance covariance = StationCovariance::Zero();
  AxisErrors axis_errors;       // of the instrument, as its two faces showed them
  double axis_sigma_rad = 0.0;  // of each of the two
  Timestamp set_up_at;
  Timestamp last_good_check_at;
  double chi2 = 0.0;
  int dof = -1;
  std::optional<double> sees_m;
  std::int64_t instrument = 0;  // serial number
  // What the references were read as; `reference` is an index into `references`.
  std::vector<ReferenceSighting> sightings;
  std::vector<KeptReference> references;  // in the order of the config at that time
};

// A point that stood still while it was measured by a set-up: what a station move is compared with.
struct ControlPoint {
  std::string name;
  Timestamp at;
  Eigen::Vector3d p_in_site = Eigen::Vector3d::Zero();
};

// All that outlives a restart. It is written whole or not at all.
struct KeptStation {
  std::uint64_t last_number = 0;  // of the set-ups so far
  std::optional<KeptSetUp> in_use;
  std::optional<KeptSetUp> previous;  // what an undone move goes back to
  std::vector<ControlPoint> controls;
};

}  // namespace tbm
