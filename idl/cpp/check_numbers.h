#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>

#include "idl/cpp/boundary.h"
#include "idl/cpp/guidance_messages.h"

// What the rules of the contract are made of.
namespace tbm::dds {

inline constexpr double kUnitTolerance = 1e-6;  // of a quaternion's length: far above rounding
inline constexpr std::int64_t kNeverNs = kNever.ns;

inline bool IsTime(std::int64_t ns) { return ns > 0; }
inline bool IsTimeOrNever(std::int64_t ns) { return ns > 0 || ns == kNeverNs; }

inline bool AllNaN(std::initializer_list<double> numbers) {
  for (const double x : numbers) {
    if (!std::isnan(x)) return false;
  }
  return true;
}
template <std::size_t N>
bool AllNaN(const std::array<double, N>& numbers) {
  for (const double x : numbers) {
    if (!std::isnan(x)) return false;
  }
  return true;
}
inline bool AllFinite(std::initializer_list<double> numbers) {
  for (const double x : numbers) {
    if (!std::isfinite(x)) return false;
  }
  return true;
}
template <std::size_t N>
bool AllFinite(const std::array<double, N>& numbers) {
  for (const double x : numbers) {
    if (!std::isfinite(x)) return false;
  }
  return true;
}
inline bool NoneInfinite(std::initializer_list<double> numbers) {
  for (const double x : numbers) {
    if (std::isinf(x)) return false;
  }
  return true;
}
// Spreads, shares, ages: not known, or zero and more.
inline bool NoneNegative(std::initializer_list<double> numbers) {
  for (const double x : numbers) {
    if (!(std::isnan(x) || (std::isfinite(x) && x >= 0.0))) return false;
  }
  return true;
}

// Square, finite, no negative variance, equal to its transpose but for rounding.
template <std::size_t N>
BoundaryFault CheckCovariance(const std::array<double, N>& covariance, std::size_t size) {
  if (!AllFinite(covariance)) return BoundaryFault::kNotFinite;
  for (std::size_t row = 0; row < size; ++row) {
    if (covariance[row * (size + 1)] < 0.0) return BoundaryFault::kOutOfRange;
    for (std::size_t column = 0; column < row; ++column) {
      const double scale =
          std::sqrt(covariance[row * (size + 1)] * covariance[column * (size + 1)]);
      const double skew = covariance[row * size + column] - covariance[column * size + row];
      if (std::abs(skew) > 1e-6 * scale) return BoundaryFault::kOutOfRange;
    }
  }
  return BoundaryFault::kNone;
}

template <class... Words>
bool AnyEmpty(const Words&... words) {
  return ((words.size() == 0) || ...);
}

}  // namespace tbm::dds
