#pragma once

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
// from which the background is taken.
class SpotPatch {
 public:
  // Rows of values() and use() may be read this many pixels at a time.
  static constexpr int kLanes = 4;

  explicit SpotPatch(int max_width);

  // Both boxes are cut at the image's border. Returns the clipped pixels in the inner window.
  int Copy(const ImageView& image, int u, int v, int inner_half, int outer_half);
  // Takes away the light of another spot that is already known.
  void RemoveLight(const SpotFit& other);
  // A plane through the frame: medians of its sides and corners first, then least squares without
  // what is off by three sigma. False when too little of the frame is in the image or unclipped.
  bool FitBackground(double noise_dn, double u, double v);
  // From the inner window.
  void SubtractBackground();

  const PixelBox& inner() const { return inner_; }
  const BackgroundPlane& background() const { return plane_; }
  std::size_t stride() const { return stride_; }
  // First pixel of a row of the inner window; `use` is 1, or 0 where a pixel is masked.
  const float* values(int row) const { return &values_[InnerIndex(row)]; }
  const float* use(int row) const { return &use_[InnerIndex(row)]; }
  void Mask(int row, int column_in_window) {
    use_[InnerIndex(row) + static_cast<std::size_t>(column_in_window)] = 0.0f;
  }

 private:
  struct FrameSums;

  template <class Pixel>
  int CopyPixels(const ImageView& image);
  bool PlaneThroughMedians(double noise_dn);
  // From every row, or every second: enough for a start.
  bool RefinePlane(double limit_dn, int every);
  void AddRow(int row, int first, int last, float limit, FrameSums* sums) const;

  std::size_t OuterIndex(int row) const {
    return static_cast<std::size_t>(row - outer_.top) * stride_;
  }
  std::size_t InnerIndex(int row) const {
    return OuterIndex(row) + static_cast<std::size_t>(inner_.left - outer_.left);
  }

  PixelBox outer_;
  PixelBox inner_;
  std::size_t stride_ = 0;
  double u_ = 0.0;  // origin of plane_
  double v_ = 0.0;
  BackgroundPlane plane_;
  std::vector<float> values_;  // [DN]
  std::vector<float> use_;
  std::vector<float> gauss_;
};

}  // namespace tbm
