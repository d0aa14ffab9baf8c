#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "pose/centres/image_view.h"
#include "pose/centres/vectors.h"

namespace tbm {

// How bright and how noisy the dark parts of an image are, from a sparse sample: four
// rows of each tile of kTileSize squared.
//
// A tile's level is a low quantile of its samples and at most a slope's worth above its
// neighbours', so that neither a lamp inside the tile nor a lamp that covers it whole raises the
// threshold around itself. Whole numbers throughout: the same on every machine.
class LevelMap {
 public:
  static constexpr int kTileSize = 64;
  // The image is searched in blocks of this many columns and rows; two above each other have a
  // threshold of their own.
  static constexpr int kBlockWidth = 32;
  static constexpr int kBlockHeight = kBlockRows;

  // Allocates only when the image has more tiles than any before.
  void Measure(const ImageView& image);

  // Level at a place, bilinear between tile centres [DN].
  float At(float u_px, float v_px) const;
  // Level plus `offset_dn`, rounded down and at most `highest`, for each block of the two strips of
  // rows that begin with `row`. Valid until the next call.
  std::span<const int> Thresholds(int row, double offset_dn, int highest);

  float median_dn() const { return median_dn_; }
  // Sigma of one dark pixel, the rounding to whole numbers included [DN].
  float noise_dn() const { return noise_dn_; }
  float saturated_fraction() const { return saturated_fraction_; }

 private:
  template <class Pixel>
  void FindLevels(const ImageView& image);
  template <class Pixel>
  void CountDifferences(const ImageView& image);
  void FindMedian();
  void LimitByNeighbours(int limit);
  void SpreadOverBlocks();
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
  std::vector<int> level_;  // of each tile [DN / kLanes]
  std::vector<int> scratch_;
  std::vector<int> block_level_;  // between tile centres along the row [DN / kLanes / 4]
  std::vector<int> thresholds_;
  std::vector<std::uint32_t> difference_count_;  // histogram of |difference| of neighbouring pixels
};

}  // namespace tbm
