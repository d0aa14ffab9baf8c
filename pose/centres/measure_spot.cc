#include "pose/centres/measure_spot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "pose/centres/gaussian_table.h"
#include "pose/centres/solve3.h"
#include "pose/centres/vectors.h"

namespace tbm {
namespace {

using namespace vectors;
constexpr int kLanes = SpotPatch::kLanes;

constexpr double kWindowSigmas = 4.0;  // half width of what is fitted
constexpr double kFrameSigmas = 5.5;   // half width of what the background is taken from
constexpr double kQuickWindowSigmas = 3.0;
constexpr int kQuickFramePx = 3;       // around the window
constexpr double kBorderSigmas = 2.0;  // a centre closer to the image's border is not measured
// From a fair guess three are enough: the error shrinks tenfold in each. Clipping and poor guesses
// need more.
constexpr int kMaxIterations = 15;
constexpr int kQuickIterations = 8;
constexpr double kNarrowest = 0.75;  // of the least spread: narrower along one axis is no spot
// A window of at least so many rows is wide enough that every second row tells a smooth sum.
constexpr int kFewRows = 15;
// Around a window of at least so many rows fewer than all rows have pixels enough for the
// background.
constexpr int kManyRows = 21;

// A single pixel this many sigmas above the model is a hot one, if its neighbours do not share it.
constexpr float kHotSigmas = 6.0f;

double Total(const Floats& of) { return static_cast<double>(Sum(of)); }
Floats SpreadOf(double value) { return Spread(static_cast<float>(value)); }

// Within 3e-4: weights need no more. Multiplications only, so the same on every machine.
Floats Reciprocal(const Floats& a) {
  const Floats two = Spread(2.0f);
  Floats inverse = RoughReciprocal(a);
  inverse = inverse * MulSub(two, a, inverse);
  return inverse * MulSub(two, a, inverse);
}

// A growing positive function with value and derivative 1 at 0: how a relative step is taken.
double Growth(double step) { return (1.0 + 0.5 * step) / (1.0 - 0.5 * step); }

double Distance(double du, double dv) { return std::sqrt(du * du + dv * dv); }

// Towards zero below -0.5, which no place in an image is.
int Rounded(double px) { return static_cast<int>(px + 0.5); }

int HalfWidth(double sigmas, double spread_px) {
  return static_cast<int>(std::ceil(sigmas * spread_px)) + 1;
}

// A window in which nearly everything is clipped leaves sums without a term: what they were divided
// by is zero, and the sigma of such a centre is no number.
bool IsSound(const SpotFit& fit) {
  const double numbers = fit.moment_uu_px2 + fit.moment_uv_px2 + fit.moment_vv_px2 +
                         fit.by_dark_u_px2 + fit.by_dark_v_px2 + fit.by_gain_u_px2 +
                         fit.by_gain_v_px2 + fit.gain_seen + fit.gain_seen_sigma;
  return std::isfinite(numbers) && fit.amplitude_dn > 0.0 &&
         std::min(fit.by_gain_u_px2, fit.by_gain_v_px2) > 0.0 &&
         std::min(fit.by_dark_u_px2, fit.by_dark_v_px2) >= 0.0;
}

}  // namespace

double SpotFit::Elongation() const {
  const double mean = 0.5 * (moment_uu_px2 + moment_vv_px2);
  const double half_span = Distance(0.5 * (moment_uu_px2 - moment_vv_px2), moment_uv_px2);
  return std::sqrt((mean + half_span) / std::max(mean - half_span, 1e-6));
}

double SpotFit::SpreadPx() const {
  return std::sqrt(std::max(0.5 * (moment_uu_px2 + moment_vv_px2), 0.0));
}

SpotMeter::SpotMeter(double min_spread_px, double max_spread_px)
    : min_spread_px_(min_spread_px),
      max_spread_px_(max_spread_px),
      patch_(2 * HalfWidth(kFrameSigmas, 1.5 * max_spread_px) + 7) {
  const std::size_t room = RoundUpToLanes(2 * HalfWidth(kFrameSigmas, 1.5 * max_spread_px) + 3);
  columns_.resize(3 * room);
  rows_.resize(3 * room);
  weight_.resize(room * room);
  row_sums_.resize(room * kRowSums * kLanes);
}

SpotVerdict SpotMeter::Measure(const ImageView& image,
                               const SpotGuess& guess,
                               const SensorNoise& noise,
                               std::span<const SpotFit* const> others,
                               Care care,
                               SpotFit* fit) {
  SpotGuess start = guess;
  start.spread_px = std::clamp(start.spread_px, 0.8 * min_spread_px_, 1.5 * max_spread_px_);
  SpotVerdict verdict = SpotVerdict::kNotASpot;
  // The window follows the spread; a poor guess of it costs a second look.
  for (int look = 0; look < 3; ++look) {
    verdict = MeasureOnce(image, start, noise, others, care, fit);
    if (verdict != SpotVerdict::kMeasured) return verdict;
    const double widest = std::max(fit->sigma_u_px, fit->sigma_v_px);
    const double moved = Distance(fit->u_px - start.u_px, fit->v_px - start.v_px);
    if (widest < 1.15 * start.spread_px && widest > 0.8 * start.spread_px && moved < 0.7 * widest) {
      break;
    }
    start = {fit->u_px, fit->v_px, widest, fit->amplitude_dn, fit->background_dn};
    start.spread_px = std::clamp(start.spread_px, 0.8 * min_spread_px_, 1.5 * max_spread_px_);
  }
  return verdict;
}

SpotVerdict SpotMeter::MeasureOnce(const ImageView& image,
                                   const SpotGuess& guess,
                                   const SensorNoise& noise,
                                   std::span<const SpotFit* const> others,
                                   Care care,
                                   SpotFit* fit) {
  const bool is_quick = care == Care::kQuick;
  const int half = HalfWidth(is_quick ? kQuickWindowSigmas : kWindowSigmas, guess.spread_px);
  const int frame_half =
      is_quick ? half + kQuickFramePx
               : std::max(HalfWidth(kFrameSigmas, guess.spread_px), half + kQuickFramePx);
  fit->clipped_pixels =
      patch_.Copy(image, Rounded(guess.u_px), Rounded(guess.v_px), half, frame_half);
  for (const SpotFit* other : others) patch_.RemoveLight(*other);
  const double noise_dn = std::sqrt(noise.dark_variance_dn2);
  const int height = patch_.inner().height();
  const int every = 1 + (height >= kManyRows) + (is_quick && height >= kFewRows);
  if (!patch_.FitBackground(noise_dn, guess.u_px, guess.v_px, every)) {
    return SpotVerdict::kNotASpot;
  }
  patch_.SubtractBackground();
  const BackgroundPlane& plane = patch_.background();
  fit->u_px = guess.u_px;
  fit->v_px = guess.v_px;
  fit->amplitude_dn = guess.amplitude_dn;
  fit->sigma_u_px = fit->sigma_v_px = guess.spread_px;
  fit->background_variance_dn2 = plane.variance_dn2;
  fit->background_structure_dn = plane.structure_dn;
  const double gain = noise.gain_dn_per_electron;
  if (!Improve(gain, care, fit)) {
    return SpotVerdict::kNotASpot;
  }
  SpotVerdict verdict = Judge(image, guess, *fit);
  if (verdict == SpotVerdict::kNotASpot) return verdict;
  if (ConcludeShape(fit) && MaskSingleBrightPixels(*fit, gain)) {
    if (!Improve(gain, care, fit)) return SpotVerdict::kNotASpot;
    verdict = Judge(image, guess, *fit);
    (void)ConcludeShape(fit);
  }
  if (verdict != SpotVerdict::kMeasured) return verdict;
  ConcludeVariance(fit);
  fit->background_dn = plane.level_dn + plane.by_u * (fit->u_px - guess.u_px) +
                       plane.by_v * (fit->v_px - guess.v_px);
  return IsSound(*fit) ? SpotVerdict::kMeasured : SpotVerdict::kNotASpot;
}

SpotVerdict SpotMeter::Judge(const ImageView& image,
                             const SpotGuess& guess,
                             const SpotFit& fit) const {
  const double widest = std::max(fit.sigma_u_px, fit.sigma_v_px);
  const double narrowest = std::min(fit.sigma_u_px, fit.sigma_v_px);
  if (Distance(fit.u_px - guess.u_px, fit.v_px - guess.v_px) > 2.0 * guess.spread_px + 1.0) {
    return SpotVerdict::kNotASpot;
  }
  if (narrowest < kNarrowest * min_spread_px_) return SpotVerdict::kNarrow;
  if (widest > 2.0 * max_spread_px_) return SpotVerdict::kWide;
  const double border = std::min({fit.u_px + 0.5,
                                  fit.v_px + 0.5,
                                  image.width_px - 0.5 - fit.u_px,
                                  image.height_px - 0.5 - fit.v_px});
  return border < kBorderSigmas * widest ? SpotVerdict::kCutByBorder : SpotVerdict::kMeasured;
}

void SpotMeter::FillTables(const SpotFit& fit) {
  const PixelBox& inner = patch_.inner();
  FillGaussian(static_cast<float>(inner.left - fit.u_px),
               inner.width(),
               static_cast<float>(fit.sigma_u_px),
               columns_.data());
  FillGaussian(static_cast<float>(inner.top - fit.v_px),
               inner.height(),
               static_cast<float>(fit.sigma_v_px),
               rows_.data());
}

// With g the unit Gaussian, q = datum - A g, w = g / variance, X = (x / sigma_u)^2: first
// derivatives of the log likelihood by u, v, ln A, ln sigma_u, ln sigma_v, and the information
// between the last three. By symmetry u and v have none with them.
struct SpotMeter::Scores {
  double u = 0.0, v = 0.0, a = 0.0, su = 0.0, sv = 0.0;
  double aa = 0.0, asu = 0.0, asv = 0.0, susu = 0.0, susv = 0.0, svsv = 0.0;
};

template <SpotMeter::Weighing kWeighing>
SpotMeter::Scores SpotMeter::Score(const SpotFit& fit, double gain, int every) {
  const PixelBox& inner = patch_.inner();
  const Floats dark = SpreadOf(fit.background_variance_dn2);
  const auto photon = static_cast<float>(gain * fit.amplitude_dn);
  const auto amplitude = static_cast<float>(fit.amplitude_dn);
  const Floats lowest_masked = Spread(0.5f * SpotPatch::kMasked);
  const Floats zero = Spread(0.0f);
  const std::size_t columns = RoundUpToLanes(inner.width());
  const float* const table_end = columns_.data() + 3 * columns;
  for (int row = inner.top; row <= inner.bottom; row += every) {
    const auto j = static_cast<std::size_t>(row - inner.top);
    const float* value = patch_.values(row);
    float* kept_weight = &weight_[j * columns];
    const float gauss_v = At(rows_.data(), j).g;
    const Floats gauss_row = Spread(gauss_v);
    const Floats photon_row = Spread(photon * gauss_v);
    const Floats amplitude_row = Spread(amplitude * gauss_v);
    Floats q0 = zero, q1 = zero, q2 = zero, g0 = zero, g1 = zero, g2 = zero;
    for (const float* table = columns_.data(); table < table_end; table += kTableGroup) {
      const Floats along = Load(table);
      const Floats datum = Load(value);
      value += kLanes;
      Floats inverse;
      if constexpr (kWeighing == Weighing::kKept) {
        inverse = Load(kept_weight);
      } else {
        inverse = Reciprocal(MulAdd(dark, photon_row, along));
        if constexpr (kWeighing == Weighing::kFreshMasked) {
          inverse = Where(IsLess(datum, lowest_masked), inverse);
        }
        Store(kept_weight, inverse);
      }
      kept_weight += kLanes;
      const Floats gauss = along * gauss_row;
      const Floats weight = inverse * gauss;
      const Floats wq = weight * MulSub(datum, amplitude_row, along);
      const Floats wg = weight * gauss;
      const Floats square = Load(table + 2 * kLanes);
      const Floats wgx = wg * square;
      q0 = q0 + wq;
      q1 = MulAdd(q1, wq, Load(table + kLanes));
      q2 = MulAdd(q2, wq, square);
      g0 = g0 + wg;
      g1 = g1 + wgx;
      g2 = MulAdd(g2, wgx, square);
    }
    float* sums = &row_sums_[j * kRowSums * kLanes];
    Store(sums, q0);
    Store(sums + kLanes, q1);
    Store(sums + 2 * kLanes, q2);
    Store(sums + 3 * kLanes, g0);
    Store(sums + 4 * kLanes, g1);
    Store(sums + 5 * kLanes, g2);
  }
  // The rows together: apart from the loop above, so that each fits into the registers.
  Floats su = zero, sv = zero, sa = zero, ssu = zero, ssv = zero;
  Floats iaa = zero, iau = zero, iav = zero, iuu = zero, iuv = zero, ivv = zero;
  for (int row = inner.top; row <= inner.bottom; row += every) {
    const auto j = static_cast<std::size_t>(row - inner.top);
    const float* sums = &row_sums_[j * kRowSums * kLanes];
    const GaussianAt at = At(rows_.data(), j);
    const Floats y = Spread(at.x);
    const Floats yy = Spread(at.square);
    const Floats q0 = Load(sums);
    const Floats g0 = Load(sums + 3 * kLanes);
    const Floats g1 = Load(sums + 4 * kLanes);
    const Floats g0yy = g0 * yy;
    su = su + Load(sums + kLanes);
    sv = MulAdd(sv, q0, y);
    sa = sa + q0;
    ssu = ssu + Load(sums + 2 * kLanes);
    ssv = MulAdd(ssv, q0, yy);
    iaa = iaa + g0;
    iau = iau + g1;
    iav = iav + g0yy;
    iuu = iuu + Load(sums + 5 * kLanes);
    iuv = MulAdd(iuv, g1, yy);
    ivv = MulAdd(ivv, g0yy, yy);
  }
  return {Total(su),
          Total(sv),
          Total(sa),
          Total(ssu),
          Total(ssv),
          Total(iaa),
          Total(iau),
          Total(iav),
          Total(iuu),
          Total(iuv),
          Total(ivv)};
}

bool SpotMeter::Improve(double gain, Care care, SpotFit* fit) {
  // The first step only has to come near: some of the rows tell the way. Later steps are too small
  // to change the weights.
  constexpr double kWeightsHold = 0.05;
  // Each step leaves a tenth of itself.
  const double small_shift = care == Care::kQuick ? 0.01 : 2e-3;
  const double small_shape = care == Care::kQuick ? 0.03 : 0.01;
  const bool coarse_start = patch_.inner().height() >= kFewRows;
  double longest = std::numeric_limits<double>::infinity();  // last step, relative
  const int most = care == Care::kQuick ? kQuickIterations : kMaxIterations;
  for (int i = 0; i < most; ++i) {
    FillTables(*fit);
    const bool coarse = i == 0 && coarse_start;
    const int every = !coarse ? 1 : care == Care::kQuick ? 3 : 2;
    const bool weights_hold = longest < kWeightsHold && !(i == 1 && coarse_start);
    const Scores s = weights_hold          ? Score<Weighing::kKept>(*fit, gain, 1)
                     : patch_.has_masked() ? Score<Weighing::kFreshMasked>(*fit, gain, every)
                                           : Score<Weighing::kFresh>(*fit, gain, every);
    if (!(s.aa > 0.0 && s.asu > 0.0 && s.asv > 0.0)) return false;
    constexpr double kRegular = 1.0 + 1e-6;
    const Symmetric3 information{
        kRegular * s.aa, s.asu, s.asv, kRegular * s.susu, s.susv, kRegular * s.svsv};
    std::array<double, 3> shape = information.Solve(s.a, s.su, s.sv);
    for (double& step : shape) step /= fit->amplitude_dn;
    // A step far beyond a spread is a guess that was no spot; the limits keep it bounded.
    const double du =
        std::clamp(s.u / (fit->amplitude_dn * s.asu), -fit->sigma_u_px, fit->sigma_u_px);
    const double dv =
        std::clamp(s.v / (fit->amplitude_dn * s.asv), -fit->sigma_v_px, fit->sigma_v_px);
    const double shape_step =
        std::max({std::abs(shape[0]), std::abs(shape[1]), std::abs(shape[2])});
    if (!std::isfinite(du + dv + shape[0] + shape[1] + shape[2])) return false;
    fit->u_px += du;
    fit->v_px += dv;
    fit->amplitude_dn *= Growth(std::clamp(shape[0], -0.7, 0.7));
    fit->sigma_u_px *= Growth(std::clamp(shape[1], -0.4, 0.4));
    fit->sigma_v_px *= Growth(std::clamp(shape[2], -0.4, 0.4));
    const double narrowest = std::min(fit->sigma_u_px, fit->sigma_v_px);
    const double widest = std::max(fit->sigma_u_px, fit->sigma_v_px);
    // The caller sees why.
    if (narrowest < 0.2 || widest > 4.0 * max_spread_px_) break;
    if (i >= 2 && narrowest < kNarrowest * min_spread_px_) break;
    const double shift_step = (std::abs(du) + std::abs(dv)) / narrowest;
    if (!coarse && shift_step < small_shift && shape_step < small_shape) break;
    longest = std::max(shift_step, shape_step);
  }
  FillTables(*fit);
  return true;
}

// Any pixel of the row far above the model.
bool SpotMeter::IsHot(int row, float amplitude) const {
  const auto j = static_cast<std::size_t>(row - patch_.inner().top);
  const std::size_t columns = RoundUpToLanes(patch_.inner().width());
  const float* value = patch_.values(row);
  const float* kept_weight = &weight_[j * columns];
  const Floats amplitude_row = Spread(amplitude * At(rows_.data(), j).g);
  const Floats zero = Spread(0.0f);
  Floats hottest = zero;
  const float* table = columns_.data();
  for (std::size_t i = 0; i < columns; i += kLanes, table += kTableGroup) {
    const Floats q = MulSub(Load(value + i), amplitude_row, Load(table));
    hottest = Larger(hottest, Where(IsLess(zero, q), q * q * Load(kept_weight + i)));
  }
  return Any(IsLess(Spread(0.99f * kHotSigmas * kHotSigmas), hottest));
}

bool SpotMeter::MaskSingleBrightPixels(const SpotFit& fit, double gain) {
  const PixelBox& inner = patch_.inner();
  const std::size_t stride = patch_.stride();
  const auto amplitude = static_cast<float>(fit.amplitude_dn);
  const auto photon = kHotSigmas * kHotSigmas * static_cast<float>(gain);
  const auto dark = kHotSigmas * kHotSigmas * static_cast<float>(fit.background_variance_dn2);
  bool masked = false;
  for (int row = inner.top + 1; row < inner.bottom; ++row) {
    if (!IsHot(row, amplitude)) continue;
    const float gauss_row = At(rows_.data(), static_cast<std::size_t>(row - inner.top)).g;
    const float* value = patch_.values(row);
    for (int i = 1; i + 1 < inner.width(); ++i) {
      const float model =
          amplitude * gauss_row * At(columns_.data(), static_cast<std::size_t>(i)).g;
      const float q = value[i] - model;
      if (q <= 0.0f || q * q < dark + photon * model || q < 0.05f * model) continue;
      // A wrong model is wrong in the neighbours too; a hot pixel is alone.
      const float beside =
          value[i - 1] + value[i + 1] + (value + stride)[i] + (value - stride)[i] - 4.0f * model;
      if (beside > 1.2f * q || value[i] > 0.5f * SpotPatch::kMasked) continue;
      patch_.Mask(row, i);
      masked = true;
    }
  }
  return masked;
}

void SpotMeter::ConcludeVariance(SpotFit* fit) const {
  const PixelBox& inner = patch_.inner();
  const Floats zero = Spread(0.0f);
  // Sums of w^2, w^2 g, w, w g with X and Y.
  Floats wwx = zero, wwy = zero, wwgx = zero, wwgy = zero;
  Floats wx = zero, wy = zero, wgx = zero, wgy = zero;
  const std::size_t columns = RoundUpToLanes(inner.width());
  const float* const table_end = columns_.data() + 3 * columns;
  // Smooth sums: of a spot that is not narrow every second row says the same.
  const int every = inner.height() >= kFewRows ? 2 : 1;
  for (int row = 0; row < inner.height(); row += every) {
    const auto j = static_cast<std::size_t>(row);
    const float* kept_weight = &weight_[j * columns];
    const GaussianAt at = At(rows_.data(), j);
    const Floats gauss_row = Spread(at.g);
    Floats row_ww = zero, row_wwg = zero, row_w = zero, row_wg = zero;
    for (const float* table = columns_.data(); table < table_end; table += kTableGroup) {
      const Floats gauss = Load(table) * gauss_row;
      const Floats xx = Load(table + 2 * kLanes);
      const Floats w = gauss * Load(kept_weight);
      kept_weight += kLanes;
      const Floats ww = w * w;
      const Floats wg = w * gauss;
      const Floats wwg = ww * gauss;
      row_ww = row_ww + ww;
      row_wwg = row_wwg + wwg;
      row_w = row_w + w;
      row_wg = row_wg + wg;
      wwx = MulAdd(wwx, ww, xx);
      wwgx = MulAdd(wwgx, wwg, xx);
      wx = MulAdd(wx, w, xx);
      wgx = MulAdd(wgx, wg, xx);
    }
    const Floats yy = Spread(at.square);
    wwy = MulAdd(wwy, row_ww, yy);
    wwgy = MulAdd(wwgy, row_wwg, yy);
    wy = MulAdd(wy, row_w, yy);
    wgy = MulAdd(wgy, row_wg, yy);
  }
  const double a = fit->amplitude_dn;
  const double suu = fit->sigma_u_px * fit->sigma_u_px;
  const double svv = fit->sigma_v_px * fit->sigma_v_px;
  const double sum_wgx = Total(wgx);
  const double sum_wgy = Total(wgy);
  const double slope_u = Total(wx) / (a * sum_wgx) * suu;
  const double slope_v = Total(wy) / (a * sum_wgy) * svv;
  const double du2 = every * a * a * sum_wgx * sum_wgx / suu;
  const double dv2 = every * a * a * sum_wgy * sum_wgy / svv;
  const double dark = fit->background_variance_dn2;
  const double of_slope = patch_.background().slope_variance;
  fit->by_dark_u_px2 = dark * Total(wwx) / du2 + of_slope * slope_u * slope_u;
  fit->by_dark_v_px2 = dark * Total(wwy) / dv2 + of_slope * slope_v * slope_v;
  fit->by_gain_u_px2 = a * Total(wwgx) / du2;
  fit->by_gain_v_px2 = a * Total(wwgy) / dv2;
}

bool SpotMeter::ConcludeShape(SpotFit* fit) const {
  const PixelBox& inner = patch_.inner();
  const Floats dark = SpreadOf(fit->background_variance_dn2);
  const auto amplitude = static_cast<float>(fit->amplitude_dn);
  const Floats zero = Spread(0.0f);
  const Floats hot_limit = Spread(kHotSigmas * kHotSigmas);
  // Sums of datum g with 1, X, Y, xy; of what the residuals say about the gain.
  Floats m0 = zero, muu = zero, mvv = zero, muv = zero, k_seen = zero, k_all = zero;
  Floats hottest = zero;
  const std::size_t columns = RoundUpToLanes(inner.width());
  const float* const table_end = columns_.data() + 3 * columns;
  const Floats amplitude4 = Spread(amplitude);
  for (int row = inner.top; row <= inner.bottom; ++row) {
    const auto j = static_cast<std::size_t>(row - inner.top);
    const float* value = patch_.values(row);
    const float* kept_weight = &weight_[j * columns];
    const GaussianAt at = At(rows_.data(), j);
    const Floats gauss_row = Spread(at.g);
    Floats row_m = zero, row_mu = zero;
    for (const float* table = columns_.data(); table < table_end; table += kTableGroup) {
      const Floats inverse = Load(kept_weight);
      kept_weight += kLanes;
      const Floats gauss = Load(table) * gauss_row;
      const Floats model = gauss * amplitude4;
      const Floats q = Where(IsLess(zero, inverse), Load(value) - model);
      value += kLanes;
      const Floats light = gauss * (q + model);
      row_m = row_m + light;
      row_mu = MulAdd(row_mu, light, Load(table + kLanes));
      muu = MulAdd(muu, light, Load(table + 2 * kLanes));
      const Floats qq = q * q;
      const Floats by_gain = model * inverse * inverse;
      k_seen = MulAdd(k_seen, by_gain, qq - dark);
      k_all = MulAdd(k_all, by_gain, model);
      hottest = Larger(hottest, Where(IsLess(zero, q), qq * inverse));
    }
    m0 = m0 + row_m;
    mvv = MulAdd(mvv, row_m, Spread(at.square));
    muv = MulAdd(muv, row_mu, Spread(at.x));
  }
  // Moments of the spot times the Gaussian; dividing the Gaussian out leaves the spot's own:
  // (seen^-1 - Gaussian^-1)^-1.
  const double suu = fit->sigma_u_px * fit->sigma_u_px;
  const double svv = fit->sigma_v_px * fit->sigma_v_px;
  const double light = 1.0 / Total(m0);
  const double seen_uu = Total(muu) * suu * light;
  const double seen_uv = Total(muv) * light;
  const double seen_vv = Total(mvv) * svv * light;
  const double seen = 1.0 / (seen_uu * seen_vv - seen_uv * seen_uv);
  const double inverse_uu = seen_vv * seen - 1.0 / suu;
  const double inverse_vv = seen_uu * seen - 1.0 / svv;
  const double inverse_uv = -seen_uv * seen;
  const double own = 1.0 / (inverse_uu * inverse_vv - inverse_uv * inverse_uv);
  fit->moment_uu_px2 = inverse_vv * own;
  fit->moment_uv_px2 = -inverse_uv * own;
  fit->moment_vv_px2 = inverse_uu * own;

  // The five fitted numbers have taken their share of the residuals.
  const double effective_pixels = 12.57 * fit->sigma_u_px * fit->sigma_v_px;
  const double share = effective_pixels / std::max(effective_pixels - 5.0, 0.2 * effective_pixels);
  const double information = std::max(Total(k_all), 1e-12);
  fit->gain_seen = share * Total(k_seen) / information;
  fit->gain_seen_sigma = std::sqrt(2.0 / information);
  return Any(IsLess(hot_limit, hottest));
}

}  // namespace tbm
