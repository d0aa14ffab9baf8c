#pragma once

#include <array>
#include <cstddef>

namespace tbm {

// Integral by Gauss-Legendre with eight points in each of `pieces` equal pieces: exact to rounding
// for what is smooth on the scale of a piece.
template <class Function>
double IntegrateGauss(const Function& function, double from, double to, int pieces) {
  // Abramowitz and Stegun, table 25.4, n = 8.
  constexpr std::array<double, 4> kPlace = {
      0.1834346424956498049, 0.5255324099163289858, 0.7966664774136267396, 0.9602898564975362317};
  constexpr std::array<double, 4> kWeight = {
      0.3626837833783619830, 0.3137066458778872873, 0.2223810344533744706, 0.1012285362903762591};
  const double half = 0.5 * (to - from) / pieces;
  double sum = 0.0;
  for (int piece = 0; piece < pieces; ++piece) {
    const double middle = from + (2 * piece + 1) * half;
    for (std::size_t i = 0; i < kPlace.size(); ++i) {
      const double offset = half * kPlace[i];
      sum += kWeight[i] * (function(middle - offset) + function(middle + offset));
    }
  }
  return sum * half;
}

}  // namespace tbm
