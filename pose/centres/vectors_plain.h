#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

// The operations of vectors.h written out, one lane after the other: what they mean.
namespace tbm {

inline constexpr int kBlockRows = 8;

template <class Pixel>
inline Pixel LoadPixel(const std::byte* at) {
  Pixel pixel;
  std::memcpy(&pixel, at, sizeof(Pixel));
  return pixel;
}

namespace plain {

struct Floats {
  float lane[4];
};
struct Mask {
  bool lane[4];
};
template <class Pixel>
struct Pixels {
  Pixel lane[16 / sizeof(Pixel)];
};

template <class Operation>
inline Floats EachLane(Operation operation) {
  return {operation(0), operation(1), operation(2), operation(3)};
}

inline Floats Load(const float* at) { return {at[0], at[1], at[2], at[3]}; }
inline void Store(float* at, const Floats& a) { std::memcpy(at, a.lane, sizeof a.lane); }
inline Floats Spread(float value) { return {value, value, value, value}; }
inline Floats operator+(const Floats& a, const Floats& b) {
  return EachLane([&](int i) { return a.lane[i] + b.lane[i]; });
}
inline Floats operator-(const Floats& a, const Floats& b) {
  return EachLane([&](int i) { return a.lane[i] - b.lane[i]; });
}
inline Floats operator*(const Floats& a, const Floats& b) {
  return EachLane([&](int i) { return a.lane[i] * b.lane[i]; });
}
inline Floats MulAdd(const Floats& sum, const Floats& a, const Floats& b) { return sum + a * b; }
inline Floats MulSub(const Floats& sum, const Floats& a, const Floats& b) { return sum - a * b; }
// Of 0 and -0 either one.
inline Floats Smaller(const Floats& a, const Floats& b) {
  return EachLane([&](int i) { return a.lane[i] < b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline Floats Larger(const Floats& a, const Floats& b) {
  return EachLane([&](int i) { return a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline Floats Absolute(const Floats& a) {
  return EachLane([&](int i) { return std::fabs(a.lane[i]); });
}
inline Mask operator&(const Mask& a, const Mask& b) {
  Mask mask;
  for (int i = 0; i < 4; ++i) mask.lane[i] = a.lane[i] && b.lane[i];
  return mask;
}
inline Mask operator|(const Mask& a, const Mask& b) {
  Mask mask;
  for (int i = 0; i < 4; ++i) mask.lane[i] = a.lane[i] || b.lane[i];
  return mask;
}
inline bool Any(const Mask& a) { return a.lane[0] || a.lane[1] || a.lane[2] || a.lane[3]; }
// `a` where the mask is set, zero elsewhere.
inline Floats Where(const Mask& mask, const Floats& a) {
  return EachLane([&](int i) { return mask.lane[i] ? a.lane[i] : 0.0f; });
}
// The last lane of `before`, then the first three of `here`: every lane's left neighbour.
inline Floats LeftNeighbours(const Floats& before, const Floats& here) {
  return {before.lane[3], here.lane[0], here.lane[1], here.lane[2]};
}
inline float Sum(const Floats& a) { return (a.lane[0] + a.lane[1]) + (a.lane[2] + a.lane[3]); }
// Rounded towards zero; |a| < 2^31.
inline Floats Whole(const Floats& a) {
  return EachLane([&](int i) { return static_cast<float>(static_cast<std::int32_t>(a.lane[i])); });
}
namespace detail {
inline float OfBits(std::uint32_t bits) {
  float value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}
inline std::uint32_t BitsOf(float value) {
  std::uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}
}  // namespace detail
// By the bits of both as whole numbers: right unless both are negative or one is -0.
inline Mask IsLess(const Floats& a, const Floats& b) {
  Mask mask;
  for (int i = 0; i < 4; ++i) {
    mask.lane[i] = static_cast<std::int32_t>(detail::BitsOf(a.lane[i])) <
                   static_cast<std::int32_t>(detail::BitsOf(b.lane[i]));
  }
  return mask;
}
// a * 2^-whole, whole numbers >= 0; the result must not fall below the smallest normal number.
inline Floats Halved(const Floats& a, const Floats& whole) {
  return EachLane([&](int i) {
    const auto times = static_cast<std::uint32_t>(static_cast<std::int32_t>(whole.lane[i]));
    return detail::OfBits(detail::BitsOf(a.lane[i]) - (times << 23));
  });
}
// Within an eighth of 1 / a, for 1e-36 < a < 1e36.
inline Floats RoughReciprocal(const Floats& a) {
  return EachLane([&](int i) { return detail::OfBits(0x7EF311C3u - detail::BitsOf(a.lane[i])); });
}

template <class Pixel>
inline Pixels<Pixel> LoadPixels(const std::byte* at) {
  Pixels<Pixel> a;
  std::memcpy(a.lane, at, sizeof a.lane);
  return a;
}
template <class Pixel>
inline void StorePixels(std::byte* at, const Pixels<Pixel>& a) {
  std::memcpy(at, a.lane, sizeof a.lane);
}
template <class Pixel>
inline Pixels<Pixel> SpreadPixel(Pixel value) {
  Pixels<Pixel> a;
  for (Pixel& lane : a.lane) lane = value;
  return a;
}
template <class Pixel>
inline Pixels<Pixel> Brighter(const Pixels<Pixel>& a, const Pixels<Pixel>& b) {
  Pixels<Pixel> c;
  for (std::size_t i = 0; i < 16 / sizeof(Pixel); ++i) {
    c.lane[i] = a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i];
  }
  return c;
}
// a - b where that is positive, else zero.
template <class Pixel>
inline Pixels<Pixel> Above(const Pixels<Pixel>& a, const Pixels<Pixel>& b) {
  Pixels<Pixel> c;
  for (std::size_t i = 0; i < 16 / sizeof(Pixel); ++i) {
    c.lane[i] = static_cast<Pixel>(a.lane[i] > b.lane[i] ? a.lane[i] - b.lane[i] : 0);
  }
  return c;
}
template <class Pixel>
inline bool AnyLane(const Pixels<Pixel>& a) {
  for (const Pixel lane : a.lane) {
    if (lane != 0) return true;
  }
  return false;
}
template <class Pixel>
inline Pixels<Pixel> Darker(const Pixels<Pixel>& a, const Pixels<Pixel>& b) {
  Pixels<Pixel> c;
  for (std::size_t i = 0; i < 16 / sizeof(Pixel); ++i) {
    c.lane[i] = a.lane[i] < b.lane[i] ? a.lane[i] : b.lane[i];
  }
  return c;
}
template <class Pixel>
inline std::uint32_t SumOfLanes(const Pixels<Pixel>& a) {
  std::uint32_t sum = 0;
  for (const Pixel lane : a.lane) sum += lane;
  return sum;
}
// The brightest of two neighbouring blocks of 32 columns and kBlockRows rows, each in 16 bytes.
template <class Pixel>
struct BlockPair {
  Pixels<Pixel> left;
  Pixels<Pixel> right;
};
template <class Pixel>
inline Pixels<Pixel> BrightestOfBlock(const std::byte* at, std::ptrdiff_t stride_bytes) {
  Pixels<Pixel> best = LoadPixels<Pixel>(at);
  for (int row = 0; row < kBlockRows; ++row, at += stride_bytes) {
    for (std::size_t i = 0; i < 2 * sizeof(Pixel); ++i) {
      best = Brighter(best, LoadPixels<Pixel>(at + 16 * i));
    }
  }
  return best;
}
template <class Pixel>
inline BlockPair<Pixel> BrightestOfBlocks(const std::byte* at, std::ptrdiff_t stride_bytes) {
  return {BrightestOfBlock<Pixel>(at, stride_bytes),
          BrightestOfBlock<Pixel>(at + 32 * sizeof(Pixel), stride_bytes)};
}
// Bit i: pixel i of 32 is above the threshold.
template <class Pixel>
inline std::uint32_t BitsAbove(const std::byte* at, Pixel threshold) {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < 32; ++i) {
    const bool above = LoadPixel<Pixel>(at + i * sizeof(Pixel)) > threshold;
    bits |= std::uint32_t{above} << i;
  }
  return bits;
}
// Sixteen pixels as floats.
template <class Pixel>
inline void Widen(const std::byte* at, float* to) {
  for (std::size_t i = 0; i < 16; ++i) to[i] = LoadPixel<Pixel>(at + i * sizeof(Pixel));
}

}  // namespace plain

}  // namespace tbm
