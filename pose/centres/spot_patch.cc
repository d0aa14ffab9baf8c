#include "pose/centres/spot_patch.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pose/centres/gaussian_table.h"
#include "pose/centres/measure_spot.h"
#include "pose/centres/solve3.h"
#include "pose/centres/vectors.h"

namespace tbm {
namespace {

using namespace vectors;

// Determinant of the background's normal equations over the product of their diagonal: one for a
// frame all around the spot, 4e-4 where one corner of it is left, zero for pixels on one line.
constexpr double kFlattest = 1e-5;
constexpr int kWidened = 16;  // pixels that are made floats at a time

constexpr int RoundUp(int count, int to) { return (count + to - 1) / to * to; }

Floats Median3(const Floats& a, const Floats& b, const Floats& c) {
  return Larger(Smaller(a, b), Smaller(Larger(a, b), c));
}

}  // namespace

SpotPatch::SpotPatch(int max_width) {
  const auto room = static_cast<std::size_t>(RoundUp(max_width, kWidened) + kWidened);
  values_.resize(room * room);
  row_sums_.resize(room * kRowSums * kLanes);
  summed_rows_.reserve(room);
  for (auto* table :
       {&column_x_, &full_limit_, &full_cap_, &side_limit_, &side_cap_, &gauss_u_, &gauss_v_}) {
    table->resize(3 * room);
  }
}

int SpotPatch::Copy(const ImageView& image, int u, int v, int inner_half, int outer_half) {
  const auto box = [&](int half) {
    return PixelBox{std::max(u - half, 0),
                    std::min(u + half, image.width_px - 1),
                    std::max(v - half, 0),
                    std::min(v + half, image.height_px - 1)};
  };
  inner_ = box(inner_half);
  outer_ = box(outer_half);
  // The window may begin in the last columns and is read in whole vectors.
  has_masked_ = false;
  stride_ = static_cast<std::size_t>(RoundUp(outer_.width() + kLanes - 1, kWidened));
  return image.bytes_per_pixel == 1 ? CopyPixels<std::uint8_t>(image)
                                    : CopyPixels<std::uint16_t>(image);
}

template <class Pixel>
int SpotPatch::CopyPixels(const ImageView& image) {
  const auto* first = static_cast<const std::byte*>(image.pixels);
  const int room = static_cast<int>(stride_);
  const int in_row = std::min(room, image.width_px - outer_.left);
  const int vectors_end = in_row / kWidened * kWidened;
  auto brightest = SpreadPixel(Pixel{0});
  Pixel brightest_of_rest = 0;
  for (int row = outer_.top; row <= outer_.bottom; ++row) {
    const std::byte* from = first + row * image.stride_bytes + outer_.left * int{sizeof(Pixel)};
    float* value = &values_[OuterIndex(row)];
    for (int i = 0; i < vectors_end; i += kWidened) {
      const std::byte* at = from + i * int{sizeof(Pixel)};
      Widen<Pixel>(at, value + i);
      brightest = Brighter(brightest, LoadPixels<Pixel>(at));
      if constexpr (sizeof(Pixel) == 2) brightest = Brighter(brightest, LoadPixels<Pixel>(at + 16));
    }
    for (int i = vectors_end; i < in_row; ++i) {
      const Pixel pixel = LoadPixel<Pixel>(from + i * int{sizeof(Pixel)});
      brightest_of_rest = std::max(brightest_of_rest, pixel);
      value[i] = pixel;
    }
    for (int i = std::max(in_row, vectors_end); i < room; ++i) value[i] = 0.0f;
  }
  if (image.max_value > std::numeric_limits<Pixel>::max()) return 0;
  const auto highest_dark = static_cast<Pixel>(image.max_value - 1);
  const bool any_clipped =
      brightest_of_rest > highest_dark || AnyLane(Above(brightest, SpreadPixel(highest_dark)));
  return any_clipped ? MaskClipped(static_cast<float>(image.max_value)) : 0;
}

int SpotPatch::MaskClipped(float full_dn) {
  has_masked_ = true;
  int clipped = 0;
  for (int row = outer_.top; row <= outer_.bottom; ++row) {
    float* value = &values_[OuterIndex(row)];
    for (int i = 0; i < outer_.width(); ++i) {
      if (value[i] < full_dn) continue;
      value[i] = kMasked;
      clipped += inner_.Holds(outer_.left + i, row);
    }
  }
  return clipped;
}

void SpotPatch::RemoveLight(const SpotFit& other) {
  const double reach_u = 5.0 * other.sigma_u_px;
  const double reach_v = 5.0 * other.sigma_v_px;
  const int left = std::max(outer_.left, static_cast<int>(other.u_px - reach_u));
  const int right = std::min(outer_.right, static_cast<int>(other.u_px + reach_u));
  const int top = std::max(outer_.top, static_cast<int>(other.v_px - reach_v));
  const int bottom = std::min(outer_.bottom, static_cast<int>(other.v_px + reach_v));
  if (left > right || top > bottom) return;
  const int skip = (left - outer_.left) / kLanes * kLanes;
  const int columns = right - outer_.left - skip + 1;
  const auto first_u = static_cast<float>(outer_.left + skip - other.u_px);
  const auto first_v = static_cast<float>(top - other.v_px);
  const auto sigma_u = static_cast<float>(other.sigma_u_px);
  const auto sigma_v = static_cast<float>(other.sigma_v_px);
  FillGaussian(first_u, columns, sigma_u, gauss_u_.data());
  FillGaussian(first_v, bottom - top + 1, sigma_v, gauss_v_.data());
  const auto amplitude = static_cast<float>(other.amplitude_dn);
  for (int row = top; row <= bottom; ++row) {
    const float gauss_v = At(gauss_v_.data(), static_cast<std::size_t>(row - top)).g;
    const Floats height = Spread(amplitude * gauss_v);
    const float* gauss_u = gauss_u_.data();
    float* value = &values_[OuterIndex(row) + static_cast<std::size_t>(skip)];
    for (int i = 0; i < columns; i += kLanes, gauss_u += kTableGroup) {
      Store(value + i, MulSub(Load(value + i), height, Load(gauss_u)));
    }
  }
}

bool SpotPatch::FitBackground(double noise_dn, double u, double v, int every) {
  u_ = u;
  v_ = v;
  return PlaneThroughMedians(noise_dn) && RefinePlane(4.0 * noise_dn + 1.0, every) &&
         (IsSettled() || RefinePlane(3.0 * std::sqrt(plane_.variance_dn2) + 0.5, every));
}

// Nothing was left out that a second look could bring back, and hardly anything could be left out
// that was kept.
bool SpotPatch::IsSettled() const {
  return dropped_share_ < 0.01 && std::abs(level_step_dn_) < 0.3 * std::sqrt(plane_.variance_dn2);
}

// The window has eight neighbours: sides and corners. Each gives the median of the medians of three
// rows of three of its pixels; the plane goes through these, without up to three that are off:
// lamps, pipes.
bool SpotPatch::PlaneThroughMedians(double noise_dn) {
  constexpr std::size_t kAreas = 8;
  const std::array<std::array<int, 2>, 3> columns = {{{outer_.left, inner_.left - 1},
                                                      {inner_.left, inner_.right},
                                                      {inner_.right + 1, outer_.right}}};
  const std::array<std::array<int, 2>, 3> rows = {{{outer_.top, inner_.top - 1},
                                                   {inner_.top, inner_.bottom},
                                                   {inner_.bottom + 1, outer_.bottom}}};
  std::array<double, kAreas> place_u{};
  std::array<double, kAreas> place_v{};
  std::array<std::array<float, kAreas>, 9> sample{};
  std::size_t count = 0;
  for (std::size_t j = 0; j < 3; ++j) {
    for (std::size_t i = 0; i < 3; ++i) {
      const int width = columns[i][1] - columns[i][0] + 1;
      const int height = rows[j][1] - rows[j][0] + 1;
      if ((i == 1 && j == 1) || width < 1 || height < 1) continue;
      for (int y = 0; y < 3; ++y) {
        const float* value = &values_[OuterIndex(rows[j][0] + (2 * y + 1) * height / 6)];
        for (int x = 0; x < 3; ++x) {
          const int column = columns[i][0] - outer_.left + (2 * x + 1) * width / 6;
          sample[static_cast<std::size_t>(3 * y + x)][count] = value[column];
        }
      }
      place_u[count] = 0.5 * (columns[i][0] + columns[i][1]) - u_;
      place_v[count] = 0.5 * (rows[j][0] + rows[j][1]) - v_;
      ++count;
    }
  }
  if (count < 3) return false;
  std::array<float, kAreas> medians;
  for (std::size_t i = 0; i < kAreas; i += kLanes) {
    std::array<Floats, 3> of_row;
    for (std::size_t y = 0; y < 3; ++y) {
      const auto at = [&](std::size_t x) { return Load(&sample[3 * y + x][i]); };
      of_row[y] = Median3(at(0), at(1), at(2));
    }
    Store(&medians[i], Median3(of_row[0], of_row[1], of_row[2]));
  }
  for (;;) {
    Symmetric3 normal{1e-9, 0.0, 0.0, 1e-6, 0.0, 1e-6};
    double right0 = 0.0;
    double right1 = 0.0;
    double right2 = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double u = place_u[i];
      const double v = place_v[i];
      const double median = static_cast<double>(medians[i]);
      normal.m00 += 1.0;
      normal.m01 += u;
      normal.m02 += v;
      normal.m11 += u * u;
      normal.m12 += u * v;
      normal.m22 += v * v;
      right0 += median;
      right1 += u * median;
      right2 += v * median;
    }
    const std::array<double, 3> plane = normal.Solve(right0, right1, right2);
    plane_.level_dn = plane[0];
    plane_.by_u = plane[1];
    plane_.by_v = plane[2];
    if (count <= 5) return true;
    std::size_t worst = 0;
    double worst_dn = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double off_dn = std::abs(static_cast<double>(medians[i]) - plane[0] -
                                     plane[1] * place_u[i] - plane[2] * place_v[i]);
      if (off_dn > worst_dn) {
        worst_dn = off_dn;
        worst = i;
      }
    }
    if (worst_dn < 2.0 * noise_dn + 0.5) return true;
    --count;
    place_u[worst] = place_u[count];
    place_v[worst] = place_v[count];
    medians[worst] = medians[count];
  }
}

