#include "tests/support/render.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include <Eigen/Cholesky>

namespace tbm::test {
namespace {

// Integral of the unit-height Gaussian over one pixel's width.
double PixelShare(double offset_px, double sigma_px) {
  const double s = sigma_px * std::numbers::sqrt2;
  return sigma_px * std::sqrt(0.5 * std::numbers::pi) *
         (std::erf((offset_px + 0.5) / s) - std::erf((offset_px - 0.5) / s));
}

double SigmaV(const RenderSpot& spot) {
  return spot.sigma_v_px > 0.0 ? spot.sigma_v_px : spot.sigma_px;
}

void AddSpot(const RenderScene& scene, const RenderSpot& spot, std::vector<double>& mean) {
  const double length = spot.smear_px.norm();
  const int steps = length > 0.0 ? 2 * static_cast<int>(std::ceil(4.0 * length)) + 1 : 1;
  const double reach = 8.0 * std::max(spot.sigma_px, SigmaV(spot)) + length;
  const int left = std::max(0, static_cast<int>(spot.pixel_px.x() - reach));
  const int right = std::min(scene.width_px - 1, static_cast<int>(spot.pixel_px.x() + reach));
  const int top = std::max(0, static_cast<int>(spot.pixel_px.y() - reach));
  const int bottom = std::min(scene.height_px - 1, static_cast<int>(spot.pixel_px.y() + reach));
  std::vector<double> share_u(static_cast<std::size_t>(std::max(right - left + 1, 0)));
  for (int step = 0; step < steps; ++step) {
    const Eigen::Vector2d centre =
        spot.pixel_px + spot.smear_px * ((step + 0.5) / static_cast<double>(steps) - 0.5);
    for (int u = left; u <= right; ++u) {
      share_u[static_cast<std::size_t>(u - left)] = PixelShare(u - centre.x(), spot.sigma_px);
    }
    for (int v = top; v <= bottom; ++v) {
      const double share_v = spot.peak_dn / steps * PixelShare(v - centre.y(), SigmaV(spot));
      for (int u = left; u <= right; ++u) {
        mean[static_cast<std::size_t>(v * scene.width_px + u)] +=
            share_v * share_u[static_cast<std::size_t>(u - left)];
      }
    }
  }
}

}  // namespace

void RenderedImage::Set(int column, int row, std::uint32_t value) {
  std::uint8_t* at = bytes.data() + row * view.stride_bytes + column * view.bytes_per_pixel;
  const auto wide = static_cast<std::uint16_t>(value);
  if (view.bytes_per_pixel == 1) {
    *at = static_cast<std::uint8_t>(value);
  } else {
    std::memcpy(at, &wide, sizeof wide);
  }
}

std::uint32_t RenderedImage::At(int column, int row) const {
  const std::uint8_t* at = bytes.data() + row * view.stride_bytes + column * view.bytes_per_pixel;
  if (view.bytes_per_pixel == 1) return *at;
  std::uint16_t wide = 0;
  std::memcpy(&wide, at, sizeof wide);
  return wide;
}

std::vector<double> RenderMean(const RenderScene& scene) {
  std::vector<double> mean(static_cast<std::size_t>(scene.width_px * scene.height_px));
  for (int v = 0; v < scene.height_px; ++v) {
    for (int u = 0; u < scene.width_px; ++u) {
      mean[static_cast<std::size_t>(v * scene.width_px + u)] =
          scene.background_dn + scene.slope_dn_per_px.dot(Eigen::Vector2d(u, v));
    }
  }
  for (const RenderSpot& spot : scene.spots) AddSpot(scene, spot, mean);
  return mean;
}

RenderedImage Render(const RenderScene& scene,
                     const std::vector<double>& mean,
                     Random& random,
                     int bytes_per_pixel,
                     std::uint32_t max_value,
                     int padding_bytes) {
  RenderedImage image;
  const int stride = scene.width_px * bytes_per_pixel + padding_bytes;
  image.bytes.assign(static_cast<std::size_t>(stride * scene.height_px), 255);
  image.view = {
      image.bytes.data(), scene.width_px, scene.height_px, stride, bytes_per_pixel, max_value};
  const auto put = [&](int column, int row, double dn) {
    const double clipped = std::clamp(std::round(dn), 0.0, static_cast<double>(max_value));
    image.Set(column, row, static_cast<std::uint32_t>(clipped));
  };
  std::vector<double> noisy(mean.size());
  for (std::size_t i = 0; i < mean.size(); ++i) {
    const double variance = scene.read_noise_dn * scene.read_noise_dn +
                            scene.gain_dn_per_electron * std::max(mean[i], 0.0);
    noisy[i] = mean[i] + random.Normal(std::sqrt(variance));
  }
  for (const RenderScene::Hot& hot : scene.hot) {
    noisy[static_cast<std::size_t>(hot.row * scene.width_px + hot.column)] += hot.extra_dn;
  }
  for (int v = 0; v < scene.height_px; ++v) {
    for (int u = 0; u < scene.width_px; ++u) {
      put(u, v, noisy[static_cast<std::size_t>(v * scene.width_px + u)]);
    }
  }
  return image;
}

double CentreBoundPx(const RenderScene& scene, const RenderSpot& spot, bool nuisance) {
  RenderScene alone = scene;
  alone.spots = {spot};
  alone.hot.clear();
  const int reach = static_cast<int>(std::ceil(8.0 * spot.sigma_px));
  alone.width_px = alone.height_px = 2 * reach + 1;
  const Eigen::Vector2d whole(std::round(spot.pixel_px.x()), std::round(spot.pixel_px.y()));
  alone.background_dn += scene.slope_dn_per_px.dot(whole - Eigen::Vector2d(reach, reach));
  alone.spots[0].pixel_px += Eigen::Vector2d(reach, reach) - whole;

  // Parameters: u, v, amplitude, spread, background, its two slopes.
  const auto vary = [&](int parameter, double by) {
    RenderScene other = alone;
    RenderSpot& s = other.spots[0];
    if (parameter == 0) s.pixel_px.x() += by;
    if (parameter == 1) s.pixel_px.y() += by;
    if (parameter == 2) s.peak_dn += by;
    if (parameter == 3) s.sigma_px += by;
    if (parameter == 4) other.background_dn += by;
    if (parameter == 5) other.slope_dn_per_px.x() += by;
    if (parameter == 6) other.slope_dn_per_px.y() += by;
    return RenderMean(other);
  };
  constexpr double kStep = 1e-4;
  const int parameters = nuisance ? 7 : 2;
  const std::vector<double> mean = RenderMean(alone);
  std::vector<std::vector<double>> by(static_cast<std::size_t>(parameters));
  for (int p = 0; p < parameters; ++p) {
    const std::vector<double> above = vary(p, kStep);
    const std::vector<double> below = vary(p, -kStep);
    auto& column = by[static_cast<std::size_t>(p)];
    column.resize(mean.size());
    for (std::size_t i = 0; i < mean.size(); ++i) column[i] = (above[i] - below[i]) / (2.0 * kStep);
  }
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(parameters, parameters);
  for (std::size_t i = 0; i < mean.size(); ++i) {
    const double variance = scene.read_noise_dn * scene.read_noise_dn +
                            scene.gain_dn_per_electron * std::max(mean[i], 0.0) + 1.0 / 12.0;
    for (int p = 0; p < parameters; ++p) {
      for (int q = 0; q < parameters; ++q) {
        information(p, q) +=
            by[static_cast<std::size_t>(p)][i] * by[static_cast<std::size_t>(q)][i] / variance;
      }
    }
  }
  const Eigen::MatrixXd covariance = information.inverse();
  return std::sqrt(0.5 * (covariance(0, 0) + covariance(1, 1)));
}

}  // namespace tbm::test
