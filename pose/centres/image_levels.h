#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "pose/centres/image_view.h"

namespace tbm {

// How bright and how noisy the dark parts of an image are, from a sparse sample: kSamplesPerTile
// pairs of neighbouring pixels in each tile of kTileSize squared, less than 1 % of the image.
//
// A tile's level is a low quantile of its samples and at most a slope's worth above its
// neighbours', so that neither a lamp inside the tile nor a lamp that covers it whole raises the
// threshold around itself.
class LevelMap {
 public:
  static constexpr int kTileSize = 64;
  static constexpr int kSamplesPerTile = 16;

  // Allocates only when the image has more tiles than any before.
  void Measure(const ImageView& image);

  // Level at a place, bilinear between tile centres [DN].
  float At(float u_px, float v_px) const;
  // The levels of a strip of rows with the middle row `v_px`, for each kPieceWidth columns.
  static constexpr int kPieceWidth = 16;
  std::span<const float> AlongRow(float v_px);

  float median_dn() const { return median_dn_; }
  // Sigma of one dark pixel, the rounding to whole numbers included [DN].
  float noise_dn() const { return noise_dn_; }
  float saturated_fraction() const { return saturated_fraction_; }

 private:
  template <class Pixel>
  void Sample(const ImageView& image);
  void LimitByNeighbours(float limit_dn);
  void FindNoise();
  std::size_t Index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  int columns_ = 0;
  int rows_ = 0;
  float median_dn_ = 0.0f;
  float noise_dn_ = 0.0f;
  float saturated_fraction_ = 0.0f;
  std::vector<float> level_;
  std::vector<float> scratch_;
  std::vector<float> along_row_;
  std::vector<std::uint32_t> difference_count_;  // histogram of |difference| of neighbouring pixels
};

}  // namespace tbm
