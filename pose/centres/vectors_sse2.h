#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <emmintrin.h>

#include "pose/centres/vectors_plain.h"

// The operations of vectors.h for the processor of a PC.
namespace tbm {

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

}  // namespace tbm
