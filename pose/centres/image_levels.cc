#include "pose/centres/image_levels.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pose/centres/any_above.h"

namespace tbm {
namespace {

// Stray light rises by no more than this share of full scale per pixel; what rises faster is a
// lamp.
constexpr float kSteepestSlope = 0.5f / 255.0f;

// Differences beyond are structure in any image; the last bin collects them.
constexpr std::uint32_t kLargestDifference = 4095;

// The second smallest.
int SecondOfFour(int a, int b, int c, int d) {
  return std::min(std::max(std::min(a, b), std::min(c, d)),
                  std::min(std::max(a, b), std::max(c, d)));
}

int TilesAcross(int pixels) { return (pixels + LevelMap::kTileSize - 1) / LevelMap::kTileSize; }

}  // namespace

void LevelMap::Measure(const ImageView& image) {
  columns_ = TilesAcross(image.width_px);
  rows_ = TilesAcross(image.height_px);
  const std::size_t tiles = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  level_.resize(tiles);
  scratch_.resize(tiles);
  along_row_.resize(static_cast<std::size_t>(columns_ * (kTileSize / kPieceWidth)));
  difference_count_.assign(std::min(image.max_value, kLargestDifference) + 1, 0);
  if (image.bytes_per_pixel == 1) {
    Sample<std::uint8_t>(image);
  } else {
    Sample<std::uint16_t>(image);
  }
  FindNoise();
  LimitByNeighbours(kSteepestSlope * static_cast<float>(kTileSize) *
                    static_cast<float>(image.max_value));
}

template <class Pixel>
void LevelMap::Sample(const ImageView& image) {
  const auto* first = static_cast<const std::byte*>(image.pixels);
  const auto top_bin = static_cast<int>(difference_count_.size()) - 1;
  int saturated = 0;
  for (int tile_row = 0; tile_row < rows_; ++tile_row) {
    const int y0 = tile_row * kTileSize;
    const int height = std::min(kTileSize, image.height_px - y0);
    for (int tile_column = 0; tile_column < columns_; ++tile_column) {
      const int x0 = tile_column * kTileSize;
      const int width = std::min(kTileSize, image.width_px - x0);
      std::array<int, kSamplesPerTile> sample;
      for (int row = 0; row < 4; ++row) {
        // Each row of samples starts elsewhere, so that nothing periodic hides between them.
        int x = x0 + (2 * row + 1) * width / 32;
        const std::byte* line = first + (y0 + (2 * row + 1) * height / 8) * image.stride_bytes;
        for (int i = 0; i < 4; ++i, x += width / 4) {
          const std::byte* at = line + x * int{sizeof(Pixel)};
          const int here = LoadPixel<Pixel>(at);
          sample[static_cast<std::size_t>(4 * row + i)] = here;
          saturated += static_cast<std::uint32_t>(here) >= image.max_value;
          // Every other sample will do for the noise: thousands of differences in a camera's image.
          if (i % 2 == 0 && x + 1 < image.width_px) {
            const int step = std::abs(LoadPixel<Pixel>(at + sizeof(Pixel)) - here);
            ++difference_count_[static_cast<std::size_t>(std::min(step, top_bin))];
          }
        }
      }
      const auto low = [&sample](std::size_t row) {
        return SecondOfFour(
            sample[4 * row], sample[4 * row + 1], sample[4 * row + 2], sample[4 * row + 3]);
      };
      level_[Index(tile_column, tile_row)] =
          static_cast<float>(SecondOfFour(low(0), low(1), low(2), low(3)));
    }
  }
  saturated_fraction_ =
      static_cast<float>(saturated) /
      static_cast<float>(static_cast<std::size_t>(kSamplesPerTile) * level_.size());
  scratch_ = level_;
  const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
  std::nth_element(scratch_.begin(), middle, scratch_.end());
  median_dn_ = *middle;
}

// Root mean square of the differences after three rounds of leaving out what is beyond three sigma.
// A quantile would not do: at half a DN of noise the differences are 0, 1 and 2.
void LevelMap::FindNoise() {
  std::uint64_t all = 0;
  for (const std::uint32_t count : difference_count_) all += count;
  std::uint64_t seen = 0;
  std::size_t median = 0;
  while (median < difference_count_.size() && 2 * (seen += difference_count_[median]) < all)
    ++median;
  double limit = 3.0 * 1.4826 * (static_cast<double>(median) + 0.5) + 0.5;
  double variance = 0.0;
  for (int round = 0; round < 3; ++round) {
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t step = 0; step < difference_count_.size(); ++step) {
      if (static_cast<double>(step) > limit) break;
      const double here = difference_count_[step];
      count += here;
      sum += here * static_cast<double>(step * step);
    }
    variance = count > 0.0 ? sum / count : 0.0;
    limit = 3.0 * std::sqrt(variance) + 0.5;
  }
  noise_dn_ = static_cast<float>(std::sqrt(std::max(variance / 2.0, 1.0 / 12.0)));
}

