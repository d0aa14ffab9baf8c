#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "pose/centres/image_view.h"

namespace tbm {

struct SpotFit;

struct PixelBox {
  int left = 0;  // ends included
  int right = -1;
  int top = 0;
  int bottom = -1;
  int width() const { return right - left + 1; }
  int height() const { return bottom - top + 1; }
  bool Holds(int column, int row) const {
    return column >= left && column <= right && row >= top && row <= bottom;
  }
};

// The plane on which a spot stands, and how well it is one.
struct BackgroundPlane {
  double level_dn = 0.0;  // at the origin that was asked for
  double by_u = 0.0;      // [DN/px]
  double by_v = 0.0;
  double variance_dn2 = 0.0;    // of one pixel, by noise alone
  double slope_variance = 0.0;  // of by_u and by_v, the larger
  // RMS of what is neither plane nor noise in the frame around the spot: pipes, edges, halos.
  double structure_dn = 0.0;
};

// A copy of the pixels around one spot: an inner window that is fitted, and around it the frame
// from which the background is taken. Single precision, four pixels at a time.
class SpotPatch {
 public:
  // Rows of values() may be read this many pixels at a time.
  static constexpr int kLanes = 4;
  // What a masked pixel reads; a pixel below half of it is not masked.
  static constexpr float kMasked = 1e9f;

  explicit SpotPatch(int max_width);

  // Both boxes are cut at the image's border. Returns the clipped pixels in the inner window;
  // clipped pixels anywhere are masked.
  int Copy(const ImageView& image, int u, int v, int inner_half, int outer_half);
  // Takes away the light of another spot that is already known.
  void RemoveLight(const SpotFit& other);
  // A plane through the frame: medians of its sides and corners first, then least squares without
  // what is off by three sigma. False when too little of the frame is in the image or unclipped.
  // Looks at every `every`-th row.
  bool FitBackground(double noise_dn, double u, double v, int every);
  // From the inner window.
  void SubtractBackground();

  const PixelBox& inner() const { return inner_; }
  const BackgroundPlane& background() const { return plane_; }
  std::size_t stride() const { return stride_; }
  // First pixel of a row of the inner window.
  const float* values(int row) const { return &values_[InnerIndex(row)]; }
  void Mask(int row, int column_in_window) {
    values_[InnerIndex(row) + static_cast<std::size_t>(column_in_window)] = kMasked;
    has_masked_ = true;
  }
  bool has_masked() const { return has_masked_; }

 private:
  struct FrameSums;

  template <class Pixel>
  int CopyPixels(const ImageView& image);
  int MaskClipped(float full_dn);
  bool PlaneThroughMedians(double noise_dn);
  void FillColumnTables(float limit);
  bool RefinePlane(double limit_dn, int every);
  bool IsSettled() const;
  FrameSums AddRows() const;
  void SumRow(int row, float* sums) const;

  std::size_t OuterIndex(int row) const {
    return static_cast<std::size_t>(row - outer_.top) * stride_;
  }
  std::size_t InnerIndex(int row) const {
    return OuterIndex(row) + static_cast<std::size_t>(inner_.left - outer_.left);
  }

  PixelBox outer_;
  PixelBox inner_;
  std::size_t stride_ = 0;
  bool has_masked_ = false;
  double u_ = 0.0;  // origin of plane_
  double v_ = 0.0;
  BackgroundPlane plane_;
  double level_step_dn_ = 0.0;  // of the last refinement
  double dropped_share_ = 0.0;  // of the frame's pixels, in the last refinement
  std::vector<float> values_;   // [DN]
  // Per column of the copy: distance from u_; the limit of what is kept and of what is counted,
  // for rows above and below the inner window and for rows beside it. Zero where a column is not
  // in the frame.
  std::vector<float> column_x_;
  std::vector<float> full_limit_, full_cap_;
  std::vector<float> side_limit_, side_cap_;
  std::vector<float> gauss_u_, gauss_v_;
  // Sums over the columns of each row that was looked at, see FrameSums.
  static constexpr std::size_t kRowSums = 9;
  std::vector<float> row_sums_;
  std::vector<int> summed_rows_;
};

}  // namespace tbm
