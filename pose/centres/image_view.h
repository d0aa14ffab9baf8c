#pragma once

#include <cstddef>
#include <cstdint>

namespace tbm {

// A grey image that somebody else owns. Rows may be padded; 16-bit pixels are in host order and may
// use fewer than 16 bits (max_value says how many: 4095 for a 12-bit camera).
struct ImageView {
  const void* pixels = nullptr;  // first pixel of the first row
  int width_px = 0;
  int height_px = 0;
  std::ptrdiff_t stride_bytes = 0;  // from one row to the next, >= width * bytes per pixel
  int bytes_per_pixel = 1;          // 1 or 2
  std::uint32_t max_value = 255;    // full scale: a pixel at or above it is clipped
};

}  // namespace tbm
