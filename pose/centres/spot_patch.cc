#include "pose/centres/spot_patch.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "pose/centres/any_above.h"
#include "pose/centres/measure_spot.h"

namespace tbm {

SpotPatch::SpotPatch(int max_width) {
  const auto room = static_cast<std::size_t>(max_width + 2 * kLanes);
  values_.resize(room * room);
  use_.resize(room * room);
  gauss_.resize(room);
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
  stride_ = static_cast<std::size_t>((outer_.width() + kLanes - 1) / kLanes * kLanes + kLanes);
  return image.bytes_per_pixel == 1 ? CopyPixels<std::uint8_t>(image)
                                    : CopyPixels<std::uint16_t>(image);
}

template <class Pixel>
int SpotPatch::CopyPixels(const ImageView& image) {
  const auto* first = static_cast<const std::byte*>(image.pixels);
  const auto width = static_cast<std::size_t>(outer_.width());
  int clipped = 0;
  for (int row = outer_.top; row <= outer_.bottom; ++row) {
    const std::byte* from = first + row * image.stride_bytes + outer_.left * int{sizeof(Pixel)};
    float* value = &values_[OuterIndex(row)];
    float* use = &use_[OuterIndex(row)];
    for (std::size_t i = 0; i < width; ++i) {
      const Pixel pixel = LoadPixel<Pixel>(from + i * sizeof(Pixel));
      const bool is_clipped = pixel >= image.max_value;
      value[i] = pixel;
      use[i] = is_clipped ? 0.0f : 1.0f;
      if (is_clipped) clipped += inner_.Holds(outer_.left + static_cast<int>(i), row);
    }
    std::fill(value + width, value + stride_, 0.0f);
    std::fill(use + width, use + stride_, 0.0f);
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
  if (left > right) return;
  const auto width = static_cast<std::size_t>(right - left + 1);
  for (std::size_t i = 0; i < width; ++i) {
    const double x = (left + static_cast<double>(i) - other.u_px) / other.sigma_u_px;
    gauss_[i] = static_cast<float>(other.amplitude_dn * std::exp(-0.5 * x * x));
  }
  for (int row = top; row <= bottom; ++row) {
    const double y = (row - other.v_px) / other.sigma_v_px;
    const auto gauss = static_cast<float>(std::exp(-0.5 * y * y));
    float* value = &values_[OuterIndex(row) + static_cast<std::size_t>(left - outer_.left)];
    for (std::size_t i = 0; i < width; ++i) value[i] -= gauss * gauss_[i];
  }
}

bool SpotPatch::FitBackground(double noise_dn, double u, double v) {
  u_ = u;
  v_ = v;
  return PlaneThroughMedians(noise_dn) &&
         RefinePlane(4.0 * noise_dn + 1.0, outer_.height() > 30 ? 2 : 1) &&
         RefinePlane(3.0 * std::sqrt(plane_.variance_dn2) + 0.5, 1);
}

// The window has eight neighbours: sides and corners. Each gives the median of some of its pixels;
// the plane goes through the medians, without up to three that are off: lamps, pipes.
bool SpotPatch::PlaneThroughMedians(double noise_dn) {
  const std::array<std::array<int, 2>, 3> columns = {{{outer_.left, inner_.left - 1},
                                                      {inner_.left, inner_.right},
                                                      {inner_.right + 1, outer_.right}}};
  const std::array<std::array<int, 2>, 3> rows = {{{outer_.top, inner_.top - 1},
                                                   {inner_.top, inner_.bottom},
                                                   {inner_.bottom + 1, outer_.bottom}}};
  std::array<Eigen::Vector3d, 8> places;  // (1, u, v) from the origin
  std::array<double, 8> medians;
  std::size_t count = 0;
  for (std::size_t j = 0; j < 3; ++j) {
    for (std::size_t i = 0; i < 3; ++i) {
      const int width = columns[i][1] - columns[i][0] + 1;
      const int height = rows[j][1] - rows[j][0] + 1;
      if ((i == 1 && j == 1) || width < 1 || height < 1) continue;
      std::array<float, 15> sample;
      for (int k = 0; k < 15; ++k) {
        const int column = columns[i][0] + (2 * (k % 5) + 1) * width / 10 - outer_.left;
        const int row = rows[j][0] + (2 * (k / 5) + 1) * height / 6;
        sample[static_cast<std::size_t>(k)] =
            values_[OuterIndex(row) + static_cast<std::size_t>(column)];
      }
      std::nth_element(sample.begin(), sample.begin() + 7, sample.end());
      places[count] = {
          1.0, 0.5 * (columns[i][0] + columns[i][1]) - u_, 0.5 * (rows[j][0] + rows[j][1]) - v_};
      medians[count++] = static_cast<double>(sample[7]);
    }
  }
  if (count < 3) return false;
  for (;;) {
    Eigen::Matrix3d normal = Eigen::Vector3d(1e-9, 1e-6, 1e-6).asDiagonal();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < count; ++i) {
      normal += places[i] * places[i].transpose();
      right += places[i] * medians[i];
    }
    const Eigen::Vector3d plane = normal.ldlt().solve(right);
    plane_.level_dn = plane[0];
    plane_.by_u = plane[1];
    plane_.by_v = plane[2];
    if (count <= 5) return true;
    std::size_t worst = 0;
    double worst_dn = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double off_dn = std::abs(medians[i] - plane.dot(places[i]));
      if (off_dn > worst_dn) {
        worst_dn = off_dn;
        worst = i;
      }
    }
    if (worst_dn < 2.0 * noise_dn + 0.5) return true;
    --count;
    places[worst] = places[count];
    medians[worst] = medians[count];
  }
}

