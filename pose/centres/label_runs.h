#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tbm {

// Pixels of one piece above a threshold that touch one another, corners included. The weight of a
// pixel is its value above the threshold [DN]; moments are sums over pixels in absolute pixel
// coordinates.
struct Blob {
  int left = 0;  // box, ends included
  int right = 0;
  int top = 0;
  int bottom = 0;
  int pixels = 0;
  int clipped = 0;
  int peak_dn = 0;  // of the image, not above the threshold
  double weight = 0.0;
  double sum_u = 0.0;
  double sum_v = 0.0;
  double sum_uu = 0.0;
  double sum_uv = 0.0;
  double sum_vv = 0.0;

  double u_px() const { return sum_u / weight; }
  double v_px() const { return sum_v / weight; }
  // Longer axis by shorter axis, of the weights.
  double Elongation() const;
};

// Collects the bright runs of an image row by row and joins them into blobs. Rows come from top to
// bottom, the pieces of a row from left to right. Room for a fixed number of runs: more are dropped
// and overflowed() says so.
class RunLabeller {
 public:
  explicit RunLabeller(std::size_t max_runs);

  void Clear();
  // Pixels first .. last - 1 of row `row`, whose first pixel (column 0) is at `row_start`.
  template <class Pixel>
  void Scan(const std::byte* row_start,
            int row,
            int first,
            int last,
            int threshold_dn,
            std::uint32_t clipped_from_dn);
  // Valid until the next Clear.
  std::span<const Blob> Finish();
  bool overflowed() const { return overflowed_; }

 private:
  struct Run {
    int row;
    int begin;
    int end;
    int peak_dn;
    int clipped;
    std::uint32_t parent;
    std::uint64_t weight;  // sums over the run, column counted from its begin
    std::uint64_t weight_x;
    std::uint64_t weight_xx;
  };

  void StartRow(int row);
  void JoinRows();
  std::uint32_t Root(std::uint32_t run);

  std::vector<Run> runs_;  // reserved once
  std::vector<Blob> blobs_;
  std::vector<std::uint32_t> blob_of_run_;
  std::size_t above_begin_ = 0;  // runs of the row above, and of this row
  std::size_t row_begin_ = 0;
  int row_ = -2;
  bool overflowed_ = false;
};

}  // namespace tbm
