#pragma once

#include <cstddef>
#include <cstdint>

#include <arm_neon.h>

#include "pose/centres/vectors_plain.h"

// The operations of vectors.h for the processor of the camera box, a Cortex-A8.
namespace tbm {

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

}  // namespace tbm