struct SpotPatch::FrameSums {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double residual2 = 0.0;    // of the pixels that were kept
  double pairs = 0.0;        // neighbours that were both kept,
  double difference2 = 0.0;  // and their differences
  double pixels = 0.0;
  double off2 = 0.0;  // of the pixels that were not kept, none counted for more than six limits
};

// Columns first .. last of one row of the copy.
void SpotPatch::AddRow(int row, int first, int last, float limit, FrameSums* sums) const {
  if (first > last) return;
  const std::size_t start = OuterIndex(row) + static_cast<std::size_t>(first - outer_.left);
  const float* value = &values_[start];
  const float* use = &use_[start];
  const double x0 = first - u_;
  const double y = row - v_;
  const auto level = static_cast<float>(plane_.level_dn + plane_.by_v * y + plane_.by_u * x0);
  const auto by_u = static_cast<float>(plane_.by_u);
  const float cap = 6.0f * limit;
  float n = 0.0f, sx = 0.0f, sxx = 0.0f, r = 0.0f, rx = 0.0f, rr = 0.0f;
  float off = 0.0f, pairs = 0.0f, steps = 0.0f;
  float last_keep = 0.0f;
  float last_residual = 0.0f;
  for (int i = 0; i <= last - first; ++i) {
    const auto x = static_cast<float>(i);
    const float residual = value[i] - level - by_u * x;
    const float size = std::abs(residual);
    const float keep = size < limit ? use[i] : 0.0f;
    const float kept = keep * residual;
    const float both = keep * last_keep;
    const float step = residual - last_residual;
    const float capped = (1.0f - keep) * std::min(size, cap);
    n += keep;
    sx += keep * x;
    sxx += keep * x * x;
    r += kept;
    rx += kept * x;
    rr += kept * kept;
    off += capped * capped;
    pairs += both;
    steps += both * step * step;
    last_keep = keep;
    last_residual = residual;
  }
  const double count = static_cast<double>(n);
  const double column = static_cast<double>(sx) + x0 * count;
  const double column2 =
      static_cast<double>(sxx) + 2.0 * x0 * static_cast<double>(sx) + x0 * x0 * count;
  Eigen::Matrix3d normal;
  normal << count, column, y * count, column, column2, y * column, y * count, y * column,
      y * y * count;
  const auto residuals = static_cast<double>(r);
  sums->normal += normal;
  sums->right +=
      Eigen::Vector3d(residuals, static_cast<double>(rx) + x0 * residuals, y * residuals);
  sums->residual2 += static_cast<double>(rr);
  sums->off2 += static_cast<double>(off);
  sums->pairs += static_cast<double>(pairs);
  sums->difference2 += static_cast<double>(steps);
  sums->pixels += last - first + 1;
}

bool SpotPatch::RefinePlane(double limit_dn, int every) {
  const auto limit = static_cast<float>(limit_dn);
  FrameSums sums;
  for (int row = outer_.top; row <= outer_.bottom; row += every) {
    const bool beside = row >= inner_.top && row <= inner_.bottom;
    AddRow(row, outer_.left, beside ? inner_.left - 1 : outer_.right, limit, &sums);
    if (beside) AddRow(row, inner_.right + 1, outer_.right, limit, &sums);
  }
  const double kept = sums.normal(0, 0);
  if (kept < 8.0 || sums.pairs < 4.0) return false;
  sums.normal.diagonal() += Eigen::Vector3d(0.0, 1e-6, 1e-6);
  const Eigen::Matrix3d inverse = sums.normal.inverse();
  const Eigen::Vector3d step = inverse * sums.right;
  plane_.level_dn += step[0];
  plane_.by_u += step[1];
  plane_.by_v += step[2];
  // Rounding to whole grey values leaves a twelfth even where every pixel reads the same.
  const double by_residuals =
      std::max((sums.residual2 - step.dot(sums.right)) / std::max(kept - 3.0, 1.0), 1.0 / 12.0);
  // Structure that is wider than a pixel does not show in the differences of neighbours.
  const double by_differences = std::max(0.5 * sums.difference2 / sums.pairs, 1.0 / 12.0);
  const double doubt = 2.5 * 2.0 / std::sqrt(kept);
  const bool flat = by_residuals < by_differences * (1.0 + doubt);
  plane_.variance_dn2 = flat ? by_residuals : by_differences;
  // A hot pixel or two beside the spot say nothing about what lies under it; a pipe does.
  const double off = std::max(sums.pixels - kept, 1.0);
  const double off2 = sums.off2 / off * std::max(off / sums.pixels - 0.015, 0.0);
  plane_.structure_dn = std::sqrt(off2 + (flat ? 0.0 : by_residuals - by_differences));
  plane_.slope_variance = by_residuals * std::max(inverse(1, 1), inverse(2, 2));
  return true;
}

void SpotPatch::SubtractBackground() {
  const auto by_u = static_cast<float>(plane_.by_u);
  for (int row = inner_.top; row <= inner_.bottom; ++row) {
    float* value = &values_[InnerIndex(row)];
    const auto level = static_cast<float>(plane_.level_dn + plane_.by_v * (row - v_) +
                                          plane_.by_u * (inner_.left - u_));
    for (int i = 0; i < inner_.width(); ++i) value[i] -= level + by_u * static_cast<float>(i);
  }
}

}  // namespace tbm
