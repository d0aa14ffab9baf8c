#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "pose/centres/image_view.h"

namespace tbm {

// Pixels of one piece above a threshold that touch one another, corners included. The weight of a
// pixel is its value above the threshold [DN]; moments are sums over pixels, counted from the left
// upper corner of the box. Of blobs with fewer than kFewestPixels only box and number of pixels are
// known.
struct Blob {
  static constexpr int kFewestPixels = 3;

  int left = 0;  // box, ends included
  int right = 0;
  int top = 0;
  int bottom = 0;
  int pixels = 0;
  int clipped = 0;
  int peak_dn = 0;  // of the image, not above the threshold
  std::uint64_t weight = 0;
  std::uint64_t sum_u = 0;
  std::uint64_t sum_v = 0;
  std::uint64_t sum_uu = 0;
  std::uint64_t sum_uv = 0;
  std::uint64_t sum_vv = 0;
};

// Where a blob is and what shape it has, by its weights.
struct BlobShape {
  double u_px = 0.0;
  double v_px = 0.0;
  double weight_dn = 0.0;
  double elongation = 1.0;  // longer axis by shorter axis
};
BlobShape ShapeOf(const Blob& blob);

// Collects the bright runs of an image row by row and joins them into blobs. Rows come from top to
// bottom, the pieces of a row from left to right. Room for a fixed number of runs: more are dropped
// and overflowed() says so.
//
// Which pixels are bright is all that is asked of most of them; the values are looked at when the
// blobs are known.
class RunLabeller {
 public:
  explicit RunLabeller(std::size_t max_runs);

  void Clear();
  // Pixels first .. last - 1 of row `row`.
  template <class Pixel>
  void Scan(const ImageView& image, int row, int first, int last, int threshold_dn);
  // Bit i: pixel column + i of the row is bright.
  void AddBits(int row, int column, std::uint32_t bits, int threshold_dn) {
    if (bits != 0 || open_end_ >= 0) AddRuns(row, column, bits, threshold_dn);
  }
  // Valid until the next Clear. A blob of more than `most_pixels` is no spot: it has no moments,
  // and peak and clipped pixels are those of every eighth row.
  std::span<const Blob> Finish(const ImageView& image, int most_pixels);
  bool overflowed() const { return overflowed_; }

 private:
  struct Run {
    int row;
    int begin;
    int end;
    int threshold_dn;
    std::uint32_t parent;
  };

  void AddRuns(int row, int column, std::uint32_t bits, int threshold_dn);
  void StartRow(int row);
  void CloseRun();
  void JoinRows();
  std::uint32_t Root(std::uint32_t run);
  template <class Pixel>
  void LookAtPixels(const ImageView& image, int most_pixels);
  template <class Pixel>
  void GlanceAtRun(const std::byte* row_start, const ImageView& image, const Run& run, Blob& blob);

  std::vector<Run> runs_;  // reserved once
  std::vector<Blob> blobs_;
  std::vector<std::uint32_t> blob_of_run_;
  std::size_t above_begin_ = 0;  // runs of the row above, and of this row
  std::size_t row_begin_ = 0;
  int row_ = -2;
  bool overflowed_ = false;
  // The run that the pixels added last belong to.
  int open_begin_ = 0;
  int open_end_ = -1;  // -1: none
  int open_threshold_dn_ = 0;
};

}  // namespace tbm
