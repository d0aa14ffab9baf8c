#pragma once

#include <span>
#include <vector>

#include "pose/centres/image_view.h"
#include "pose/centres/split_blobs.h"
#include "pose/centres/spot_patch.h"

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
  // See BackgroundPlane.
  double background_structure_dn = 0.0;
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

  // Among a crowd a spot is measured kQuick: in a smaller window, and a
  // step earlier at the end.
  enum class Care { kFull, kQuick };

  // `others` are spots already measured whose light is taken away first.
  SpotVerdict Measure(const ImageView& image,
                      const SpotGuess& guess,
                      const SensorNoise& noise,
                      std::span<const SpotFit* const> others,
                      Care care,
                      SpotFit* fit);

 private:
  struct Scores;

  SpotVerdict MeasureOnce(const ImageView& image,
                          const SpotGuess& guess,
                          const SensorNoise& noise,
                          std::span<const SpotFit* const> others,
                          Care care,
                          SpotFit* fit);
  void FillTables(const SpotFit& fit);
  // Weights are one over the variance of the model at `fit`, kept for later, or those kept. Looks
  // at every row or at every second.
  enum class Weighing { kFresh, kFreshMasked, kKept };
  template <Weighing kWeighing>
  Scores Score(const SpotFit& fit, double gain, int every);
  bool Improve(double gain, Care care, SpotFit* fit);
  bool IsHot(int row, float amplitude) const;
  bool MaskSingleBrightPixels(const SpotFit& fit, double gain);
  SpotVerdict Judge(const ImageView& image, const SpotGuess& guess, const SpotFit& fit) const;
  void ConcludeVariance(SpotFit* fit) const;
  // Shape and gain; returns whether a pixel far above the model was met.
  bool ConcludeShape(SpotFit* fit) const;

  double min_spread_px_;
  double max_spread_px_;
  SpotPatch patch_;
  // Per column and per row of the patch's inner window, see FillGaussian.
  std::vector<float> columns_;
  std::vector<float> rows_;
  // One over the variance of each pixel of the inner window; zero where a pixel is masked.
  std::vector<float> weight_;
  // Sums over the columns of each row of the window.
  static constexpr std::size_t kRowSums = 6;
  std::vector<float> row_sums_;
};

}  // namespace tbm
