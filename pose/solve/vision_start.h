#pragma once

#include "pose/solve/problem.h"

namespace tbm {

// Start poses for LEDs without tilts, best first, at most four.
using VisionStarts = FixedVector<Rigid3, 4>;

// P3P over a few well-spread triples of LEDs; all poses are ranked by how well they place every LED
// seen, and repeated ones are dropped. Empty when the LEDs stand on one line, or none fits.
VisionStarts StartVision(const PoseProblem& problem);

}  // namespace tbm
