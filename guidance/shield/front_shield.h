#pragma once

#include <optional>

#include <Eigen/Core>

#include "guidance/shield/rear_shield.h"
#include "guidance/shield/uncertain.h"
#include "pose/rig/rig.h"
#include "pose/solve/problem.h"

namespace tbm {

// How camera and LED board are built into the shields, from the workshop's survey.
struct MachineGeometry {
  UncertainRigid3 rear_shield_from_camera;
  UncertainRigid3 front_shield_from_target;
};

// The rear shield's up direction from the camera's inclinometer, for FixRearShield. `sigma_rad` of
// the reading alone, averaged over the cycle; mounting and the camera's place in the shield are
// added. Empty for a reading that has no up vector.
std::optional<UpFix> UpOfRearShield(const Rig& rig,
                                    const MachineGeometry& geometry,
                                    const Inclination& camera_tilt,
                                    double sigma_rad);

// The relative pose as the camera box solved it, with the tilts it was solved with.
struct RelativeFix {
  UncertainRigid3 camera_from_target;
  // Empty where the tilts were not in the solution.
  std::optional<TiltObservation> target_tilt;
  std::optional<TiltObservation> camera_tilt;
};

// Where the front shield is: rear shield x camera x relative pose x board.
//
// The camera's inclinometer is in this twice: it levels the rear shield, and it is one of the two
// tilts of the relative pose. An error of its mounting turns the rear shield one way and the
// relative pose the other, and cancels where both rest on it. The same goes for the camera's own
// place in the rear shield. Covariances between the factors carry that; taken as independent, the
// cutter head's sigma is up to 1.8 times too large (measured: guidance/shield/docs/chain.md).
//
// `rear` must have been fixed with UpOfRearShield where it has an up reading at all.
UncertainRigid3 FrontShieldInSite(const RearShieldFix& rear,
                                  const Rig& rig,
                                  const MachineGeometry& geometry,
                                  const RelativeFix& relative);

}  // namespace tbm
