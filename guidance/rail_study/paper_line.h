#pragma once

#include "guidance/rail/rail_line.h"

namespace tbm {

// The line as the rail-line paper has it, for comparison: an extended Kalman filter of position,
// velocity, attitude and the two biases, corrected by the image points of known targets (its
// Eqs. 22..28 with the corrections of their misprints: gravity in the velocity, the attitude's
// error as a rotation, the camera's position taken off in the camera's own frame). Its state has
// eighteen rows; the last three, constants of the inclinometer, are in no measurement of it and do
// nothing: they are left out. How the camera is built in, its clock and the targets are taken as
// exact; neither tilt nor rest is a measurement; nothing is smoothed.
Result<RailLine, RailStartFailure> SolvePaperLine(const RailSetup& setup,
                                                  const RailRecording& recording);

}  // namespace tbm
