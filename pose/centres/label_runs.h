#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "pose/centres/image_view.h"

namespace tbm {

// Pixels of one piece above a threshold that touch one another, corners included. The weight of a
// pixel is its value above the threshold [DN]; moments are sums over pixels, counted from the left
// upper corner of the box. What lies below `pixels` is known once it was asked for.
struct Blob {
  static constexpr int kFewestPixels = 3;  // fewer are a hot pixel

  int left = 0;  // box, ends included
  int right = 0;
  int top = 0;
  int bottom = 0;
  std::uint32_t last_run = 0;  // of the labeller
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
    if (bits == ~std::uint32_t{0} && open_end_ == column && row == row_) {
      open_end_ += 32;
      if (threshold_dn < open_threshold_dn_) open_threshold_dn_ = threshold_dn;
    } else if (bits != 0 || open_end_ >= 0) {
      AddRuns(row, column, bits, threshold_dn);
    }
  }
  // Valid until the next Clear.
  std::span<Blob> Finish();
  // The brightest pixel alone; clipped pixels count as none.
  void FindPeak(const ImageView& image, Blob& blob) const;
  // Everything. A blob of more than `most_pixels` is no spot: it has no moments, and peak and
  // clipped pixels are those of every sixteenth row.
  void LookAt(const ImageView& image, int most_pixels, Blob& blob) const;
  bool overflowed() const { return overflowed_; }

 private:
  struct Run {
    int row;
    int begin;
    int end;
    int threshold_dn;
    // Of the tree of joined runs, whose root is its own parent; after Finish the run before it in
    // its blob, or itself.
    std::uint32_t parent;
  };

  void AddRuns(int row, int column, std::uint32_t bits, int threshold_dn);
  void StartRow(int row);
  std::uint32_t GoOn(int row, int column, std::uint32_t bits, int threshold_dn);
  void Append(int begin, int end, int threshold_dn);
  void CloseRun();
  void JoinRows();
  template <class Pixel>
  void SumRuns(const ImageView& image, Blob& blob) const;
  template <class Pixel>
  void GlanceAt(const ImageView& image, Blob& blob) const;

  std::vector<Run> runs_;  // the first run_count_ of them
  std::size_t run_count_ = 0;
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