// Sums over the frame's pixels: of those that are kept n, n x, n x^2, r, r x with residuals r, the
// same times y, squared residuals, neighbours that were both kept and their squared differences;
// of all of them the squared residuals, none counted for more than six limits. The order of the
// first nine is that of a row's sums.
struct SpotPatch::FrameSums {
  Floats n = Spread(0.0f), nx = n, nxx = n, r = n, rx = n, rr = n, all = n, pairs = n, steps = n;
  Floats ny = n, nxy = n, nyy = n, ry = n;
};

void SpotPatch::FillColumnTables(float limit) {
  const auto at = [](std::vector<float>& table, int column) { return table.begin() + column; };
  const int window_begin = inner_.left - outer_.left;
  const int window_end = inner_.right - outer_.left + 1;
  const int width = outer_.width();
  const int room = static_cast<int>(stride_);
  const auto fill = [&](std::vector<float>& full, std::vector<float>& side, float value) {
    std::fill(at(full, 0), at(full, width), value);
    std::fill(at(full, width), at(full, room), 0.0f);
    std::copy(at(full, 0), at(full, room), at(side, 0));
    std::fill(at(side, window_begin), at(side, window_end), 0.0f);
  };
  fill(full_limit_, side_limit_, limit);
  fill(full_cap_, side_cap_, 6.0f * limit);
  const float ramp[4] = {0.0f, 1.0f, 2.0f, 3.0f};
  Floats x = Spread(static_cast<float>(outer_.left - u_)) + Load(ramp);
  for (std::size_t column = 0; column < stride_; column += kLanes) {
    Store(&column_x_[column], x);
    x = x + Spread(4.0f);
  }
}