void LevelMap::LimitByNeighbours(float limit_dn) {
  const auto lowest_of_nine = [this](const std::vector<float>& of, int column, int row) {
    float lowest = of[Index(column, row)];
    for (int y = std::max(row - 1, 0); y <= std::min(row + 1, rows_ - 1); ++y) {
      for (int x = std::max(column - 1, 0); x <= std::min(column + 1, columns_ - 1); ++x) {
        lowest = std::min(lowest, of[Index(x, y)]);
      }
    }
    return lowest;
  };
  scratch_ = level_;
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      float& level = level_[Index(column, row)];
      level = std::min(level, lowest_of_nine(scratch_, column, row) + limit_dn);
    }
  }
}

float LevelMap::At(float u_px, float v_px) const {
  constexpr float kTile = static_cast<float>(kTileSize);
  const float x = std::clamp(u_px / kTile - 0.5f, 0.0f, static_cast<float>(columns_ - 1));
  const float y = std::clamp(v_px / kTile - 0.5f, 0.0f, static_cast<float>(rows_ - 1));
  const int left = static_cast<int>(x);
  const int top = static_cast<int>(y);
  const int right = std::min(left + 1, columns_ - 1);
  const int bottom = std::min(top + 1, rows_ - 1);
  const float fx = x - static_cast<float>(left);
  const float fy = y - static_cast<float>(top);
  const float upper = level_[Index(left, top)] * (1.0f - fx) + level_[Index(right, top)] * fx;
  const float lower = level_[Index(left, bottom)] * (1.0f - fx) + level_[Index(right, bottom)] * fx;
  return upper * (1.0f - fy) + lower * fy;
}

std::span<const float> LevelMap::AlongRow(float v_px) {
  constexpr float kTile = static_cast<float>(kTileSize);
  constexpr int kPieces = kTileSize / kPieceWidth;
  const float y = std::clamp(v_px / kTile - 0.5f, 0.0f, static_cast<float>(rows_ - 1));
  const int top = static_cast<int>(y);
  const int bottom = std::min(top + 1, rows_ - 1);
  const float fraction = y - static_cast<float>(top);
  const auto at_centre = [&](int column) {
    return level_[Index(column, top)] * (1.0f - fraction) +
           level_[Index(column, bottom)] * fraction;
  };
  float left = at_centre(0);
  float centre = left;
  for (int column = 0; column < columns_; ++column) {
    const float right = column + 1 < columns_ ? at_centre(column + 1) : centre;
    for (int piece = 0; piece < kPieces; ++piece) {
      const float from_centre = (static_cast<float>(piece) + 0.5f) / kPieces - 0.5f;
      const float other = from_centre < 0.0f ? left : right;
      along_row_[static_cast<std::size_t>(column * kPieces + piece)] =
          centre + std::abs(from_centre) * (other - centre);
    }
    left = centre;
    centre = right;
  }
  return along_row_;
}

}  // namespace tbm
