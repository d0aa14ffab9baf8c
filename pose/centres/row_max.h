#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace tbm {

// Brightest pixel of a block of kBlockWidth columns and some rows: the only loop that reads every
// pixel of an image, and the only code that has to be written anew for another vector unit. Both
// versions give the same number for every input (tested), so a run replays bit for bit anywhere.
inline constexpr int kBlockWidth = 64;

template <class Pixel>
inline Pixel LoadPixel(const std::byte* at) {
  Pixel pixel;
  std::memcpy(&pixel, at, sizeof(Pixel));
  return pixel;
}

// Any width; for the last columns and where there is no vector unit.
template <class Pixel>
inline Pixel BlockMaxPlain(const std::byte* first,
                           std::ptrdiff_t stride_bytes,
                           int columns,
                           int rows) {
  Pixel brightest = 0;
  for (int row = 0; row < rows; ++row) {
    const std::byte* at = first + row * stride_bytes;
    for (int column = 0; column < columns; ++column, at += sizeof(Pixel)) {
      brightest = std::max(brightest, LoadPixel<Pixel>(at));
    }
  }
  return brightest;
}

#if defined(__GNUC__)
// kBlockWidth columns. Vectors of 16 bytes (SSE2, NEON): four independent maxima hide the latency.
template <class Pixel>
inline Pixel BlockMax(const std::byte* first, std::ptrdiff_t stride_bytes, int rows) {
  using Vector [[gnu::vector_size(16)]] = Pixel;
  constexpr int kLanes = 16 / sizeof(Pixel);
  constexpr int kVectors = kBlockWidth / kLanes;
  const auto load = [](const std::byte* at) {
    Vector v;
    std::memcpy(&v, at, sizeof v);
    return v;
  };
  const auto larger = [](Vector a, Vector b) { return a > b ? a : b; };
  Vector best[4] = {};
  for (int row = 0; row < rows; ++row) {
    const std::byte* at = first + row * stride_bytes;
    for (int i = 0; i < kVectors; i += 4) {
      for (int j = 0; j < 4; ++j) best[j] = larger(best[j], load(at + 16 * (i + j)));
    }
  }
  const Vector all = larger(larger(best[0], best[1]), larger(best[2], best[3]));
  Pixel brightest = 0;
  for (int lane = 0; lane < kLanes; ++lane) brightest = std::max<Pixel>(brightest, all[lane]);
  return brightest;
}
#else
template <class Pixel>
inline Pixel BlockMax(const std::byte* first, std::ptrdiff_t stride_bytes, int rows) {
  return BlockMaxPlain<Pixel>(first, stride_bytes, kBlockWidth, rows);
}
#endif

}  // namespace tbm
