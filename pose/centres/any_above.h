#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

namespace tbm {

// Is any pixel of a block of kBlockWidth columns and some rows brighter than a threshold? The only
// loop that reads every pixel of an image, and the only code that is worth writing for a vector
// unit. Both versions give the same answer for every input (tested), so a run replays bit for bit
// anywhere.
inline constexpr int kBlockWidth = 64;

template <class Pixel>
inline Pixel LoadPixel(const std::byte* at) {
  Pixel pixel;
  std::memcpy(&pixel, at, sizeof(Pixel));
  return pixel;
}

// Any width; for the last columns and where there is no vector unit.
template <class Pixel>
inline bool AnyAbovePlain(
    const std::byte* first, std::ptrdiff_t stride_bytes, int columns, int rows, int threshold) {
  for (int row = 0; row < rows; ++row) {
    const std::byte* at = first + row * stride_bytes;
    for (int column = 0; column < columns; ++column, at += sizeof(Pixel)) {
      if (LoadPixel<Pixel>(at) > threshold) return true;
    }
  }
  return false;
}

#if defined(__GNUC__)
// `kColumns` columns, a multiple of 16. Vectors of 16 bytes (SSE2, NEON), up to four maxima at a
// time to hide the latency, and one comparison at the end.
template <class Pixel, int kColumns = kBlockWidth>
inline bool AnyAbove(const std::byte* first, std::ptrdiff_t stride_bytes, int rows, int threshold) {
  using Vector [[gnu::vector_size(16)]] = Pixel;
  constexpr int kLanes = 16 / sizeof(Pixel);
  constexpr int kVectors = kColumns / kLanes;
  constexpr int kAtOnce = kVectors < 4 ? kVectors : 4;
  static_assert(kColumns % 16 == 0 && kVectors % kAtOnce == 0);
  if (threshold < 0) return rows > 0;
  if (threshold >= std::numeric_limits<Pixel>::max()) return false;
  const auto load = [](const std::byte* at) {
    Vector v;
    std::memcpy(&v, at, sizeof v);
    return v;
  };
  const auto larger = [](Vector a, Vector b) { return a > b ? a : b; };
  Vector best[4] = {};
  for (int row = 0; row < rows; ++row) {
    const std::byte* at = first + row * stride_bytes;
    for (int i = 0; i < kVectors; i += kAtOnce) {
      for (int j = 0; j < kAtOnce; ++j) best[j] = larger(best[j], load(at + 16 * (i + j)));
    }
  }
  const Vector brightest = larger(larger(best[0], best[1]), larger(best[2], best[3]));
  const auto above = brightest > Vector{} + static_cast<Pixel>(threshold);
  std::uint64_t halves[2];
  static_assert(sizeof halves == sizeof above);
  std::memcpy(halves, &above, sizeof above);
  return (halves[0] | halves[1]) != 0;
}
#else
template <class Pixel, int kColumns = kBlockWidth>
inline bool AnyAbove(const std::byte* first, std::ptrdiff_t stride_bytes, int rows, int threshold) {
  return AnyAbovePlain<Pixel>(first, stride_bytes, kColumns, rows, threshold);
}
#endif

}  // namespace tbm
