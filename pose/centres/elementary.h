#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "pose/centres/vectors.h"

// Exponential and logarithm as far as the finder needs them, with the same bits on every machine:
// the last digit of a C library's depends on the processor.
namespace tbm {

// Exponents of the Gaussian's tables end here: nearly five sigmas out, where 6e-6 of a spot
// is left. Keeps products of three values of both tables far above the smallest float.
inline constexpr float kFarthestExponent = 12.0f;

// exp(-h) for 0 <= h <= kFarthestExponent, within 6e-7. The same bits on every machine, which the
// exp of a C library is not.
inline vectors::Floats ExpOfMinus(vectors::Floats h) {
  using namespace vectors;
  // 2^-f on 0 <= f < 1, interpolated at the Chebyshev nodes.
  const Floats halvings = h * Spread(1.44269504f);
  const Floats whole = Whole(halvings);
  const Floats f = halvings - whole;
  Floats sum = MulAdd(Spread(0.00934423101f), f, Spread(-0.00100363051f));
  sum = MulAdd(Spread(-0.0554085595f), f, sum);
  sum = MulAdd(Spread(0.240214690f), f, sum);
  sum = MulAdd(Spread(-0.693146945f), f, sum);
  return Halved(MulAdd(Spread(1.0f), f, sum), whole);
}

// The same for one number; beyond the farthest exponent it stays where it is.
inline double DecayOf(double h) {
  const auto exponent = static_cast<float>(std::min(h, static_cast<double>(kFarthestExponent)));
  float lanes[4];
  vectors::Store(lanes, ExpOfMinus(vectors::Spread(exponent)));
  return static_cast<double>(lanes[0]);
}

// Natural logarithm of a normal x > 0, within 1e-9.
inline double LogOf(double x) {
  constexpr double kLog2 = 0.69314718055994531;
  constexpr std::uint64_t kFraction = (std::uint64_t{1} << 52) - 1;
  std::uint64_t bits = 0;
  std::memcpy(&bits, &x, sizeof bits);
  auto exponent = static_cast<int>(bits >> 52) - 1023;
  const std::uint64_t mantissa_bits = (bits & kFraction) | (std::uint64_t{1023} << 52);
  double mantissa = 0.0;
  std::memcpy(&mantissa, &mantissa_bits, sizeof mantissa);
  if (mantissa > 1.41421356) {
    mantissa *= 0.5;
    ++exponent;
  }
  // 2 artanh s, |s| < 0.172.
  const double s = (mantissa - 1.0) / (mantissa + 1.0);
  const double ss = s * s;
  const double series =
      1.0 + ss * (1.0 / 3.0 + ss * (0.2 + ss * (1.0 / 7.0 + ss * (1.0 / 9.0 + ss / 11.0))));
  return exponent * kLog2 + 2.0 * s * series;
}

}  // namespace tbm
