#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>

namespace tbm {

// How often a normal variable is further from its mean than so many sigma, to either side.
inline double TwoSidedTail(double sigmas) {
  return std::erfc(std::abs(sigmas) / std::numbers::sqrt2);
}

// Whether so large a change is found anywhere among `count` places that have not moved in less than
// 1 - `level` of all cases, however their errors hang together (Bonferroni). `sigma` > 0, in the
// unit of the change.
inline bool IsMoreThanChance(double change, double sigma, std::size_t count, double level) {
  return TwoSidedTail(change / sigma) * static_cast<double>(count) < 1.0 - level;
}

}  // namespace tbm
