#include "pose/centres/scan_image.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>

#include "pose/centres/vectors.h"

namespace tbm {
namespace {

constexpr int kBlockWidth = LevelMap::kBlockWidth;
constexpr int kBlockHeight = LevelMap::kBlockHeight;

}  // namespace

template <class Pixel>
ImageScanner::BrightBlock ImageScanner::BlockAt(std::size_t index, int threshold_dn) {
  const int column = static_cast<int>(index) * kBlockWidth;
  return {column, column * int{sizeof(Pixel)}, threshold_dn};
}

void ImageScanner::Scan(const ImageView& image,
                        double offset_dn,
                        LevelMap& levels,
                        RunLabeller& labeller) {
  bright_blocks_.reserve(static_cast<std::size_t>(image.width_px / kBlockWidth));
  if (image.bytes_per_pixel == 1) {
    ScanPixels<std::uint8_t>(image, offset_dn, levels, labeller);
  } else {
    ScanPixels<std::uint16_t>(image, offset_dn, levels, labeller);
  }
}

template <class Pixel>
void ImageScanner::ScanPixels(const ImageView& image,
                              double offset_dn,
                              LevelMap& levels,
                              RunLabeller& labeller) {
  const auto* first = static_cast<const std::byte*>(image.pixels);
  const int highest =
      static_cast<int>(std::min<std::uint32_t>(image.max_value, std::numeric_limits<Pixel>::max()));
  const int columns = image.width_px / kBlockWidth * kBlockWidth;
  std::span<const int> thresholds;
  for (int row = 0; row < image.height_px; row += kBlockHeight) {
    const int rows = std::min(kBlockHeight, image.height_px - row);
    if (row % (2 * kBlockHeight) == 0) thresholds = levels.Thresholds(row, offset_dn, highest);
    if (rows == kBlockHeight) {
      FindBrightBlocks<Pixel>(first + row * image.stride_bytes, image, thresholds);
    } else {
      TakeAllBlocks<Pixel>(image, thresholds);
    }
    const bool has_rest = columns < image.width_px;
    if (bright_blocks_.empty() && !has_rest) continue;
    for (int y = row; y < row + rows; ++y) {
      const std::byte* row_start = first + y * image.stride_bytes;
      for (const BrightBlock& block : bright_blocks_) {
        const std::uint32_t bits = vectors::BitsAbove(row_start + block.offset_bytes,
                                                      static_cast<Pixel>(block.threshold_dn));
        labeller.AddBits(y, block.column, bits, block.threshold_dn);
      }
      if (!has_rest) continue;
      labeller.Scan<Pixel>(image, y, columns, image.width_px, thresholds[columns / kBlockWidth]);
    }
  }
}

// Among the whole blocks of one strip. Asks the vector unit once for kGroup blocks: an answer takes
// it longer than folding a block.
template <class Pixel>
void ImageScanner::FindBrightBlocks(const std::byte* first,
                                    const ImageView& image,
                                    std::span<const int> thresholds) {
  using namespace vectors;
  constexpr std::size_t kGroup = 8;
  constexpr std::size_t kRegister = 16;
  constexpr std::size_t kBlockBytes = std::size_t{kBlockWidth} * sizeof(Pixel);
  const auto blocks = static_cast<std::size_t>(image.width_px / kBlockWidth);
  const std::ptrdiff_t stride_bytes = image.stride_bytes;
  std::array<std::byte, kGroup * kRegister> flags;
  bright_blocks_.clear();
  for (std::size_t group = 0; group < blocks; group += kGroup) {
    const std::size_t end = std::min(group + kGroup, blocks);
    auto any = SpreadPixel(Pixel{0});
    std::byte* flag = flags.data();
    const auto compare = [&](const Pixels<Pixel>& best, std::size_t block) {
      const auto above = Above(best, SpreadPixel(static_cast<Pixel>(thresholds[block])));
      StorePixels(flag, above);
      flag += kRegister;
      any = Brighter(any, above);
    };
    std::size_t block = group;
    for (; block + 2 <= end; block += 2) {
      const auto best = BrightestOfBlocks<Pixel>(first, stride_bytes);
      compare(best.left, block);
      compare(best.right, block + 1);
      first += 2 * kBlockBytes;
    }
    if (block < end) {
      compare(BrightestOfBlock<Pixel>(first, stride_bytes), block);
      first += kBlockBytes;
    }
    if (!AnyLane(any)) continue;
    for (block = group; block < end; ++block) {
      std::array<std::uint32_t, 4> words;
      std::memcpy(words.data(), &flags[(block - group) * kRegister], sizeof words);
      if ((words[0] | words[1] | words[2] | words[3]) == 0) continue;
      bright_blocks_.push_back(BlockAt<Pixel>(block, thresholds[block]));
    }
  }
}

// Of a strip of fewer rows, at the lower end of an image.
template <class Pixel>
void ImageScanner::TakeAllBlocks(const ImageView& image, std::span<const int> thresholds) {
  const auto blocks = static_cast<std::size_t>(image.width_px / kBlockWidth);
  bright_blocks_.clear();
  for (std::size_t block = 0; block < blocks; ++block) {
    bright_blocks_.push_back(BlockAt<Pixel>(block, thresholds[block]));
  }
}

}  // namespace tbm