void SpotPatch::SumRow(int row, float* sums) const {
  const bool beside = row >= inner_.top && row <= inner_.bottom;
  const float* limit = beside ? side_limit_.data() : full_limit_.data();
  const float* cap = beside ? side_cap_.data() : full_cap_.data();
  const float* value = &values_[OuterIndex(row)];
  const Floats level = Spread(static_cast<float>(plane_.level_dn + plane_.by_v * (row - v_)));
  const Floats by_u = Spread(static_cast<float>(plane_.by_u));
  const Floats one = Spread(1.0f);
  Floats n = Spread(0.0f), nx = n, nxx = n, r = n, rx = n, rr = n, all = n, pairs = n, steps = n;
  Floats kept_before = n;
  Floats residual_before = n;
  const int end = RoundUp(outer_.width(), kLanes);
  // Beside the window nothing is looked at between the first column that is not in the frame and
  // the last.
  const int gap_begin = beside ? RoundUp(inner_.left - outer_.left, kLanes) : end;
  const int gap_end = beside ? (inner_.right - outer_.left + 1) / kLanes * kLanes : end;
  for (int i = 0; i < end; i += kLanes) {
    if (i == gap_begin) {
      i = std::max(gap_begin, gap_end);
      kept_before = Spread(0.0f);
    }
    if (i >= end) break;
    const Floats x = Load(&column_x_[static_cast<std::size_t>(i)]);
    const Floats residual = Load(value + i) - MulAdd(level, by_u, x);
    const Floats size = Absolute(residual);
    const vectors::Mask keep = IsLess(size, Load(limit + i));
    const Floats kept = Where(keep, one);
    const Floats kept_residual = Where(keep, residual);
    const Floats kept_x = Where(keep, x);
    const Floats both = kept * LeftNeighbours(kept_before, kept);
    const Floats step = residual - LeftNeighbours(residual_before, residual);
    const Floats capped = Smaller(size, Load(cap + i));
    n = n + kept;
    nx = nx + kept_x;
    nxx = MulAdd(nxx, kept_x, x);
    r = r + kept_residual;
    rx = MulAdd(rx, kept_residual, x);
    rr = MulAdd(rr, kept_residual, kept_residual);
    all = MulAdd(all, capped, capped);
    pairs = pairs + both;
    steps = MulAdd(steps, both * step, step);
    kept_before = kept;
    residual_before = residual;
  }
  for (const Floats& sum : {n, nx, nxx, r, rx, rr, all, pairs, steps}) {
    Store(sums, sum);
    sums += kLanes;
  }
}

