#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "pose/centres/image_view.h"
#include "tests/support/random.h"

namespace tbm::test {

// A lamp as a lens shows it: a Gaussian, smeared evenly along a straight line while the shutter is
// open. Integrated over each pixel's square (exactly along the image axes; the smear is summed from
// short steps).
struct RenderSpot {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();  // middle of the smear
  double sigma_px = 2.5;
  double sigma_v_px = 0.0;  // 0: as sigma_px
  double peak_dn = 200.0;  // of the density: what an endlessly small pixel at the centre would read
  Eigen::Vector2d smear_px = Eigen::Vector2d::Zero();  // from one end to the other
};

struct RenderScene {
  int width_px = 128;
  int height_px = 128;
  double background_dn = 10.0;  // at pixel (0, 0)
  Eigen::Vector2d slope_dn_per_px = Eigen::Vector2d::Zero();
  double read_noise_dn = 0.5;
  double gain_dn_per_electron = 0.02;
  std::vector<RenderSpot> spots;
  struct Hot {
    int column, row;
    double extra_dn;
  };
  std::vector<Hot> hot;
};

struct RenderedImage {
  std::vector<std::uint8_t> bytes;
  ImageView view;  // of `bytes`

  RenderedImage() = default;
  RenderedImage(RenderedImage&&) = default;
  RenderedImage& operator=(RenderedImage&&) = default;
  void Set(int column, int row, std::uint32_t value);
  std::uint32_t At(int column, int row) const;
};

// Mean of every pixel, before noise, rounding and clipping. Row-major.
std::vector<double> RenderMean(const RenderScene& scene);

// Photon noise (normal, variance gain times signal), read noise, rounding, clipping at max_value.
// `padding_bytes` more in each row than needed, filled with full scale.
RenderedImage Render(const RenderScene& scene,
                     const std::vector<double>& mean,
                     Random& random,
                     int bytes_per_pixel = 1,
                     std::uint32_t max_value = 255,
                     int padding_bytes = 0);
inline RenderedImage Render(const RenderScene& scene, Random& random) {
  return Render(scene, RenderMean(scene), random);
}

// Cramer-Rao bound of one coordinate of a spot alone on its plane, one sigma [px], from the pixel-
// integrated model in a window of +-8 sigma, variance = read^2 + gain * mean + 1/12, the part of
// the variance that tells of the signal left out. Along u and v the mean of both.
//
// Known to the estimator it is for: everything but u and v (`nuisance` false: the stricter), or
// nothing: amplitude, spread and the plane are estimated too.
double CentreBoundPx(const RenderScene& scene, const RenderSpot& spot, bool nuisance);

}  // namespace tbm::test
