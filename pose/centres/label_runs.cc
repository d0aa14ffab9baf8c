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
  runs_.resize(max_runs);
  blobs_.resize(max_runs);
  blob_of_run_.resize(max_runs);
}

void RunLabeller::Clear() {
  run_count_ = 0;
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

void RunLabeller::Append(int begin, int end, int threshold_dn) {
  if (run_count_ == runs_.size()) {
    overflowed_ = true;
    return;
  }
  runs_[run_count_] = {row_, begin, end, threshold_dn, static_cast<std::uint32_t>(run_count_)};
  ++run_count_;
}

void RunLabeller::AddRuns(int row, int column, std::uint32_t bits, int threshold_dn) {
  if (open_end_ >= 0) {
    bits = GoOn(row, column, bits, threshold_dn);
    if (bits == 0) return;
  }
  if (row != row_) StartRow(row);
  // Counted in a register; through the members every step would be stored and loaded again.
  const auto room = static_cast<std::uint32_t>(runs_.size());
  auto count = static_cast<std::uint32_t>(run_count_);
  Run* run = runs_.data() + count;
  do {
    const int begin = std::countr_zero(bits);
    const int end = begin + std::countr_one(bits >> begin);
    if (end == kBits) {
      open_begin_ = column + begin;
      open_end_ = column + kBits;
      open_threshold_dn_ = threshold_dn;
      break;
    }
    if (count == room) {
      overflowed_ = true;
      break;
    }
    *run = {row, column + begin, column + end, threshold_dn, count};
    ++run;
    ++count;
    bits &= ~std::uint32_t{0} << end;
  } while (bits != 0);
  run_count_ = count;
}

// Adds to the open run what belongs to it; returns what does not.
std::uint32_t RunLabeller::GoOn(int row, int column, std::uint32_t bits, int threshold_dn) {
  if ((bits & 1) == 0 || open_end_ != column || row != row_) {
    CloseRun();
    return bits;
  }
  open_threshold_dn_ = std::min(open_threshold_dn_, threshold_dn);
  const int end = std::countr_one(bits);
  open_end_ = column + end;
  if (end == kBits) return 0;
  CloseRun();
  return bits & ~std::uint32_t{0} << end;
}

void RunLabeller::CloseRun() {
  Append(open_begin_, open_end_, open_threshold_dn_);
  open_end_ = -1;
}

void RunLabeller::StartRow(int row) {
  if (open_end_ >= 0) CloseRun();
  JoinRows();
  above_begin_ = row == row_ + 1 ? row_begin_ : run_count_;
  row_begin_ = run_count_;
  row_ = row;
}

void RunLabeller::JoinRows() {
  Run* const runs = runs_.data();
  const auto root_of = [runs](std::uint32_t run) {
    while (runs[run].parent != run) run = runs[run].parent = runs[runs[run].parent].parent;
    return run;
  };
  std::size_t above = above_begin_;
  for (std::size_t here = row_begin_; here < run_count_; ++here) {
    const int begin = runs[here].begin;
    const int end = runs[here].end;
    while (above < row_begin_ && runs[above].end < begin) ++above;
    auto root = static_cast<std::uint32_t>(here);
    for (std::size_t i = above; i < row_begin_ && runs[i].begin <= end; ++i) {
      const std::uint32_t other = root_of(static_cast<std::uint32_t>(i));
      const std::uint32_t first = std::min(root, other);
      runs[std::max(root, other)].parent = first;
      root = first;
    }
  }
}

std::span<Blob> RunLabeller::Finish() {
  StartRow(row_ + 2);
  Run* const runs = runs_.data();
  std::uint32_t* const blob_of_run = blob_of_run_.data();
  Blob* const blobs = blobs_.data();
  std::uint32_t count = 0;
  for (std::uint32_t i = 0; i < run_count_; ++i) {
    Run& run = runs[i];
    if (run.parent == i) {
      Blob& blob = blobs[count];
      blob.left = run.begin;
      blob.right = run.end - 1;
      blob.top = blob.bottom = run.row;
      blob.last_run = i;
      blob.pixels = run.end - run.begin;
      blob_of_run[i] = count++;
      continue;
    }
    const std::uint32_t index = blob_of_run[run.parent];  // parents come first
    blob_of_run[i] = index;
    Blob& blob = blobs[index];
    run.parent = blob.last_run;
    blob.last_run = i;
    blob.left = std::min(blob.left, run.begin);
    blob.right = std::max(blob.right, run.end - 1);
    blob.bottom = run.row;
    blob.pixels += run.end - run.begin;
  }
  return {blobs, count};
}

void RunLabeller::FindPeak(const ImageView& image, Blob& blob) const {
  blob.peak_dn = 0;
  blob.clipped = 0;
  const auto* first = static_cast<const std::byte*>(image.pixels);
  const bool is_byte = image.bytes_per_pixel == 1;
  for (std::uint32_t i = blob.last_run;; i = runs_[i].parent) {
    const Run& run = runs_[i];
    const std::byte* row_start = first + run.row * image.stride_bytes;
    for (int x = run.begin; x < run.end; ++x) {
      const int value = is_byte ? LoadPixel<std::uint8_t>(row_start + x)
                                : LoadPixel<std::uint16_t>(row_start + 2 * x);
      blob.peak_dn = std::max(blob.peak_dn, value);
    }
    if (run.parent == i) return;
  }
}

void RunLabeller::LookAt(const ImageView& image, int most_pixels, Blob& blob) const {
  const bool is_byte = image.bytes_per_pixel == 1;
  blob.peak_dn = 0;
  blob.clipped = 0;
  if (blob.pixels > most_pixels) {
    is_byte ? GlanceAt<std::uint8_t>(image, blob) : GlanceAt<std::uint16_t>(image, blob);
  } else {
    is_byte ? SumRuns<std::uint8_t>(image, blob) : SumRuns<std::uint16_t>(image, blob);
  }
}

template <class Pixel>
void RunLabeller::SumRuns(const ImageView& image, Blob& blob) const {
  const auto* first = static_cast<const std::byte*>(image.pixels);
  std::uint64_t weight = 0, sum_u = 0, sum_v = 0, sum_uu = 0, sum_uv = 0, sum_vv = 0;
  for (std::uint32_t i = blob.last_run;; i = runs_[i].parent) {
    const Run& run = runs_[i];
    const std::byte* row_start = first + run.row * image.stride_bytes;
    for (int begin = run.begin; begin < run.end; begin += kBits) {
      const ChunkSums chunk = SumChunk<Pixel>(row_start + begin * int{sizeof(Pixel)},
                                              std::min(kBits, run.end - begin),
                                              run.threshold_dn,
                                              image.max_value);
      const auto x = static_cast<std::uint32_t>(begin - blob.left);
      const auto y = static_cast<std::uint32_t>(run.row - blob.top);
      const std::uint64_t wx = chunk.weight_x + std::uint64_t{x} * chunk.weight;
      const std::uint64_t wy = std::uint64_t{y} * chunk.weight;
      weight += chunk.weight;
      sum_u += wx;
      sum_v += wy;
      sum_uu += chunk.weight_xx + x * (chunk.weight_x + wx);
      sum_uv += y * wx;
      sum_vv += y * wy;
      blob.peak_dn = std::max(blob.peak_dn, chunk.peak_dn);
      blob.clipped += chunk.clipped;
    }
    if (run.parent == i) break;
  }
  blob.weight = weight;
  blob.sum_u = sum_u;
  blob.sum_v = sum_v;
  blob.sum_uu = sum_uu;
  blob.sum_uv = sum_uv;
  blob.sum_vv = sum_vv;
}

template <class Pixel>
void RunLabeller::GlanceAt(const ImageView& image, Blob& blob) const {
  constexpr int kEvery = 16;
  blob.weight = 0;
  const auto* first = static_cast<const std::byte*>(image.pixels);
  const auto highest_dark = static_cast<Pixel>(
      std::min<std::uint32_t>(image.max_value - 1, std::numeric_limits<Pixel>::max()));
  for (std::uint32_t i = blob.last_run;; i = runs_[i].parent) {
    const Run& run = runs_[i];
    const bool is_looked_at = (run.row - blob.top) % kEvery == 0;
    const std::byte* row_start = first + run.row * image.stride_bytes;
    for (int begin = run.begin; is_looked_at && begin < run.end; begin += kBits) {
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
    if (run.parent == i) return;
  }
}

}  // namespace tbm
