#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pose/centres/image_levels.h"
#include "pose/centres/image_view.h"
#include "pose/centres/label_runs.h"

namespace tbm {

// The one pass over an image: the brightest pixels of each block against its threshold. Only blocks
// that exceed it are looked at again, while they are in the cache.
class ImageScanner {
 public:
  // Gives all pixels more than `offset_dn` above their surroundings to the labeller.
  void Scan(const ImageView& image, double offset_dn, LevelMap& levels, RunLabeller& labeller);

 private:
  struct BrightBlock {
    int column;
    int offset_bytes;  // from the row's first pixel
    int threshold_dn;
  };

  template <class Pixel>
  void ScanPixels(const ImageView& image,
                  double offset_dn,
                  LevelMap& levels,
                  RunLabeller& labeller);
  template <class Pixel>
  void FindBrightBlocks(const std::byte* first,
                        const ImageView& image,
                        std::span<const int> thresholds);
  template <class Pixel>
  void TakeAllBlocks(const ImageView& image, std::span<const int> thresholds);
  template <class Pixel>
  static BrightBlock BlockAt(std::size_t index, int threshold_dn);

  std::vector<BrightBlock> bright_blocks_;  // of the strip that is being searched
};

}  // namespace tbm
