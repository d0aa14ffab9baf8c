#include "pose/centres/label_runs.h"

#include <algorithm>
#include <cmath>

#include "pose/centres/any_above.h"

namespace tbm {

double Blob::Elongation() const {
  // One pixel's own width keeps a row of two or three pixels from being endlessly thin.
  constexpr double kPixelVariance = 1.0 / 12.0;
  const double u = u_px();
  const double v = v_px();
  const double uu = sum_uu / weight - u * u + kPixelVariance;
  const double vv = sum_vv / weight - v * v + kPixelVariance;
  const double uv = sum_uv / weight - u * v;
  const double mean = 0.5 * (uu + vv);
  const double half_span = std::hypot(0.5 * (uu - vv), uv);
  return std::sqrt((mean + half_span) / std::max(mean - half_span, 1e-3));
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
}

template <class Pixel>
void RunLabeller::Scan(const std::byte* row_start,
                       int row,
                       int first,
                       int last,
                       int threshold_dn,
                       std::uint32_t clipped_from_dn) {
  if (row != row_) StartRow(row);
  for (int x = first; x < last; ++x) {
    const int value = LoadPixel<Pixel>(row_start + static_cast<std::size_t>(x) * sizeof(Pixel));
    if (value <= threshold_dn) continue;
    if (runs_.size() == row_begin_ || runs_.back().end != x) {
      if (runs_.size() == runs_.capacity()) {
        overflowed_ = true;
        return;
      }
      runs_.push_back({row, x, x, 0, 0, static_cast<std::uint32_t>(runs_.size()), 0, 0, 0});
    }
    Run& run = runs_.back();
    const auto weight = static_cast<std::uint64_t>(value - threshold_dn);
    const auto column = static_cast<std::uint64_t>(x - run.begin);
    run.end = x + 1;
    run.peak_dn = std::max(run.peak_dn, value);
    run.clipped += static_cast<std::uint32_t>(value) >= clipped_from_dn;
    run.weight += weight;
    run.weight_x += weight * column;
    run.weight_xx += weight * column * column;
  }
}
template void RunLabeller::Scan<std::uint8_t>(const std::byte*, int, int, int, int, std::uint32_t);
template void RunLabeller::Scan<std::uint16_t>(const std::byte*, int, int, int, int, std::uint32_t);

void RunLabeller::StartRow(int row) {
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

std::span<const Blob> RunLabeller::Finish() {
  StartRow(row_ + 2);
  for (std::uint32_t i = 0; i < runs_.size(); ++i) {
    const Run& run = runs_[i];
    const std::uint32_t root = Root(i);
    if (root == i) {
      blob_of_run_[i] = static_cast<std::uint32_t>(blobs_.size());
      blobs_.push_back({run.begin, run.end - 1, run.row, run.row});
    }
    Blob& blob = blobs_[blob_of_run_[root]];
    blob.left = std::min(blob.left, run.begin);
    blob.right = std::max(blob.right, run.end - 1);
    blob.bottom = std::max(blob.bottom, run.row);
    blob.pixels += run.end - run.begin;
    blob.clipped += run.clipped;
    blob.peak_dn = std::max(blob.peak_dn, run.peak_dn);
    const double x = run.begin;
    const double y = run.row;
    const auto w = static_cast<double>(run.weight);
    const auto wx = static_cast<double>(run.weight_x) + x * w;
    const auto wxx = static_cast<double>(run.weight_xx) +
                     2.0 * x * static_cast<double>(run.weight_x) + x * x * w;
    blob.weight += w;
    blob.sum_u += wx;
    blob.sum_v += y * w;
    blob.sum_uu += wxx;
    blob.sum_uv += y * wx;
    blob.sum_vv += y * y * w;
  }
  return blobs_;
}

}  // namespace tbm
