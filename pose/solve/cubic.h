#pragma once

#include "pose/base/fixed_vector.h"

namespace tbm {

// Real roots of c3 x^3 + c2 x^2 + c1 x + c0, polished by Newton. c3 must not be small against the
// rest: callers turn the polynomial around (x -> 1 / x) where it is.
FixedVector<double, 3> CubicRoots(double c3, double c2, double c1, double c0);

}  // namespace tbm
