#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pose/centres/image_view.h"
#include "pose/centres/split_blobs.h"

namespace tbm {

// What is assumed of the sensor while a spot is measured.
struct SensorNoise {
  double gain_dn_per_electron = 0.0;  // variance = dark variance + gain * (signal above background)
  double dark_variance_dn2 = 0.0;     // of a dark pixel somewhere in the image, rounding included
};

// A Gaussian on a plane, fitted to the pixels around a guess, and the sums from which its sigma
// follows once the sensor's gain is known.
struct SpotFit {
  double u_px = 0.0;
  double v_px = 0.0;
  double amplitude_dn = 0.0;
  double sigma_u_px = 0.0;  // of the Gaussian along the image's axes
  double sigma_v_px = 0.0;
  double background_dn = 0.0;  // at the centre
  double background_variance_dn2 = 0.0;
  double moment_uu_px2 = 0.0;  // of the spot itself, any direction of its long axis
  double moment_uv_px2 = 0.0;
  double moment_vv_px2 = 0.0;
  int clipped_pixels = 0;

  // variance of u = by_dark_u + gain * by_gain_u, v alike.
  double by_dark_u_px2 = 0.0;
  double by_gain_u_px2 = 0.0;
  double by_dark_v_px2 = 0.0;
  double by_gain_v_px2 = 0.0;

  // The gain that the residuals of this spot ask for, and one sigma of it. Wrong shape counts in.
  double gain_seen = 0.0;
  double gain_seen_sigma = 0.0;

  double Elongation() const;
  double SpreadPx() const;
};

enum class SpotVerdict { kMeasured, kNarrow, kWide, kCutByBorder, kNotASpot };

// Fits one spot after the other in its own work space.
//
// Background: a plane through the frame of pixels around the spot, by medians of its eight sides
// and corners, then least squares without what is off by three sigma. Centre: Fisher scoring of the
// Gaussian's likelihood, each pixel weighted by the derivative of the model by its variance
// (dark noise + photon noise of the model, not of the datum, which would bias). Clipped pixels and
// single bright pixels are masked. Derivation: pose/docs/centres.md.
class SpotMeter {
 public:
  explicit SpotMeter(double min_spread_px, double max_spread_px);

  // `others` are spots already measured whose light is taken away first.
  SpotVerdict Measure(const ImageView& image,
                      const SpotGuess& guess,
                      const SensorNoise& noise,
                      std::span<const SpotFit* const> others,
                      SpotFit* fit);

 private:
  struct Box {
    int left, right, top, bottom;  // ends included
    int width() const { return right - left + 1; }
    int height() const { return bottom - top + 1; }
  };
  struct Plane {
    double level = 0.0;  // at the origin of the fit
    double by_u = 0.0;
    double by_v = 0.0;
    double variance = 0.0;        // of a pixel around it
    double slope_variance = 0.0;  // of by_u and by_v, the larger
  };
  struct Scores;
  struct Totals;

  SpotVerdict MeasureOnce(const ImageView& image,
                          const SpotGuess& guess,
                          const SensorNoise& noise,
                          std::span<const SpotFit* const> others,
                          SpotFit* fit);
  template <class Pixel>
  int CopyPatch(const ImageView& image);
  void RemoveLight(const SpotFit& other);
  bool FitPlane(const SensorNoise& noise, double u, double v);
  bool PlaneThroughMedians(double noise_dn, double u, double v);
  bool RefinePlane(double limit_dn, double u, double v);
  void SubtractPlane(double u, double v);
  void FillTables(const SpotFit& fit);
  Scores Score(const SpotFit& fit, double gain) const;
  bool Improve(double gain, SpotFit* fit);
  void MaskNearClipping(const SpotFit& fit, double gain, double full_dn);
  bool MaskSingleBrightPixels(const SpotFit& fit, double gain);
  void Conclude(double gain, SpotFit* fit);

  float* Row(std::vector<float>& of, int row) {
    return of.data() + static_cast<std::size_t>(row - outer_.top) * stride_;
  }
  const float* Row(const std::vector<float>& of, int row) const {
    return of.data() + static_cast<std::size_t>(row - outer_.top) * stride_;
  }

  double min_spread_px_;
  double max_spread_px_;
  Box outer_{};  // copied
  Box inner_{};  // fitted; the rest of `outer_` is background
  std::size_t stride_ = 0;
  Plane plane_;
  std::vector<float> value_;  // DN; plane subtracted inside `inner_` after FitPlane
  std::vector<float> use_;    // 1, or 0 where masked
  std::vector<float> gauss_u_, offset_u_, square_u_;  // per column of `inner_`
  std::vector<float> gauss_v_, offset_v_, square_v_;
};

}  // namespace tbm