SpotPatch::FrameSums SpotPatch::AddRows() const {
  FrameSums all;
  const float* sums = row_sums_.data();
  for (const int row : summed_rows_) {
    const Floats y = Spread(static_cast<float>(row - v_));
    const Floats n = Load(sums);
    const Floats nx = Load(sums + kLanes);
    const Floats r = Load(sums + 3 * kLanes);
    const Floats ny = n * y;
    all.n = all.n + n;
    all.nx = all.nx + nx;
    all.nxx = all.nxx + Load(sums + 2 * kLanes);
    all.r = all.r + r;
    all.rx = all.rx + Load(sums + 4 * kLanes);
    all.rr = all.rr + Load(sums + 5 * kLanes);
    all.all = all.all + Load(sums + 6 * kLanes);
    all.pairs = all.pairs + Load(sums + 7 * kLanes);
    all.steps = all.steps + Load(sums + 8 * kLanes);
    all.ny = all.ny + ny;
    all.nxy = MulAdd(all.nxy, nx, y);
    all.nyy = MulAdd(all.nyy, ny, y);
    all.ry = MulAdd(all.ry, r, y);
    sums += kRowSums * kLanes;
  }
  return all;
}

bool SpotPatch::RefinePlane(double limit_dn, int every) {
  FillColumnTables(static_cast<float>(limit_dn));
  summed_rows_.clear();
  double pixels = 0.0;
  for (int row = outer_.top; row <= outer_.bottom; row += every) {
    const bool beside = row >= inner_.top && row <= inner_.bottom;
    SumRow(row, &row_sums_[summed_rows_.size() * kRowSums * kLanes]);
    summed_rows_.push_back(row);
    pixels += outer_.width() - (beside ? inner_.width() : 0);
  }
  const FrameSums sums = AddRows();
  const auto total = [](const Floats& of) { return static_cast<double>(Sum(of)); };
  const double kept = total(sums.n);
  const double neighbours = total(sums.pairs);
  if (kept < 8.0 || neighbours < 4.0) return false;
  const Symmetric3 normal{kept,
                          total(sums.nx),
                          total(sums.ny),
                          total(sums.nxx) + 1e-6,
                          total(sums.nxy),
                          total(sums.nyy) + 1e-6};
  // What is left stands nearly on one line: it says nothing of the slope across.
  const double determinant = normal.Determinant();
  if (!(determinant > kFlattest * normal.m00 * normal.m11 * normal.m22)) return false;
  const double r = total(sums.r);
  const double rx = total(sums.rx);
  const double ry = total(sums.ry);
  const std::array<double, 3> step = normal.Solve(r, rx, ry);
  plane_.level_dn += step[0];
  plane_.by_u += step[1];
  plane_.by_v += step[2];
  level_step_dn_ = step[0];
  dropped_share_ = 1.0 - kept / pixels;
  const double squared = total(sums.rr);
  // Rounding to whole grey values leaves a twelfth even where every pixel reads the same.
  const double explained = step[0] * r + step[1] * rx + step[2] * ry;
  const double by_residuals =
      std::max((squared - explained) / std::max(kept - 3.0, 1.0), 1.0 / 12.0);
  // Structure that is wider than a pixel does not show in the differences of neighbours.
  const double by_differences = std::max(0.5 * total(sums.steps) / neighbours, 1.0 / 12.0);
  const double doubt = 2.5 * 2.0 / std::sqrt(kept);
  const bool flat = by_residuals < by_differences * (1.0 + doubt);
  plane_.variance_dn2 = flat ? by_residuals : by_differences;
  // A hot pixel or two beside the spot say nothing about what lies under it; a pipe does.
  const double off = std::max(pixels - kept, 1.0);
  const double off2 =
      std::max(total(sums.all) - squared, 0.0) / off * std::max(off / pixels - 0.015, 0.0);
  plane_.structure_dn = std::sqrt(off2 + (flat ? 0.0 : by_residuals - by_differences));
  plane_.slope_variance = by_residuals / determinant * std::max(normal.c11(), normal.c22());
  return true;
}

void SpotPatch::SubtractBackground() {
  const int columns = static_cast<int>(RoundUpToLanes(inner_.width()));
  const Floats by_u = Spread(static_cast<float>(plane_.by_u));
  for (int row = inner_.top; row <= inner_.bottom; ++row) {
    float* value = &values_[InnerIndex(row)];
    const float* x = &column_x_[static_cast<std::size_t>(inner_.left - outer_.left)];
    const Floats level = Spread(static_cast<float>(plane_.level_dn + plane_.by_v * (row - v_)));
    for (int i = 0; i < columns; i += kLanes) {
      Store(value + i, Load(value + i) - MulAdd(level, by_u, Load(x + i)));
    }
  }
}

}  // namespace tbm
