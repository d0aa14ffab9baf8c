#pragma once

#include <cstddef>

#include <Eigen/Core>

#include "pose/base/fixed_vector.h"

namespace tbm {

// A bright spot as it was found in one image. DN = grey values of the image.
struct Centre {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();  // (u, v); (0, 0) is the first pixel's centre
  double sigma_px = 0.0;       // one standard deviation per axis, from the spot's own noise
  double peak_dn = 0.0;        // above the background; estimated where the image is clipped
  double background_dn = 0.0;  // at the centre
  double spread_px = 0.0;      // sigma of the spot: sqrt of the mean of its two second moments
  double elongation = 1.0;     // longer axis by shorter axis of the spot, >= 1
  int clipped_pixels = 0;      // pixels at full scale inside the spot
};

inline constexpr std::size_t kMaxCentres = 64;
using Centres = FixedVector<Centre, kMaxCentres>;

}  // namespace tbm
