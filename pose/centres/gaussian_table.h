#pragma once

#include <cstddef>

#include "pose/centres/elementary.h"
#include "pose/centres/vectors.h"

namespace tbm {

inline constexpr std::size_t kTableLanes = 4;
inline std::size_t RoundUpToLanes(int count) {
  return (static_cast<std::size_t>(count) + kTableLanes - 1) / kTableLanes * kTableLanes;
}

// A unit Gaussian's values g at x = first_x, first_x + 1, ..., four at a time: four g, four x, four
// (x / sigma)^2, then the next. Room for `count` rounded up to four; g is zero beyond `count`.
inline constexpr std::size_t kTableGroup = 3 * kTableLanes;
inline void FillGaussian(float first_x, int count, float sigma, float* table) {
  using namespace vectors;
  const float ramp[4] = {0.0f, 1.0f, 2.0f, 3.0f};
  const Floats inverse = Spread(1.0f / sigma);
  const Floats farthest = Spread(kFarthestExponent);
  const Floats half = Spread(0.5f);
  Floats x = Spread(first_x) + Load(ramp);
  const float* end = table + 3 * RoundUpToLanes(count);
  for (float* group = table; group < end; group += kTableGroup) {
    const Floats in_sigmas = x * inverse;
    const Floats squared = in_sigmas * in_sigmas;
    Store(group, ExpOfMinus(Smaller(half * squared, farthest)));
    Store(group + kTableLanes, x);
    Store(group + 2 * kTableLanes, squared);
    x = x + Spread(4.0f);
  }
  const std::size_t lanes = static_cast<std::size_t>(count) % kTableLanes;
  if (lanes == 0) return;
  for (std::size_t i = lanes; i < kTableLanes; ++i)
    table[3 * (RoundUpToLanes(count) - 4) + i] = 0.0f;
}

// One place of such a table.
struct GaussianAt {
  float g;
  float x;
  float square;
};
inline GaussianAt At(const float* table, std::size_t i) {
  const float* group = table + i / kTableLanes * kTableGroup + i % kTableLanes;
  return {group[0], group[kTableLanes], group[2 * kTableLanes]};
}

}  // namespace tbm
