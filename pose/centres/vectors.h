#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

// The few operations on 16 bytes that the finder is made of, three times: for SSE2, for NEON and
// written out plainly. All three give the same bits for the same input (tested), so a run replays
// bit for bit on any machine. Conditions:
// - NEON takes a float below 1.2e-38 for zero, and so must the code that uses these: it keeps its
//   numbers away from there.
// - No NaN and no infinity.
// - A product is rounded before it is added, also in MulAdd.
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

#if defined(__SSE2__)
namespace native {

struct Floats {
  __m128 v;
};
struct Mask {
  __m128 v;
};
template <class Pixel>
struct Pixels {
  __m128i v;
};

inline Floats Load(const float* at) { return {_mm_loadu_ps(at)}; }
inline void Store(float* at, Floats a) { _mm_storeu_ps(at, a.v); }
inline Floats Spread(float value) { return {_mm_set1_ps(value)}; }
inline Floats operator+(Floats a, Floats b) { return {_mm_add_ps(a.v, b.v)}; }
inline Floats operator-(Floats a, Floats b) { return {_mm_sub_ps(a.v, b.v)}; }
inline Floats operator*(Floats a, Floats b) { return {_mm_mul_ps(a.v, b.v)}; }
inline Floats MulAdd(Floats sum, Floats a, Floats b) { return sum + a * b; }
inline Floats MulSub(Floats sum, Floats a, Floats b) { return sum - a * b; }
inline Floats Smaller(Floats a, Floats b) { return {_mm_min_ps(a.v, b.v)}; }
inline Floats Larger(Floats a, Floats b) { return {_mm_max_ps(a.v, b.v)}; }
inline Floats Absolute(Floats a) { return {_mm_andnot_ps(_mm_set1_ps(-0.0f), a.v)}; }
inline Mask IsLess(Floats a, Floats b) {
  return {_mm_castsi128_ps(_mm_cmplt_epi32(_mm_castps_si128(a.v), _mm_castps_si128(b.v)))};
}
inline Mask operator&(Mask a, Mask b) { return {_mm_and_ps(a.v, b.v)}; }
inline Mask operator|(Mask a, Mask b) { return {_mm_or_ps(a.v, b.v)}; }
inline bool Any(Mask a) { return _mm_movemask_ps(a.v) != 0; }
inline Floats Where(Mask mask, Floats a) { return {_mm_and_ps(mask.v, a.v)}; }
inline Floats LeftNeighbours(Floats before, Floats here) {
  const __m128i low = _mm_srli_si128(_mm_castps_si128(before.v), 12);
  const __m128i high = _mm_slli_si128(_mm_castps_si128(here.v), 4);
  return {_mm_castsi128_ps(_mm_or_si128(low, high))};
}
inline float Sum(Floats a) {
  const __m128 pairs = _mm_add_ps(a.v, _mm_shuffle_ps(a.v, a.v, _MM_SHUFFLE(2, 3, 0, 1)));
  return _mm_cvtss_f32(_mm_add_ss(pairs, _mm_movehl_ps(pairs, pairs)));
}
inline Floats Whole(Floats a) { return {_mm_cvtepi32_ps(_mm_cvttps_epi32(a.v))}; }
inline Floats Halved(Floats a, Floats whole) {
  const __m128i times = _mm_slli_epi32(_mm_cvttps_epi32(whole.v), 23);
  return {_mm_castsi128_ps(_mm_sub_epi32(_mm_castps_si128(a.v), times))};
}
inline Floats RoughReciprocal(Floats a) {
  return {_mm_castsi128_ps(_mm_sub_epi32(_mm_set1_epi32(0x7EF311C3), _mm_castps_si128(a.v)))};
}

template <class Pixel>
inline Pixels<Pixel> LoadPixels(const std::byte* at) {
  return {_mm_loadu_si128(reinterpret_cast<const __m128i*>(at))};
}
template <class Pixel>
inline void StorePixels(std::byte* at, Pixels<Pixel> a) {
  _mm_storeu_si128(reinterpret_cast<__m128i*>(at), a.v);
}
inline Pixels<std::uint8_t> SpreadPixel(std::uint8_t value) {
  return {_mm_set1_epi8(static_cast<char>(value))};
}
inline Pixels<std::uint16_t> SpreadPixel(std::uint16_t value) {
  return {_mm_set1_epi16(static_cast<short>(value))};
}
inline Pixels<std::uint8_t> Above(Pixels<std::uint8_t> a, Pixels<std::uint8_t> b) {
  return {_mm_subs_epu8(a.v, b.v)};
}
inline Pixels<std::uint16_t> Above(Pixels<std::uint16_t> a, Pixels<std::uint16_t> b) {
  return {_mm_subs_epu16(a.v, b.v)};
}
inline Pixels<std::uint8_t> Brighter(Pixels<std::uint8_t> a, Pixels<std::uint8_t> b) {
  return {_mm_max_epu8(a.v, b.v)};
}
inline Pixels<std::uint16_t> Brighter(Pixels<std::uint16_t> a, Pixels<std::uint16_t> b) {
  return {_mm_add_epi16(b.v, _mm_subs_epu16(a.v, b.v))};
}
inline Pixels<std::uint16_t> Darker(Pixels<std::uint16_t> a, Pixels<std::uint16_t> b) {
  return {_mm_sub_epi16(a.v, _mm_subs_epu16(a.v, b.v))};
}
inline Pixels<std::uint8_t> Darker(Pixels<std::uint8_t> a, Pixels<std::uint8_t> b) {
  return {_mm_min_epu8(a.v, b.v)};
}
inline std::uint32_t SumOfLanes(Pixels<std::uint8_t> a) {
  const __m128i halves = _mm_sad_epu8(a.v, _mm_setzero_si128());
  return static_cast<std::uint32_t>(_mm_cvtsi128_si32(halves) + _mm_extract_epi16(halves, 4));
}
inline std::uint32_t SumOfLanes(Pixels<std::uint16_t> a) {
  const __m128i zero = _mm_setzero_si128();
  const __m128i fours = _mm_add_epi32(_mm_unpacklo_epi16(a.v, zero), _mm_unpackhi_epi16(a.v, zero));
  const __m128i pairs = _mm_add_epi32(fours, _mm_srli_si128(fours, 8));
  return static_cast<std::uint32_t>(
      _mm_cvtsi128_si32(_mm_add_epi32(pairs, _mm_srli_si128(pairs, 4))));
}
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
  // Several maxima at a time hide the latency.
  constexpr std::size_t kRegisters = 2 * sizeof(Pixel);  // of one row of one block
  std::array<Pixels<Pixel>, 2 * kRegisters> best;
  for (std::size_t i = 0; i < 2 * kRegisters; ++i) best[i] = LoadPixels<Pixel>(at + 16 * i);
  for (int row = 1; row < kBlockRows; ++row) {
    at += stride_bytes;
    for (std::size_t i = 0; i < 2 * kRegisters; ++i) {
      best[i] = Brighter(best[i], LoadPixels<Pixel>(at + 16 * i));
    }
  }
  BlockPair<Pixel> pair{best[0], best[kRegisters]};
  for (std::size_t i = 1; i < kRegisters; ++i) {
    pair.left = Brighter(pair.left, best[i]);
    pair.right = Brighter(pair.right, best[kRegisters + i]);
  }
  return pair;
}
template <class Pixel>
inline bool AnyLane(Pixels<Pixel> a) {
  return _mm_movemask_epi8(_mm_cmpeq_epi8(a.v, _mm_setzero_si128())) != 0xFFFF;
}
inline std::uint32_t BitsAbove(const std::byte* at, std::uint8_t threshold) {
  const auto dark = [&](const std::byte* from) {
    const auto above = Above(LoadPixels<std::uint8_t>(from), SpreadPixel(threshold));
    return static_cast<std::uint32_t>(
        _mm_movemask_epi8(_mm_cmpeq_epi8(above.v, _mm_setzero_si128())));
  };
  return ~(dark(at) | dark(at + 16) << 16);
}
inline std::uint32_t BitsAbove(const std::byte* at, std::uint16_t threshold) {
  const auto dark8 = [&](const std::byte* from) {
    const auto above = Above(LoadPixels<std::uint16_t>(from), SpreadPixel(threshold));
    return _mm_cmpeq_epi16(above.v, _mm_setzero_si128());
  };
  const auto dark = [&](const std::byte* from) {
    return static_cast<std::uint32_t>(
        _mm_movemask_epi8(_mm_packs_epi16(dark8(from), dark8(from + 16))));
  };
  return ~(dark(at) | dark(at + 32) << 16);
}
namespace detail {
inline void StoreWords(__m128i words, float* to) {
  const __m128i zero = _mm_setzero_si128();
  _mm_storeu_ps(to, _mm_cvtepi32_ps(_mm_unpacklo_epi16(words, zero)));
  _mm_storeu_ps(to + 4, _mm_cvtepi32_ps(_mm_unpackhi_epi16(words, zero)));
}
}  // namespace detail
template <class Pixel>
inline void Widen(const std::byte* at, float* to) {
  const __m128i first = LoadPixels<Pixel>(at).v;
  if constexpr (sizeof(Pixel) == 1) {
    detail::StoreWords(_mm_unpacklo_epi8(first, _mm_setzero_si128()), to);
    detail::StoreWords(_mm_unpackhi_epi8(first, _mm_setzero_si128()), to + 8);
  } else {
    detail::StoreWords(first, to);
    detail::StoreWords(LoadPixels<Pixel>(at + 16).v, to + 8);
  }
}
}  // namespace native
#elif defined(__ARM_NEON)
namespace native {

struct Floats {
  float32x4_t v;
};
struct Mask {
  uint32x4_t v;
};
template <class Pixel>
struct Pixels;
template <>
struct Pixels<std::uint8_t> {
  uint8x16_t v;
};
template <>
struct Pixels<std::uint16_t> {
  uint16x8_t v;
};

inline Floats Load(const float* at) { return {vld1q_f32(at)}; }
inline void Store(float* at, Floats a) { vst1q_f32(at, a.v); }
inline Floats Spread(float value) { return {vdupq_n_f32(value)}; }
inline Floats operator+(Floats a, Floats b) { return {vaddq_f32(a.v, b.v)}; }
inline Floats operator-(Floats a, Floats b) { return {vsubq_f32(a.v, b.v)}; }
inline Floats operator*(Floats a, Floats b) { return {vmulq_f32(a.v, b.v)}; }
// VMLA of this unit rounds the product first; that of 64-bit machines does not.
#if defined(__aarch64__)
inline Floats MulAdd(Floats sum, Floats a, Floats b) { return sum + a * b; }
inline Floats MulSub(Floats sum, Floats a, Floats b) { return sum - a * b; }
#else
inline Floats MulAdd(Floats sum, Floats a, Floats b) { return {vmlaq_f32(sum.v, a.v, b.v)}; }
inline Floats MulSub(Floats sum, Floats a, Floats b) { return {vmlsq_f32(sum.v, a.v, b.v)}; }
#endif
inline Floats Smaller(Floats a, Floats b) { return {vminq_f32(a.v, b.v)}; }
inline Floats Larger(Floats a, Floats b) { return {vmaxq_f32(a.v, b.v)}; }
inline Floats Absolute(Floats a) { return {vabsq_f32(a.v)}; }
// Not vcltq_f32, which GCC takes apart into scalar comparisons for the sake of denormals.
inline Mask IsLess(Floats a, Floats b) {
  return {vcltq_s32(vreinterpretq_s32_f32(a.v), vreinterpretq_s32_f32(b.v))};
}
inline Mask operator&(Mask a, Mask b) { return {vandq_u32(a.v, b.v)}; }
inline Mask operator|(Mask a, Mask b) { return {vorrq_u32(a.v, b.v)}; }
inline bool Any(Mask a) {
  const uint32x2_t folded = vorr_u32(vget_low_u32(a.v), vget_high_u32(a.v));
  return vget_lane_u64(vreinterpret_u64_u32(folded), 0) != 0;
}
inline Floats Where(Mask mask, Floats a) {
  return {vreinterpretq_f32_u32(vandq_u32(mask.v, vreinterpretq_u32_f32(a.v)))};
}
inline Floats LeftNeighbours(Floats before, Floats here) {
  return {vextq_f32(before.v, here.v, 3)};
}
inline float Sum(Floats a) {
  const float32x2_t pairs = vpadd_f32(vget_low_f32(a.v), vget_high_f32(a.v));
  return vget_lane_f32(vpadd_f32(pairs, pairs), 0);
}
inline Floats Whole(Floats a) { return {vcvtq_f32_s32(vcvtq_s32_f32(a.v))}; }
inline Floats Halved(Floats a, Floats whole) {
  const int32x4_t times = vshlq_n_s32(vcvtq_s32_f32(whole.v), 23);
  return {vreinterpretq_f32_s32(vsubq_s32(vreinterpretq_s32_f32(a.v), times))};
}
inline Floats RoughReciprocal(Floats a) {
  return {vreinterpretq_f32_u32(vsubq_u32(vdupq_n_u32(0x7EF311C3u), vreinterpretq_u32_f32(a.v)))};
}

template <class Pixel>
inline Pixels<Pixel> LoadPixels(const std::byte* at) {
  if constexpr (sizeof(Pixel) == 1) {
    return {vld1q_u8(reinterpret_cast<const std::uint8_t*>(at))};
  } else {
    return {vreinterpretq_u16_u8(vld1q_u8(reinterpret_cast<const std::uint8_t*>(at)))};
  }
}
template <class Pixel>
inline void StorePixels(std::byte* at, Pixels<Pixel> a) {
  if constexpr (sizeof(Pixel) == 1) {
    vst1q_u8(reinterpret_cast<std::uint8_t*>(at), a.v);
  } else {
    vst1q_u8(reinterpret_cast<std::uint8_t*>(at), vreinterpretq_u8_u16(a.v));
  }
}
inline Pixels<std::uint8_t> SpreadPixel(std::uint8_t value) { return {vdupq_n_u8(value)}; }
inline Pixels<std::uint16_t> SpreadPixel(std::uint16_t value) { return {vdupq_n_u16(value)}; }
inline Pixels<std::uint8_t> Above(Pixels<std::uint8_t> a, Pixels<std::uint8_t> b) {
  return {vqsubq_u8(a.v, b.v)};
}
inline Pixels<std::uint16_t> Above(Pixels<std::uint16_t> a, Pixels<std::uint16_t> b) {
  return {vqsubq_u16(a.v, b.v)};
}
inline Pixels<std::uint8_t> Brighter(Pixels<std::uint8_t> a, Pixels<std::uint8_t> b) {
  return {vmaxq_u8(a.v, b.v)};
}
inline Pixels<std::uint16_t> Brighter(Pixels<std::uint16_t> a, Pixels<std::uint16_t> b) {
  return {vmaxq_u16(a.v, b.v)};
}
inline Pixels<std::uint16_t> Darker(Pixels<std::uint16_t> a, Pixels<std::uint16_t> b) {
  return {vminq_u16(a.v, b.v)};
}
inline Pixels<std::uint8_t> Darker(Pixels<std::uint8_t> a, Pixels<std::uint8_t> b) {
  return {vminq_u8(a.v, b.v)};
}
inline std::uint32_t SumOfLanes(Pixels<std::uint16_t> a) {
  const uint64x2_t halves = vpaddlq_u32(vpaddlq_u16(a.v));
  return static_cast<std::uint32_t>(
      vget_lane_u64(vadd_u64(vget_low_u64(halves), vget_high_u64(halves)), 0));
}
inline std::uint32_t SumOfLanes(Pixels<std::uint8_t> a) {
  return SumOfLanes(Pixels<std::uint16_t>{vpaddlq_u8(a.v)});
}
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
#if !defined(__aarch64__)
// The one loop that sees every pixel, written out: 32 bytes a load, which no intrinsic of GCC 12
// gives. Two times 32 bytes of eight rows. The Cortex-A8 fetches nothing ahead on its own, hence
// PLD four lines ahead in each row.
#define TBM_FOLD_ROW(max)                                                            \
  "pld [%2, #256]\n\t"                                                               \
  "vld1.8 {d24-d27}, [%2]!\n\t"                                                      \
  "vld1.8 {d28-d31}, [%2], %3\n\t" max " q8, q8, q12\n\t" max " q9, q9, q13\n\t" max \
  " q10, q10, q14\n\t" max " q11, q11, q15\n\t"
#define TBM_FOLD_EIGHT_ROWS(max)                                                             \
  asm("pld [%2, #256]\n\t"                                                                   \
      "vld1.8 {d16-d19}, [%2]!\n\t"                                                          \
      "vld1.8 {d20-d23}, [%2], %3\n\t" TBM_FOLD_ROW(max) TBM_FOLD_ROW(max) TBM_FOLD_ROW(max) \
          TBM_FOLD_ROW(max) TBM_FOLD_ROW(max) TBM_FOLD_ROW(max) TBM_FOLD_ROW(max) max        \
      " %q0, q8, q9\n\t" max " %q1, q10, q11"                                                \
      : "=&w"(pair.left.v), "=w"(pair.right.v), "+r"(at)                                     \
      : "r"(stride_bytes - 32)                                                               \
      : "d16",                                                                               \
        "d17",                                                                               \
        "d18",                                                                               \
        "d19",                                                                               \
        "d20",                                                                               \
        "d21",                                                                               \
        "d22",                                                                               \
        "d23",                                                                               \
        "d24",                                                                               \
        "d25",                                                                               \
        "d26",                                                                               \
        "d27",                                                                               \
        "d28",                                                                               \
        "d29",                                                                               \
        "d30",                                                                               \
        "d31",                                                                               \
        "memory")
namespace detail {
inline void FoldEightRows(const std::byte* at,
                          std::ptrdiff_t stride_bytes,
                          BlockPair<std::uint8_t>& pair) {
  TBM_FOLD_EIGHT_ROWS("vmax.u8");
}
inline void FoldEightRows(const std::byte* at,
                          std::ptrdiff_t stride_bytes,
                          BlockPair<std::uint16_t>& pair) {
  TBM_FOLD_EIGHT_ROWS("vmax.u16");
}
}  // namespace detail
#undef TBM_FOLD_ROW
#undef TBM_FOLD_EIGHT_ROWS
#endif
template <class Pixel>
inline BlockPair<Pixel> BrightestOfBlocks(const std::byte* at, std::ptrdiff_t stride_bytes) {
#if defined(__aarch64__)
  return {BrightestOfBlock<Pixel>(at, stride_bytes),
          BrightestOfBlock<Pixel>(at + 32 * sizeof(Pixel), stride_bytes)};
#else
  BlockPair<Pixel> pair;
  detail::FoldEightRows(at, stride_bytes, pair);
  if constexpr (sizeof(Pixel) == 1) return pair;
  BlockPair<Pixel> next;
  detail::FoldEightRows(at + 64, stride_bytes, next);
  return {Brighter(pair.left, pair.right), Brighter(next.left, next.right)};
#endif
}
inline bool AnyLane(Pixels<std::uint8_t> a) {
  const uint8x8_t folded = vorr_u8(vget_low_u8(a.v), vget_high_u8(a.v));
  return vget_lane_u64(vreinterpret_u64_u8(folded), 0) != 0;
}
inline bool AnyLane(Pixels<std::uint16_t> a) {
  return AnyLane(Pixels<std::uint8_t>{vreinterpretq_u8_u16(a.v)});
}
namespace detail {
// Bytes of all ones or zeros to one bit each; pairwise sums bring eight into each byte.
inline std::uint32_t BitsOf(uint8x16_t first, uint8x16_t second) {
  const uint8x16_t weight = vreinterpretq_u8_u64(vdupq_n_u64(0x8040201008040201ull));
  const uint8x16_t a = vandq_u8(first, weight);
  const uint8x16_t b = vandq_u8(second, weight);
  const uint8x8_t pairs_a = vpadd_u8(vget_low_u8(a), vget_high_u8(a));
  const uint8x8_t pairs_b = vpadd_u8(vget_low_u8(b), vget_high_u8(b));
  const uint8x8_t fours = vpadd_u8(pairs_a, pairs_b);
  return vget_lane_u32(vreinterpret_u32_u8(vpadd_u8(fours, fours)), 0);
}
}  // namespace detail
inline std::uint32_t BitsAbove(const std::byte* at, std::uint8_t threshold) {
  const uint8x16_t limit = vdupq_n_u8(threshold);
  return detail::BitsOf(vcgtq_u8(LoadPixels<std::uint8_t>(at).v, limit),
                        vcgtq_u8(LoadPixels<std::uint8_t>(at + 16).v, limit));
}
inline std::uint32_t BitsAbove(const std::byte* at, std::uint16_t threshold) {
  const uint16x8_t limit = vdupq_n_u16(threshold);
  const auto above = [&](const std::byte* from) {
    return vcombine_u8(vmovn_u16(vcgtq_u16(LoadPixels<std::uint16_t>(from).v, limit)),
                       vmovn_u16(vcgtq_u16(LoadPixels<std::uint16_t>(from + 16).v, limit)));
  };
  return detail::BitsOf(above(at), above(at + 32));
}
namespace detail {
inline void StoreWords(uint16x8_t words, float* to) {
  vst1q_f32(to, vcvtq_f32_u32(vmovl_u16(vget_low_u16(words))));
  vst1q_f32(to + 4, vcvtq_f32_u32(vmovl_u16(vget_high_u16(words))));
}
}  // namespace detail
template <class Pixel>
inline void Widen(const std::byte* at, float* to) {
  if constexpr (sizeof(Pixel) == 1) {
    const uint8x16_t bytes = LoadPixels<Pixel>(at).v;
    detail::StoreWords(vmovl_u8(vget_low_u8(bytes)), to);
    detail::StoreWords(vmovl_u8(vget_high_u8(bytes)), to + 8);
  } else {
    detail::StoreWords(LoadPixels<Pixel>(at).v, to);
    detail::StoreWords(LoadPixels<Pixel>(at + 16).v, to + 8);
  }
}
}  // namespace native
#else
namespace native = plain;
#endif

#if defined(TBM_PLAIN_VECTORS)
namespace vectors = plain;
#else
namespace vectors = native;
#endif

}  // namespace tbm
