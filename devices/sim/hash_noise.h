#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace tbm::sim {

// Randomness as a function of a place in time rather than of what was drawn before: two simulators
// that ask about the same instant get the same answer, in any order.
inline std::uint64_t Mixed(std::uint64_t x) {  // splitmix64's finaliser
  x += 0x9E3779B97F4A7C15ull;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31);
}

// (0, 1]
inline double UnitFrom(std::uint64_t bits) {
  return (static_cast<double>(bits >> 11) + 1.0) * 0x1.0p-53;
}

// Standard normal, by Box and Muller.
inline double NormalFrom(std::uint64_t key) {
  const double radius = std::sqrt(-2.0 * std::log(UnitFrom(Mixed(key))));
  return radius * std::cos(2.0 * std::numbers::pi * UnitFrom(Mixed(key ^ 0x5851F42D4C957F2Dull)));
}

}  // namespace tbm::sim
