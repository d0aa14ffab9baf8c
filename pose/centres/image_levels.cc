#include "pose/centres/image_levels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "pose/centres/vectors.h"

namespace tbm {
namespace {

using namespace vectors;

constexpr int kLanes = 16;  // samples of a row that lie side by side

// Stray light rises by no more than this share of full scale per pixel; what rises faster is a
// lamp.
constexpr double kSteepestSlope = 0.5 / 255.0;

// Images of at least this many tiles need fewer probes for the noise in each.
constexpr int kManyTiles = 128;

// Differences beyond are structure in any image; the last bin collects them.
constexpr std::uint32_t kLargestDifference = 4095;

// The second smallest, lane by lane.
template <class Lanes>
Lanes SecondOfFour(const Lanes& a, const Lanes& b, const Lanes& c, const Lanes& d) {
  return Darker(Brighter(Darker(a, b), Darker(c, d)), Darker(Brighter(a, b), Brighter(c, d)));
}

// Columns i, i + 16, i + 32 and i + 48 of four rows make one lane, i = 0..15; the sum of the lanes.
// `rows` are 64 pixels each.
template <class Pixel>
int SumOfLows(const std::array<const std::byte*, 4>& rows) {
  constexpr std::size_t kRegister = 16;
  std::uint32_t sum = 0;
  for (std::size_t part = 0; part < sizeof(Pixel); ++part) {
    std::array<Pixels<Pixel>, 4> low;
    for (std::size_t row = 0; row < 4; ++row) {
      const std::byte* at = rows[row] + part * kRegister;
      const auto load = [&](std::size_t i) {
        return LoadPixels<Pixel>(at + i * kRegister * sizeof(Pixel));
      };
      low[row] = SecondOfFour(load(0), load(1), load(2), load(3));
    }
    sum += SumOfLanes(SecondOfFour(low[0], low[1], low[2], low[3]));
  }
  return static_cast<int>(sum);
}

int TilesAcross(int pixels) { return (pixels + LevelMap::kTileSize - 1) / LevelMap::kTileSize; }

}  // namespace

void LevelMap::Measure(const ImageView& image) {
  columns_ = TilesAcross(image.width_px);
  rows_ = TilesAcross(image.height_px);
  const std::size_t tiles = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  level_.resize(tiles);
  scratch_.resize(tiles);
  block_level_.resize(2 * tiles);
  thresholds_.resize(2 * static_cast<std::size_t>(columns_));
  difference_count_.assign(std::min(image.max_value, kLargestDifference) + 1, 0);
  if (image.bytes_per_pixel == 1) {
    FindLevels<std::uint8_t>(image);
    CountDifferences<std::uint8_t>(image);
  } else {
    FindLevels<std::uint16_t>(image);
    CountDifferences<std::uint16_t>(image);
  }
  FindMedian();
  FindNoise();
  LimitByNeighbours(static_cast<int>(kSteepestSlope * kTileSize * kLanes * image.max_value));
  SpreadOverBlocks();
}

template <class Pixel>
void LevelMap::FindLevels(const ImageView& image) {
  const auto* first = static_cast<const std::byte*>(image.pixels);
  std::array<std::array<Pixel, kTileSize>, 4> narrow;
  for (int tile_row = 0; tile_row < rows_; ++tile_row) {
    const int y0 = tile_row * kTileSize;
    const int height = std::min(kTileSize, image.height_px - y0);
    std::array<const std::byte*, 4> rows;
    for (int row = 0; row < 4; ++row) {
      rows[static_cast<std::size_t>(row)] =
          first + (y0 + (2 * row + 1) * height / 8) * image.stride_bytes;
    }
    int* level = &level_[Index(0, tile_row)];
    for (int tile = 0; tile < image.width_px / kTileSize; ++tile) {
      *level++ = SumOfLows<Pixel>(rows);
      for (const std::byte*& row : rows) row += kTileSize * sizeof(Pixel);
    }
    const int width = image.width_px % kTileSize;
    if (width == 0) continue;
    for (std::size_t row = 0; row < 4; ++row) {
      for (int x = 0; x < kTileSize; ++x) {
        narrow[row][static_cast<std::size_t>(x)] =
            LoadPixel<Pixel>(rows[row] + x * width / kTileSize * int{sizeof(Pixel)});
      }
      rows[row] = reinterpret_cast<const std::byte*>(narrow[row].data());
    }
    *level = SumOfLows<Pixel>(rows);
  }
}

// Of neighbours here and there, in four rows of each row of tiles.
template <class Pixel>
void LevelMap::CountDifferences(const ImageView& image) {
  const auto* first = static_cast<const std::byte*>(image.pixels);
  const auto top_bin = static_cast<int>(difference_count_.size()) - 1;
  const auto full = static_cast<int>(image.max_value);
  const int every = columns_ * rows_ >= kManyTiles ? 2 * kTileSize : kTileSize / 4;
  std::uint32_t* count = difference_count_.data();
  int saturated = 0;
  int probes = 1;
  for (int tile_row = 0; tile_row < rows_; ++tile_row) {
    const int y0 = tile_row * kTileSize;
    const int height = std::min(kTileSize, image.height_px - y0);
    for (int row = 0; row < 4; ++row) {
      const std::byte* line = first + (y0 + (2 * row + 1) * height / 8) * image.stride_bytes;
      // The rows start at different columns, so that nothing periodic hides between them.
      for (int x = (2 * row + 1) * every / 8; x + 1 < image.width_px; x += every) {
        const std::byte* at = line + x * int{sizeof(Pixel)};
        const int here = LoadPixel<Pixel>(at);
        const int step = std::abs(LoadPixel<Pixel>(at + sizeof(Pixel)) - here);
        ++count[std::min(step, top_bin)];
        saturated += here >= full;
        ++probes;
      }
    }
  }
  saturated_fraction_ = static_cast<float>(saturated) / static_cast<float>(probes);
}

void LevelMap::FindMedian() {
  scratch_ = level_;
  const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
  std::nth_element(scratch_.begin(), middle, scratch_.end());
  median_dn_ = static_cast<float>(*middle) / kLanes;
}

// Root mean square of the differences after three rounds of leaving out what is beyond three sigma.
// A quantile would not do: at half a DN of noise the differences are 0, 1 and 2.
void LevelMap::FindNoise() {
  std::uint32_t all = 0;
  for (const std::uint32_t count : difference_count_) all += count;
  std::uint32_t seen = 0;
  std::size_t median = 0;
  while (median < difference_count_.size() && 2 * (seen += difference_count_[median]) < all)
    ++median;
  double limit = 3.0 * 1.4826 * (static_cast<double>(median) + 0.5) + 0.5;
  double variance = 0.0;
  for (int round = 0; round < 3; ++round) {
    const auto last = std::min(static_cast<std::size_t>(limit), difference_count_.size() - 1);
    std::uint64_t sum = 0;
    std::uint32_t count = 0;
    for (std::size_t step = 0; step <= last; ++step) {
      count += difference_count_[step];
      sum += std::uint64_t{difference_count_[step]} * (step * step);
    }
    variance = count > 0 ? static_cast<double>(sum) / count : 0.0;
    limit = 3.0 * std::sqrt(variance) + 0.5;
  }
  noise_dn_ = static_cast<float>(std::sqrt(std::max(variance / 2.0, 1.0 / 12.0)));
}

void LevelMap::LimitByNeighbours(int limit) {
  // Lowest of three across, then of three down.
  const int last_column = columns_ - 1;
  for (int row = 0; row < rows_; ++row) {
    const int* in = &level_[Index(0, row)];
    int* out = &scratch_[Index(0, row)];
    for (int column = 0; column <= last_column; ++column) {
      const int left = in[std::max(column - 1, 0)];
      const int right = in[std::min(column + 1, last_column)];
      out[column] = std::min(std::min(left, right), in[column]);
    }
  }
  for (int row = 0; row < rows_; ++row) {
    const int* above = &scratch_[Index(0, std::max(row - 1, 0))];
    const int* here = &scratch_[Index(0, row)];
    const int* below = &scratch_[Index(0, std::min(row + 1, rows_ - 1))];
    int* level = &level_[Index(0, row)];
    for (int column = 0; column <= last_column; ++column) {
      const int lowest = std::min(std::min(above[column], here[column]), below[column]);
      level[column] = std::min(level[column], lowest + limit);
    }
  }
}

// Two blocks a tile: their centres are a quarter of the way to the neighbouring tile's.
void LevelMap::SpreadOverBlocks() {
  static_assert(kTileSize == 2 * kBlockWidth);
  for (int row = 0; row < rows_; ++row) {
    const int* level = &level_[Index(0, row)];
    int* block = &block_level_[2 * Index(0, row)];
    int left = level[0];
    for (int column = 0; column < columns_; ++column) {
      const int right = level[std::min(column + 1, columns_ - 1)];
      block[2 * column] = 3 * level[column] + left;
      block[2 * column + 1] = 3 * level[column] + right;
      left = level[column];
    }
  }
}

std::span<const int> LevelMap::Thresholds(int row, double offset_dn, int highest) {
  constexpr int kSteps = 16;  // a quarter of the rows between two tile centres
  constexpr int kUnitBits = 10;
  constexpr int kUnit = 1 << kUnitBits;
  static_assert(kUnit == kLanes * 4 * kSteps);
  const int centre = (row + kBlockHeight) / (kTileSize / kSteps) - kSteps / 2;
  const int place = std::clamp(centre, 0, (rows_ - 1) * kSteps);
  const int below = place % kSteps;
  const int above = kSteps - below;
  const int* upper = &block_level_[2 * Index(0, place / kSteps)];
  const int* lower = &block_level_[2 * Index(0, std::min(place / kSteps + 1, rows_ - 1))];
  const auto offset = static_cast<int>(offset_dn * kUnit);
  int* threshold = thresholds_.data();
  const int blocks = 2 * columns_;
  for (int i = 0; i < blocks; ++i) {
    const int level = (above * upper[i] + below * lower[i] + offset) >> kUnitBits;
    threshold[i] = std::min(level, highest);
  }
  return {threshold, static_cast<std::size_t>(blocks)};
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
  const auto level = [this](int column, int row) {
    return static_cast<float>(level_[Index(column, row)]);
  };
  const float upper = level(left, top) * (1.0f - fx) + level(right, top) * fx;
  const float lower = level(left, bottom) * (1.0f - fx) + level(right, bottom) * fx;
  return (upper * (1.0f - fy) + lower * fy) / kLanes;
}

}  // namespace tbm
