#pragma once

#include "guidance/rail/rail_line.h"

namespace tbm {

// The line as the patent has it (CN106052584, steps 2 and 3), for comparison: attitude by a
// fourth-order Runge-Kutta step of the quaternion, acceleration turned into the world and
// integrated twice; the biases are those of the rest at the start. Its compensation by image
// displacement is not in it. Where the trolley rests again its velocity is known to be none: what
// the integration has gathered by then is taken out in equal parts. A quiet span counts as rest
// where the velocity is none within five of its sigma and most of it is gone, for an even motion on
// an even rail is quiet as well. Between rests nothing holds it: sigma is the growth of the unit's
// noise and of what its rest could tell of the biases, with what the heading may be wrong, and
// where samples are missing of what may have happened meanwhile.
Result<RailLine, RailStartFailure> SolveInertialLine(const RailSetup& setup,
                                                     const RailRecording& recording);

}  // namespace tbm
