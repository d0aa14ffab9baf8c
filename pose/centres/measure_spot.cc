#include "pose/centres/measure_spot.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

namespace tbm {
namespace {

using Floats [[gnu::vector_size(16)]] = float;
constexpr int kLanes = SpotPatch::kLanes;

constexpr double kWindowSigmas = 4.0;  // half width of what is fitted
constexpr double kFrameSigmas = 5.5;   // half width of what the background is taken from
constexpr double kBorderSigmas = 2.0;  // a centre closer to the image's border is not measured
// From a fair guess three are enough: the error shrinks tenfold in each. Clipping and poor guesses
// need more.
constexpr int kMaxIterations = 15;

Floats Load(const float* at) {
  Floats v;
  std::memcpy(&v, at, sizeof v);
  return v;
}
double Sum(Floats v) { return static_cast<double>((v[0] + v[1]) + (v[2] + v[3])); }
Floats Spread(double value) {
  const auto f = static_cast<float>(value);
  return Floats{f, f, f, f};
}
std::size_t RoundUp(int count) {
  return static_cast<std::size_t>((count + kLanes - 1) / kLanes * kLanes);
}

int HalfWidth(double sigmas, double spread_px) {
  return static_cast<int>(std::ceil(sigmas * spread_px)) + 1;
}

}  // namespace

double SpotFit::Elongation() const {
  const double mean = 0.5 * (moment_uu_px2 + moment_vv_px2);
  const double half_span = std::hypot(0.5 * (moment_uu_px2 - moment_vv_px2), moment_uv_px2);
  return std::sqrt((mean + half_span) / std::max(mean - half_span, 1e-6));
}

double SpotFit::SpreadPx() const {
  return std::sqrt(std::max(0.5 * (moment_uu_px2 + moment_vv_px2), 0.0));
}

SpotMeter::SpotMeter(double min_spread_px, double max_spread_px)
    : min_spread_px_(min_spread_px),
      max_spread_px_(max_spread_px),
      patch_(2 * HalfWidth(kFrameSigmas, 1.5 * max_spread_px) + 7) {
  const std::size_t room = RoundUp(2 * HalfWidth(kFrameSigmas, 1.5 * max_spread_px) + 3);
  for (auto* table : {&gauss_u_, &offset_u_, &square_u_, &gauss_v_, &offset_v_, &square_v_}) {
    table->resize(room);
  }
}

SpotVerdict SpotMeter::Measure(const ImageView& image,
                               const SpotGuess& guess,
                               const SensorNoise& noise,
                               std::span<const SpotFit* const> others,
                               SpotFit* fit) {
  SpotGuess start = guess;
  start.spread_px = std::clamp(start.spread_px, 0.8 * min_spread_px_, 1.5 * max_spread_px_);
  SpotVerdict verdict = SpotVerdict::kNotASpot;
  // The window follows the spread; a poor guess of it costs a second look.
  for (int look = 0; look < 3; ++look) {
    verdict = MeasureOnce(image, start, noise, others, fit);
    if (verdict != SpotVerdict::kMeasured) return verdict;
    const double widest = std::max(fit->sigma_u_px, fit->sigma_v_px);
    const double moved = std::hypot(fit->u_px - start.u_px, fit->v_px - start.v_px);
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
                                   SpotFit* fit) {
  const int half = HalfWidth(kWindowSigmas, guess.spread_px);
  fit->clipped_pixels = patch_.Copy(image,
                                    static_cast<int>(std::lround(guess.u_px)),
                                    static_cast<int>(std::lround(guess.v_px)),
                                    half,
                                    std::max(HalfWidth(kFrameSigmas, guess.spread_px), half + 3));
  for (const SpotFit* other : others) patch_.RemoveLight(*other);
  if (!patch_.FitBackground(std::sqrt(noise.dark_variance_dn2), guess.u_px, guess.v_px)) {
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
  if (fit->clipped_pixels > 0) {
    if (!Improve(gain, fit)) return SpotVerdict::kNotASpot;
    MaskNearClipping(*fit, gain, image.max_value);
  }
  if (!Improve(gain, fit)) {
    return SpotVerdict::kNotASpot;
  }
  if (MaskSingleBrightPixels(*fit, gain) && !Improve(gain, fit)) {
    return SpotVerdict::kNotASpot;
  }
  const SpotVerdict verdict = Judge(image, guess, *fit);
  if (verdict != SpotVerdict::kMeasured) return verdict;
  Conclude(gain, fit);
  fit->background_dn = plane.level_dn + plane.by_u * (fit->u_px - guess.u_px) +
                       plane.by_v * (fit->v_px - guess.v_px);
  return SpotVerdict::kMeasured;
}

SpotVerdict SpotMeter::Judge(const ImageView& image,
                             const SpotGuess& guess,
                             const SpotFit& fit) const {
  const double widest = std::max(fit.sigma_u_px, fit.sigma_v_px);
  const double narrowest = std::min(fit.sigma_u_px, fit.sigma_v_px);
  if (std::hypot(fit.u_px - guess.u_px, fit.v_px - guess.v_px) > 2.0 * guess.spread_px + 1.0) {
    return SpotVerdict::kNotASpot;
  }
  if (narrowest < 0.5 * min_spread_px_) return SpotVerdict::kNarrow;
  if (widest > 2.0 * max_spread_px_) return SpotVerdict::kWide;
  const double border = std::min({fit.u_px + 0.5,
                                  fit.v_px + 0.5,
                                  image.width_px - 0.5 - fit.u_px,
                                  image.height_px - 0.5 - fit.v_px});
  return border < kBorderSigmas * widest ? SpotVerdict::kCutByBorder : SpotVerdict::kMeasured;
}

void SpotMeter::FillTables(const SpotFit& fit) {
  const PixelBox& inner = patch_.inner();
  const auto fill = [](int first,
                       int count,
                       double centre,
                       double sigma,
                       std::vector<float>& gauss,
                       std::vector<float>& offset,
                       std::vector<float>& square) {
    for (std::size_t i = 0; i < RoundUp(count); ++i) {
      const double x = first + static_cast<double>(i) - centre;
      const double in_sigmas = x / sigma;
      const bool inside = i < static_cast<std::size_t>(count);
      gauss[i] = inside ? static_cast<float>(std::exp(-0.5 * in_sigmas * in_sigmas)) : 0.0f;
      offset[i] = static_cast<float>(x);
      square[i] = static_cast<float>(in_sigmas * in_sigmas);
    }
  };
  fill(inner.left, inner.width(), fit.u_px, fit.sigma_u_px, gauss_u_, offset_u_, square_u_);
  fill(inner.top, inner.height(), fit.v_px, fit.sigma_v_px, gauss_v_, offset_v_, square_v_);
}

// With g the unit Gaussian, q = datum - A g, w = g / variance, X = (x / sigma_u)^2: first
// derivatives of the log likelihood by u, v, ln A, ln sigma_u, ln sigma_v, and the information
// between the last three. By symmetry u and v have none with them.
struct SpotMeter::Scores {
  double u = 0.0, v = 0.0, a = 0.0, su = 0.0, sv = 0.0;
  double aa = 0.0, asu = 0.0, asv = 0.0, susu = 0.0, susv = 0.0, svsv = 0.0;
};

SpotMeter::Scores SpotMeter::Score(const SpotFit& fit, double gain) const {
  const PixelBox& inner = patch_.inner();
  const Floats dark = Spread(fit.background_variance_dn2);
  const Floats photon = Spread(gain * fit.amplitude_dn);
  const Floats amplitude = Spread(fit.amplitude_dn);
  Floats su{}, sv{}, sa{}, ssu{}, ssv{};
  Floats iaa{}, iau{}, iav{}, iuu{}, iuv{}, ivv{};
  const std::size_t columns = RoundUp(inner.width());
  for (int row = inner.top; row <= inner.bottom; ++row) {
    const auto j = static_cast<std::size_t>(row - inner.top);
    const float* value = patch_.values(row);
    const float* use = patch_.use(row);
    const Floats gauss_row = Spread(static_cast<double>(gauss_v_[j]));
    Floats q0{}, q1{}, q2{}, g0{}, g1{}, g2{};
    for (std::size_t i = 0; i < columns; i += kLanes) {
      const Floats gauss = Load(&gauss_u_[i]) * gauss_row;
      const Floats square = Load(&square_u_[i]);
      const Floats weight = Load(use + i) * gauss / (dark + photon * gauss);
      const Floats wq = weight * (Load(value + i) - amplitude * gauss);
      const Floats wg = weight * gauss;
      const Floats wgx = wg * square;
      q0 += wq;
      q1 += wq * Load(&offset_u_[i]);
      q2 += wq * square;
      g0 += wg;
      g1 += wgx;
      g2 += wgx * square;
    }
    const Floats y = Spread(static_cast<double>(offset_v_[j]));
    const Floats yy = Spread(static_cast<double>(square_v_[j]));
    sa += q0;
    su += q1;
    sv += q0 * y;
    ssu += q2;
    ssv += q0 * yy;
    iaa += g0;
    iau += g1;
    iav += g0 * yy;
    iuu += g2;
    iuv += g1 * yy;
    ivv += g0 * yy * yy;
  }
  return {Sum(su),
          Sum(sv),
          Sum(sa),
          Sum(ssu),
          Sum(ssv),
          Sum(iaa),
          Sum(iau),
          Sum(iav),
          Sum(iuu),
          Sum(iuv),
          Sum(ivv)};
}

bool SpotMeter::Improve(double gain, SpotFit* fit) {
  for (int i = 0; i < kMaxIterations; ++i) {
    FillTables(*fit);
    const Scores s = Score(*fit, gain);
    if (!(s.aa > 0.0 && s.asu > 0.0 && s.asv > 0.0)) return false;
    Eigen::Matrix3d information;
    information << s.aa, s.asu, s.asv, s.asu, s.susu, s.susv, s.asv, s.susv, s.svsv;
    information.diagonal() *= 1.0 + 1e-6;
    const Eigen::Vector3d shape =
        information.ldlt().solve(Eigen::Vector3d(s.a, s.su, s.sv)) / fit->amplitude_dn;
    // A step far beyond a spread is a guess that was no spot; the limits keep it bounded.
    const double du =
        std::clamp(s.u / (fit->amplitude_dn * s.asu), -fit->sigma_u_px, fit->sigma_u_px);
    const double dv =
        std::clamp(s.v / (fit->amplitude_dn * s.asv), -fit->sigma_v_px, fit->sigma_v_px);
    if (!(shape.allFinite() && std::isfinite(du) && std::isfinite(dv))) return false;
    fit->u_px += du;
    fit->v_px += dv;
    fit->amplitude_dn *= std::exp(std::clamp(shape[0], -0.7, 0.7));
    fit->sigma_u_px *= std::exp(std::clamp(shape[1], -0.4, 0.4));
    fit->sigma_v_px *= std::exp(std::clamp(shape[2], -0.4, 0.4));
    const double narrowest = std::min(fit->sigma_u_px, fit->sigma_v_px);
    const double widest = std::max(fit->sigma_u_px, fit->sigma_v_px);
    if (narrowest < 0.2 || widest > 4.0 * max_spread_px_) break;  // the caller sees why
    if (std::abs(du) + std::abs(dv) < 5e-4 * narrowest && shape.cwiseAbs().maxCoeff() < 0.005)
      break;
  }
  FillTables(*fit);
  return true;
}

// A pixel that could as well have been clipped passes only when noise pulled it down: leaving it in
// would bias. So the model decides who is left out, not the datum.
void SpotMeter::MaskNearClipping(const SpotFit& fit, double gain, double full_dn) {
  const PixelBox& inner = patch_.inner();
  const double ceiling_dn = full_dn - patch_.background().level_dn;
  const double noise_dn = std::sqrt(fit.background_variance_dn2 + gain * ceiling_dn);
  const auto limit = static_cast<float>(ceiling_dn - 2.0 * noise_dn);
  const auto amplitude = static_cast<float>(fit.amplitude_dn);
  for (int row = inner.top; row <= inner.bottom; ++row) {
    const float height = amplitude * gauss_v_[static_cast<std::size_t>(row - inner.top)];
    for (int i = 0; i < inner.width(); ++i) {
      if (height * gauss_u_[static_cast<std::size_t>(i)] > limit) patch_.Mask(row, i);
    }
  }
}

bool SpotMeter::MaskSingleBrightPixels(const SpotFit& fit, double gain) {
  const PixelBox& inner = patch_.inner();
  const std::size_t stride = patch_.stride();
  const auto amplitude = static_cast<float>(fit.amplitude_dn);
  const auto photon = static_cast<float>(36.0 * gain);
  const auto dark = static_cast<float>(36.0 * fit.background_variance_dn2);
  bool masked = false;
  for (int row = inner.top + 1; row < inner.bottom; ++row) {
    const float gauss_row = gauss_v_[static_cast<std::size_t>(row - inner.top)];
    const float* use = patch_.use(row);
    const float* value = patch_.values(row);
    for (int i = 1; i + 1 < inner.width(); ++i) {
      const float model = amplitude * gauss_row * gauss_u_[static_cast<std::size_t>(i)];
      const float q = value[i] - model;
      if (q <= 0.0f || q * q < dark + photon * model || q < 0.05f * model) continue;
      // A wrong model is wrong in the neighbours too; a hot pixel is alone.
      const float beside =
          value[i - 1] + value[i + 1] + (value + stride)[i] + (value - stride)[i] - 4.0f * model;
      if (beside > 1.2f * q || use[i] == 0.0f) continue;
      patch_.Mask(row, i);
      masked = true;
    }
  }
  return masked;
}

void SpotMeter::Conclude(double gain, SpotFit* fit) const {
  const PixelBox& inner = patch_.inner();
  const BackgroundPlane& plane = patch_.background();
  const double dark = fit->background_variance_dn2;
  const Floats dark4 = Spread(dark);
  const Floats photon = Spread(gain * fit->amplitude_dn);
  const Floats amplitude = Spread(fit->amplitude_dn);
  // Sums of w^2, w^2 g, w, w g with X and Y; of datum g with 1, X, Y, xy; of what the residuals say
  // about the gain.
  Floats wwx{}, wwy{}, wwgx{}, wwgy{}, wx{}, wy{}, wgx{}, wgy{};
  Floats m0{}, muu{}, mvv{}, muv{}, k_seen{}, k_all{};
  const std::size_t columns = RoundUp(inner.width());
  for (int row = inner.top; row <= inner.bottom; ++row) {
    const auto j = static_cast<std::size_t>(row - inner.top);
    const float* value = patch_.values(row);
    const float* use = patch_.use(row);
    const Floats gauss_row = Spread(static_cast<double>(gauss_v_[j]));
    const Floats y = Spread(static_cast<double>(offset_v_[j]));
    const Floats yy = Spread(static_cast<double>(square_v_[j]));
    for (std::size_t i = 0; i < columns; i += kLanes) {
      const Floats gauss = Load(&gauss_u_[i]) * gauss_row;
      const Floats xx = Load(&square_u_[i]);
      const Floats used = Load(use + i);
      const Floats model = amplitude * gauss;
      const Floats inverse = used / (dark4 + photon * gauss);
      const Floats q = Load(value + i) - model;
      const Floats w = gauss * inverse;
      const Floats ww = w * w;
      const Floats wg = w * gauss;
      const Floats wwg = ww * gauss;
      wwx += ww * xx;
      wwy += ww * yy;
      wwgx += wwg * xx;
      wwgy += wwg * yy;
      wx += w * xx;
      wy += w * yy;
      wgx += wg * xx;
      wgy += wg * yy;
      const Floats light = gauss * (used * q + model);
      m0 += light;
      muu += light * xx;
      mvv += light * yy;
      muv += light * Load(&offset_u_[i]) * y;
      const Floats by_gain = model * inverse * inverse;
      k_seen += by_gain * (q * q - dark4);
      k_all += by_gain * model;
    }
  }
  const double a = fit->amplitude_dn;
  const double suu = fit->sigma_u_px * fit->sigma_u_px;
  const double svv = fit->sigma_v_px * fit->sigma_v_px;
  const double slope_u = Sum(wx) / (a * Sum(wgx)) * suu;
  const double slope_v = Sum(wy) / (a * Sum(wgy)) * svv;
  const double du = a * Sum(wgx) / fit->sigma_u_px;
  const double dv = a * Sum(wgy) / fit->sigma_v_px;
  fit->by_dark_u_px2 = dark * Sum(wwx) / (du * du) + plane.slope_variance * slope_u * slope_u;
  fit->by_dark_v_px2 = dark * Sum(wwy) / (dv * dv) + plane.slope_variance * slope_v * slope_v;
  fit->by_gain_u_px2 = a * Sum(wwgx) / (du * du);
  fit->by_gain_v_px2 = a * Sum(wwgy) / (dv * dv);

  // Moments of the spot times the Gaussian; dividing the Gaussian out leaves the spot's own.
  Eigen::Matrix2d seen;
  seen << Sum(muu) * suu, Sum(muv), Sum(muv), Sum(mvv) * svv;
  seen /= Sum(m0);
  Eigen::Matrix2d inverse = seen.inverse();
  inverse.diagonal() -= Eigen::Vector2d(1.0 / suu, 1.0 / svv);
  const Eigen::Matrix2d own = inverse.inverse();
  fit->moment_uu_px2 = own(0, 0);
  fit->moment_uv_px2 = own(0, 1);
  fit->moment_vv_px2 = own(1, 1);

  // The five fitted numbers have taken their share of the residuals.
  const double effective_pixels = 12.57 * fit->sigma_u_px * fit->sigma_v_px;
  const double share = effective_pixels / std::max(effective_pixels - 5.0, 0.2 * effective_pixels);
  const double information = std::max(Sum(k_all), 1e-12);
  fit->gain_seen = share * Sum(k_seen) / information;
  fit->gain_seen_sigma = std::sqrt(2.0 / information);
}

}  // namespace tbm
