#pragma once

#include <optional>

#include <Eigen/Core>

#include "guidance/axis/design_axis.h"
#include "guidance/shield/uncertain.h"

namespace tbm {

// Where one point of the machine stands against the design axis.
struct Deviation {
  InternalChainage chainage;
  OfficialChainage official;
  double right_m = 0.0;        // horizontal, + to the right of the drive
  std::optional<double> up_m;  // plumb, + above; absent where the design has no profile
  double along_sigma_m = 0.0;  // of the chainage
  double right_sigma_m = 0.0;
  double up_sigma_m = 0.0;  // of the height, also where there is no profile to compare with
  double right_up_correlation = 0.0;
};

// `hint` is the chainage of a moment ago. The point's covariance is taken into the axis' directions
// at the foot; on a gradient an error along the axis moves the height difference too.
Result<Deviation, AxisFailure> DeviationOf(const DesignAxis& axis,
                                           const UncertainPoint& p_in_site,
                                           std::optional<InternalChainage> hint);

// How the shield's own axis points against the design axis at its datum: what the deviation will
// change by, a metre further on, if the shield goes where it points.
struct Lead {
  double right_per_m = 0.0;        // lead: + the nose points to the right
  std::optional<double> up_per_m;  // look-up: + the nose points above the gradient
  double right_sigma_per_m = 0.0;
  double up_sigma_per_m = 0.0;
};
Result<Lead, AxisFailure> LeadOf(const DesignAxis& axis,
                                 const UncertainRigid3& site_from_shield,
                                 std::optional<InternalChainage> hint);

}  // namespace tbm
