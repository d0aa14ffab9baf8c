#include "pose/centres/label_runs.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "pose/centres/vectors.h"

namespace tbm {
namespace {

constexpr int kBits = 32;

// Sums over a few pixels, column counted from the first of them.
struct ChunkSums {
  std::uint32_t weight = 0;
  std::uint32_t weight_x = 0;
  std::uint32_t weight_xx = 0;
  int peak_dn = 0;
  int clipped = 0;
};

// Exact below 2^53. A 32-bit machine has no instruction for it.
double AsDouble(std::uint64_t value) {
  constexpr double kHigh = 4294967296.0;
  return static_cast<double>(static_cast<std::uint32_t>(value >> 32)) * kHigh +
         static_cast<double>(static_cast<std::uint32_t>(value));
}

// At most kBits pixels: 65535 * sum of x^2 stays below 2^32.
template <class Pixel>
ChunkSums SumChunk(const std::byte* at, int pixels, int threshold_dn, std::uint32_t clipped_from) {
  // Sums of sums from the far end: with s1 = sum w (x + 1) and s2 = sum w (x + 1)(x + 2) / 2.
  std::uint32_t s0 = 0;
  std::uint32_t s1 = 0;
  std::uint32_t s2 = 0;
  int peak = 0;
  for (int x = pixels - 1; x >= 0; --x) {
    const int value = LoadPixel<Pixel>(at + static_cast<std::size_t>(x) * sizeof(Pixel));
    peak = std::max(peak, value);
    s0 += static_cast<std::uint32_t>(value - threshold_dn);
    s1 += s0;
    s2 += s1;
  }
  ChunkSums sums{s0, s1 - s0, 2 * s2 - 3 * s1 + s0, peak, 0};
  if (static_cast<std::uint32_t>(peak) >= clipped_from) {
    for (int x = 0; x < pixels; ++x) {
      sums.clipped +=
          LoadPixel<Pixel>(at + static_cast<std::size_t>(x) * sizeof(Pixel)) >= clipped_from;
    }
  }
  return sums;
}

}  // namespace

BlobShape ShapeOf(const Blob& blob) {
  // One pixel's own width keeps a row of two or three pixels from being endlessly thin.
  constexpr double kPixelVariance = 1.0 / 12.0;
  BlobShape shape;
  shape.u_px = 0.5 * (blob.left + blob.right);
  shape.v_px = 0.5 * (blob.top + blob.bottom);
  if (blob.weight == 0) return shape;
  shape.weight_dn = AsDouble(blob.weight);
  const double inverse = 1.0 / shape.weight_dn;
  const double u = AsDouble(blob.sum_u) * inverse;
  const double v = AsDouble(blob.sum_v) * inverse;
  const double uu = AsDouble(blob.sum_uu) * inverse - u * u + kPixelVariance;
  const double vv = AsDouble(blob.sum_vv) * inverse - v * v + kPixelVariance;
  const double uv = AsDouble(blob.sum_uv) * inverse - u * v;
  const double mean = 0.5 * (uu + vv);
  const double half_span = std::sqrt(0.25 * (uu - vv) * (uu - vv) + uv * uv);
  shape.u_px = blob.left + u;
  shape.v_px = blob.top + v;
  shape.elongation = std::sqrt((mean + half_span) / std::max(mean - half_span, 1e-3));
  return shape;
}

RunLabeller::RunLabeller(std::size_t max_runs) {
  runs_.reserve(max_runs);
  blobs_.reserve(max_runs);
  blob_of_run_.resize(max_runs);
}

void RunLabeller::Clear() {
  runs_.clear();
  blobs_.clear();
  above_begin_ = row_begin_ = 0;
  row_ = -2;
  overflowed_ = false;
  open_end_ = -1;
}

template <class Pixel>
void RunLabeller::Scan(const ImageView& image, int row, int first, int last, int threshold_dn) {
  const std::byte* row_start =
      static_cast<const std::byte*>(image.pixels) + row * image.stride_bytes;
  const auto threshold = static_cast<Pixel>(threshold_dn);
  const std::byte* at = row_start + first * int{sizeof(Pixel)};
  int x = first;
  for (; x + kBits <= last; x += kBits, at += kBits * sizeof(Pixel)) {
    AddBits(row, x, vectors::BitsAbove(at, threshold), threshold_dn);
  }
  const int columns = last - x;
  if (columns == 0) return;
  std::uint32_t bits = 0;
  if (x + kBits <= image.width_px) {
    bits = vectors::BitsAbove(at, threshold) & ((std::uint32_t{1} << columns) - 1);
  } else {
    for (int i = 0; i < columns; ++i) {
      const bool above = LoadPixel<Pixel>(at + i * int{sizeof(Pixel)}) > threshold;
      bits |= std::uint32_t{above} << i;
    }
  }
  AddBits(row, x, bits, threshold_dn);
}
template void RunLabeller::Scan<std::uint8_t>(const ImageView&, int, int, int, int);
template void RunLabeller::Scan<std::uint16_t>(const ImageView&, int, int, int, int);

void RunLabeller::AddRuns(int row, int column, std::uint32_t bits, int threshold_dn) {
  const bool goes_on = (bits & 1) != 0 && open_end_ == column && row == row_;
  if (open_end_ >= 0 && !goes_on) CloseRun();
  if (bits == 0) return;
  if (row != row_) StartRow(row);
  while (bits != 0) {
    const int begin = std::countr_zero(bits);
    const int end = begin + std::countr_one(bits >> begin);
    if (open_end_ < 0) {
      open_begin_ = column + begin;
      open_threshold_dn_ = threshold_dn;
    } else {
      open_threshold_dn_ = std::min(open_threshold_dn_, threshold_dn);
    }
    open_end_ = column + end;
    if (end == kBits) return;
    CloseRun();
    bits &= ~std::uint32_t{0} << end;
  }
}

void RunLabeller::CloseRun() {
  const auto itself = static_cast<std::uint32_t>(runs_.size());
  if (runs_.size() == runs_.capacity()) {
    overflowed_ = true;
  } else {
    runs_.push_back({row_, open_begin_, open_end_, open_threshold_dn_, itself});
  }
  open_end_ = -1;
}

void RunLabeller::StartRow(int row) {
  if (open_end_ >= 0) CloseRun();
  JoinRows();
  above_begin_ = row == row_ + 1 ? row_begin_ : runs_.size();
  row_begin_ = runs_.size();
  row_ = row;
}

std::uint32_t RunLabeller::Root(std::uint32_t run) {
  while (runs_[run].parent != run) run = runs_[run].parent = runs_[runs_[run].parent].parent;
  return run;
}

void RunLabeller::JoinRows() {
  std::size_t above = above_begin_;
  for (std::size_t here = row_begin_; here < runs_.size(); ++here) {
    while (above < row_begin_ && runs_[above].end < runs_[here].begin) ++above;
    for (std::size_t i = above; i < row_begin_ && runs_[i].begin <= runs_[here].end; ++i) {
      const std::uint32_t a = Root(static_cast<std::uint32_t>(i));
      const std::uint32_t b = Root(static_cast<std::uint32_t>(here));
      runs_[std::max(a, b)].parent = std::min(a, b);
    }
  }
}

std::span<const Blob> RunLabeller::Finish(const ImageView& image, int most_pixels) {
  StartRow(row_ + 2);
  for (std::uint32_t i = 0; i < runs_.size(); ++i) {
    const Run& run = runs_[i];
    if (run.parent == i) {
      blob_of_run_[i] = static_cast<std::uint32_t>(blobs_.size());
      blobs_.push_back({run.begin, run.end - 1, run.row, run.row});
    } else {
      blob_of_run_[i] = blob_of_run_[run.parent];  // parents come first
    }
    Blob& blob = blobs_[blob_of_run_[i]];
    blob.left = std::min(blob.left, run.begin);
    blob.right = std::max(blob.right, run.end - 1);
    blob.bottom = std::max(blob.bottom, run.row);
    blob.pixels += run.end - run.begin;
  }
  if (image.bytes_per_pixel == 1) {
    LookAtPixels<std::uint8_t>(image, most_pixels);
  } else {
    LookAtPixels<std::uint16_t>(image, most_pixels);
  }
  return blobs_;
}

template <class Pixel>
void RunLabeller::LookAtPixels(const ImageView& image, int most_pixels) {
  const auto* first = static_cast<const std::byte*>(image.pixels);
  for (std::size_t i = 0; i < runs_.size(); ++i) {
    const Run& run = runs_[i];
    Blob& blob = blobs_[blob_of_run_[i]];
    if (blob.pixels < Blob::kFewestPixels) continue;
    const std::byte* row_start = first + run.row * image.stride_bytes;
    if (blob.pixels > most_pixels) {
      GlanceAtRun<Pixel>(row_start, image, run, blob);
      continue;
    }
    for (int begin = run.begin; begin < run.end; begin += kBits) {
      const ChunkSums chunk = SumChunk<Pixel>(row_start + begin * int{sizeof(Pixel)},
                                              std::min(kBits, run.end - begin),
                                              run.threshold_dn,
                                              image.max_value);
      const auto x = static_cast<std::uint32_t>(begin - blob.left);
      const auto y = static_cast<std::uint32_t>(run.row - blob.top);
      const std::uint64_t w = chunk.weight;
      const std::uint64_t wx = chunk.weight_x + x * w;
      const std::uint64_t wy = y * w;
      blob.weight += w;
      blob.sum_u += wx;
      blob.sum_v += wy;
      blob.sum_uu += chunk.weight_xx + x * (chunk.weight_x + wx);
      blob.sum_uv += y * wx;
      blob.sum_vv += y * wy;
      blob.peak_dn = std::max(blob.peak_dn, chunk.peak_dn);
      blob.clipped += chunk.clipped;
    }
  }
}

// Of a large blob: every eighth row tells peak and clipped pixels.
template <class Pixel>
void RunLabeller::GlanceAtRun(const std::byte* row_start,
                              const ImageView& image,
                              const Run& run,
                              Blob& blob) {
  constexpr int kEvery = 8;
  if ((run.row - blob.top) % kEvery != 0) return;
  const auto highest_dark = static_cast<Pixel>(
      std::min<std::uint32_t>(image.max_value - 1, std::numeric_limits<Pixel>::max()));
  for (int begin = run.begin; begin < run.end; begin += kBits) {
    const int columns = std::min(kBits, run.end - begin);
    const std::byte* at = row_start + begin * int{sizeof(Pixel)};
    if (columns == kBits) {
      const int clipped = std::popcount(vectors::BitsAbove(at, highest_dark));
      blob.clipped += kEvery * clipped;
      if (clipped > 0) blob.peak_dn = static_cast<int>(image.max_value);
      if (clipped > 0) continue;
    }
    const ChunkSums chunk = SumChunk<Pixel>(at, columns, run.threshold_dn, image.max_value);
    blob.peak_dn = std::max(blob.peak_dn, chunk.peak_dn);
    blob.clipped += kEvery * chunk.clipped;
  }
}

}  // namespace tbm
