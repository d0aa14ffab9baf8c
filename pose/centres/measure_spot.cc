#include "pose/centres/measure_spot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "pose/centres/any_above.h"

namespace tbm {
namespace {

using Floats [[gnu::vector_size(16)]] = float;
constexpr int kLanes = 4;

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
    : min_spread_px_(min_spread_px), max_spread_px_(max_spread_px) {
  const int width = 2 * HalfWidth(kFrameSigmas, 1.5 * max_spread_px) + 3;
  const std::size_t room = RoundUp(width) + kLanes;
  value_.resize(room * room);
  use_.resize(room * room);
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
  const int u = static_cast<int>(std::lround(guess.u_px));
  const int v = static_cast<int>(std::lround(guess.v_px));
  const auto box = [&](int half) {
    return Box{std::max(u - half, 0),
               std::min(u + half, image.width_px - 1),
               std::max(v - half, 0),
               std::min(v + half, image.height_px - 1)};
  };
  const int half = HalfWidth(kWindowSigmas, guess.spread_px);
  inner_ = box(half);
  outer_ = box(std::max(HalfWidth(kFrameSigmas, guess.spread_px), half + 3));
  stride_ = RoundUp(outer_.width()) + kLanes;
  fit->clipped_pixels =
      image.bytes_per_pixel == 1 ? CopyPatch<std::uint8_t>(image) : CopyPatch<std::uint16_t>(image);
  for (const SpotFit* other : others) RemoveLight(*other);
  if (!FitPlane(noise, guess.u_px, guess.v_px)) return SpotVerdict::kNotASpot;
  SubtractPlane(guess.u_px, guess.v_px);

  fit->u_px = guess.u_px;
  fit->v_px = guess.v_px;
  fit->amplitude_dn = guess.amplitude_dn;
  fit->sigma_u_px = fit->sigma_v_px = guess.spread_px;
  fit->background_variance_dn2 = plane_.variance;
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
  const double widest = std::max(fit->sigma_u_px, fit->sigma_v_px);
  const double narrowest = std::min(fit->sigma_u_px, fit->sigma_v_px);
  if (std::hypot(fit->u_px - guess.u_px, fit->v_px - guess.v_px) > 2.0 * guess.spread_px + 1.0) {
    return SpotVerdict::kNotASpot;
  }
  if (narrowest < 0.5 * min_spread_px_) return SpotVerdict::kNarrow;
  if (widest > 2.0 * max_spread_px_) return SpotVerdict::kWide;
  const double border = std::min({fit->u_px + 0.5,
                                  fit->v_px + 0.5,
                                  image.width_px - 0.5 - fit->u_px,
                                  image.height_px - 0.5 - fit->v_px});
  if (border < kBorderSigmas * widest) return SpotVerdict::kCutByBorder;
  Conclude(gain, fit);
  fit->background_dn = plane_.level + plane_.by_u * (fit->u_px - guess.u_px) +
                       plane_.by_v * (fit->v_px - guess.v_px);
  return SpotVerdict::kMeasured;
}

template <class Pixel>
int SpotMeter::CopyPatch(const ImageView& image) {
  const auto* first = static_cast<const std::byte*>(image.pixels);
  int clipped = 0;
  for (int row = outer_.top; row <= outer_.bottom; ++row) {
    const std::byte* from =
        first + row * image.stride_bytes + static_cast<std::size_t>(outer_.left) * sizeof(Pixel);
    float* value = Row(value_, row);
    float* use = Row(use_, row);
    for (int i = 0; i < outer_.width(); ++i) {
      const Pixel pixel = LoadPixel<Pixel>(from + static_cast<std::size_t>(i) * sizeof(Pixel));
      const bool is_clipped = pixel >= image.max_value;
      value[i] = pixel;
      use[i] = is_clipped ? 0.0f : 1.0f;
      if (is_clipped) {
        const int column = outer_.left + i;
        clipped += column >= inner_.left && column <= inner_.right && row >= inner_.top &&
                   row <= inner_.bottom;
      }
    }
    for (std::size_t i = static_cast<std::size_t>(outer_.width()); i < stride_; ++i) {
      value[i] = 0.0f;
      use[i] = 0.0f;
    }
  }
  return clipped;
}

void SpotMeter::RemoveLight(const SpotFit& other) {
  const double reach_u = 5.0 * other.sigma_u_px;
  const double reach_v = 5.0 * other.sigma_v_px;
  const int left = std::max(outer_.left, static_cast<int>(other.u_px - reach_u));
  const int right = std::min(outer_.right, static_cast<int>(other.u_px + reach_u));
  const int top = std::max(outer_.top, static_cast<int>(other.v_px - reach_v));
  const int bottom = std::min(outer_.bottom, static_cast<int>(other.v_px + reach_v));
  for (int column = left; column <= right; ++column) {
    const double x = (column - other.u_px) / other.sigma_u_px;
    gauss_u_[static_cast<std::size_t>(column - left)] =
        static_cast<float>(other.amplitude_dn * std::exp(-0.5 * x * x));
  }
  for (int row = top; row <= bottom; ++row) {
    const double y = (row - other.v_px) / other.sigma_v_px;
    const auto gauss = static_cast<float>(std::exp(-0.5 * y * y));
    float* value = Row(value_, row) + (left - outer_.left);
    for (int i = 0; i <= right - left; ++i)
      value[i] -= gauss * gauss_u_[static_cast<std::size_t>(i)];
  }
}

bool SpotMeter::FitPlane(const SensorNoise& noise, double u, double v) {
  const double noise_dn = std::sqrt(noise.dark_variance_dn2);
  if (!PlaneThroughMedians(noise_dn, u, v)) return false;
  if (!RefinePlane(4.0 * noise_dn + 1.0, u, v)) return false;
  return RefinePlane(3.0 * std::sqrt(plane_.variance) + 0.5, u, v);
}

// The window has eight neighbours: sides and corners. Each gives the median of some of its pixels;
// the plane goes through the medians, without up to three that are off: lamps, pipes.
bool SpotMeter::PlaneThroughMedians(double noise_dn, double u, double v) {
  const std::array<std::array<int, 2>, 3> columns = {{{outer_.left, inner_.left - 1},
                                                      {inner_.left, inner_.right},
                                                      {inner_.right + 1, outer_.right}}};
  const std::array<std::array<int, 2>, 3> rows = {{{outer_.top, inner_.top - 1},
                                                   {inner_.top, inner_.bottom},
                                                   {inner_.bottom + 1, outer_.bottom}}};
  struct Median {
    double u, v, level;
  };
  std::array<Median, 8> medians;
  std::size_t count = 0;
  for (std::size_t j = 0; j < 3; ++j) {
    for (std::size_t i = 0; i < 3; ++i) {
      const int width = columns[i][1] - columns[i][0] + 1;
      const int height = rows[j][1] - rows[j][0] + 1;
      if ((i == 1 && j == 1) || width < 1 || height < 1) continue;
      std::array<float, 25> sample;
      for (int k = 0; k < 25; ++k) {
        const int column = columns[i][0] + (2 * (k % 5) + 1) * width / 10;
        const int row = rows[j][0] + (2 * (k / 5) + 1) * height / 10;
        sample[static_cast<std::size_t>(k)] = Row(value_, row)[column - outer_.left];
      }
      std::nth_element(sample.begin(), sample.begin() + 12, sample.end());
      medians[count++] = {0.5 * (columns[i][0] + columns[i][1]) - u,
                          0.5 * (rows[j][0] + rows[j][1]) - v,
                          static_cast<double>(sample[12])};
    }
  }
  if (count < 3) return false;
  for (;;) {
    Eigen::Matrix3d normal = Eigen::Vector3d(1e-9, 1e-6, 1e-6).asDiagonal();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector3d row(1.0, medians[i].u, medians[i].v);
      normal += row * row.transpose();
      right += row * medians[i].level;
    }
    const Eigen::Vector3d plane = normal.ldlt().solve(right);
    plane_.level = plane[0];
    plane_.by_u = plane[1];
    plane_.by_v = plane[2];
    if (count <= 5) return true;
    std::size_t worst = 0;
    double worst_dn = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double off_dn =
          std::abs(medians[i].level - plane[0] - plane[1] * medians[i].u - plane[2] * medians[i].v);
      if (off_dn > worst_dn) {
        worst_dn = off_dn;
        worst = i;
      }
    }
    if (worst_dn < 2.0 * noise_dn + 0.5) return true;
    medians[worst] = medians[--count];
  }
}

bool SpotMeter::RefinePlane(double limit_dn, double u, double v) {
  const auto limit = static_cast<float>(limit_dn);
  const auto by_u = static_cast<float>(plane_.by_u);
  double n = 0.0, su = 0.0, sv = 0.0, suu = 0.0, suv = 0.0, svv = 0.0;
  double r = 0.0, ru = 0.0, rv = 0.0, rr = 0.0;
  for (int row = outer_.top; row <= outer_.bottom; ++row) {
    const float* value = Row(value_, row);
    const float* use = Row(use_, row);
    const double y = row - v;
    const double x0 = outer_.left - u;
    const auto level = static_cast<float>(plane_.level + plane_.by_v * y + plane_.by_u * x0);
    const bool beside = row >= inner_.top && row <= inner_.bottom;
    const int skip_from = beside ? inner_.left - outer_.left : outer_.width();
    const int skip_to = beside ? inner_.right - outer_.left : outer_.width();
    float row_n = 0.0f, row_x = 0.0f, row_xx = 0.0f, row_r = 0.0f, row_rx = 0.0f, row_rr = 0.0f;
    for (int i = 0; i < outer_.width(); ++i) {
      if (i == skip_from) i = skip_to + 1;
      if (i >= outer_.width()) break;
      const auto x = static_cast<float>(i);
      const float residual = value[i] - level - by_u * x;
      const float keep = std::abs(residual) < limit ? use[i] : 0.0f;
      row_n += keep;
      row_x += keep * x;
      row_xx += keep * x * x;
      row_r += keep * residual;
      row_rx += keep * residual * x;
      row_rr += keep * residual * residual;
    }
    const double x1 = static_cast<double>(row_x) + x0 * static_cast<double>(row_n);
    n += static_cast<double>(row_n);
    su += x1;
    sv += y * static_cast<double>(row_n);
    suu += static_cast<double>(row_xx) + 2.0 * x0 * static_cast<double>(row_x) +
           x0 * x0 * static_cast<double>(row_n);
    suv += y * x1;
    svv += y * y * static_cast<double>(row_n);
    r += static_cast<double>(row_r);
    ru += static_cast<double>(row_rx) + x0 * static_cast<double>(row_r);
    rv += y * static_cast<double>(row_r);
    rr += static_cast<double>(row_rr);
  }
  if (n < 8.0) return false;
  Eigen::Matrix3d normal;
  normal << n, su, sv, su, suu, suv, sv, suv, svv;
  normal.diagonal() += Eigen::Vector3d(0.0, 1e-6, 1e-6);
  const Eigen::Vector3d right(r, ru, rv);
  const Eigen::Matrix3d inverse = normal.inverse();
  const Eigen::Vector3d step = inverse * right;
  plane_.level += step[0];
  plane_.by_u += step[1];
  plane_.by_v += step[2];
  // Rounding to whole grey values leaves a twelfth even where every pixel reads the same.
  plane_.variance = std::max((rr - step.dot(right)) / std::max(n - 3.0, 1.0), 1.0 / 12.0);
  plane_.slope_variance = plane_.variance * std::max(inverse(1, 1), inverse(2, 2));
  return true;
}

void SpotMeter::SubtractPlane(double u, double v) {
  const auto by_u = static_cast<float>(plane_.by_u);
  for (int row = inner_.top; row <= inner_.bottom; ++row) {
    float* value = Row(value_, row) + (inner_.left - outer_.left);
    const auto level = static_cast<float>(plane_.level + plane_.by_v * (row - v) +
                                          plane_.by_u * (inner_.left - u));
    for (int i = 0; i < inner_.width(); ++i) value[i] -= level + by_u * static_cast<float>(i);
  }
}

void SpotMeter::FillTables(const SpotFit& fit) {
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
  fill(inner_.left, inner_.width(), fit.u_px, fit.sigma_u_px, gauss_u_, offset_u_, square_u_);
  fill(inner_.top, inner_.height(), fit.v_px, fit.sigma_v_px, gauss_v_, offset_v_, square_v_);
}

// With g the unit Gaussian, q = datum - A g, w = g / variance, X = (x / sigma_u)^2: first
// derivatives of the log likelihood by u, v, ln A, ln sigma_u, ln sigma_v, and the information
// between the last three. By symmetry u and v have none with them.
struct SpotMeter::Scores {
  double u = 0.0, v = 0.0, a = 0.0, su = 0.0, sv = 0.0;
  double aa = 0.0, asu = 0.0, asv = 0.0, susu = 0.0, susv = 0.0, svsv = 0.0;
};

SpotMeter::Scores SpotMeter::Score(const SpotFit& fit, double gain) const {
  const Floats dark = Spread(fit.background_variance_dn2);
  const Floats photon = Spread(gain * fit.amplitude_dn);
  const Floats amplitude = Spread(fit.amplitude_dn);
  Floats su{}, sv{}, sa{}, ssu{}, ssv{};
  Floats iaa{}, iau{}, iav{}, iuu{}, iuv{}, ivv{};
  const std::size_t columns = RoundUp(inner_.width());
  for (int row = inner_.top; row <= inner_.bottom; ++row) {
    const auto j = static_cast<std::size_t>(row - inner_.top);
    const float* value = Row(value_, row) + (inner_.left - outer_.left);
    const float* use = Row(use_, row) + (inner_.left - outer_.left);
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
  const double ceiling_dn = full_dn - plane_.level;
  const double noise_dn = std::sqrt(fit.background_variance_dn2 + gain * ceiling_dn);
  const auto limit = static_cast<float>(ceiling_dn - 2.0 * noise_dn);
  const auto amplitude = static_cast<float>(fit.amplitude_dn);
  for (int row = inner_.top; row <= inner_.bottom; ++row) {
    const float height = amplitude * gauss_v_[static_cast<std::size_t>(row - inner_.top)];
    float* use = Row(use_, row) + (inner_.left - outer_.left);
    for (int i = 0; i < inner_.width(); ++i) {
      if (height * gauss_u_[static_cast<std::size_t>(i)] > limit) use[i] = 0.0f;
    }
  }
}

bool SpotMeter::MaskSingleBrightPixels(const SpotFit& fit, double gain) {
  const auto amplitude = static_cast<float>(fit.amplitude_dn);
  const auto photon = static_cast<float>(36.0 * gain);
  const auto dark = static_cast<float>(36.0 * fit.background_variance_dn2);
  bool masked = false;
  for (int row = inner_.top + 1; row < inner_.bottom; ++row) {
    const float gauss_row = gauss_v_[static_cast<std::size_t>(row - inner_.top)];
    float* use = Row(use_, row) + (inner_.left - outer_.left);
    const float* value = Row(value_, row) + (inner_.left - outer_.left);
    for (int i = 1; i + 1 < inner_.width(); ++i) {
      const float model = amplitude * gauss_row * gauss_u_[static_cast<std::size_t>(i)];
      const float q = value[i] - model;
      if (q <= 0.0f || q * q < dark + photon * model || q < 0.05f * model) continue;
      // A wrong model is wrong in the neighbours too; a hot pixel is alone.
      const float beside =
          value[i - 1] + value[i + 1] + (value + stride_)[i] + (value - stride_)[i] - 4.0f * model;
      if (beside > 1.2f * q || use[i] == 0.0f) continue;
      use[i] = 0.0f;
      masked = true;
    }
  }
  return masked;
}

void SpotMeter::Conclude(double gain, SpotFit* fit) {
  const double dark = fit->background_variance_dn2;
  const Floats dark4 = Spread(dark);
  const Floats photon = Spread(gain * fit->amplitude_dn);
  const Floats amplitude = Spread(fit->amplitude_dn);
  // Sums of w^2, w^2 g, w, w g with X and Y; of datum g with 1, X, Y, xy; of what the residuals say
  // about the gain.
  Floats wwx{}, wwy{}, wwgx{}, wwgy{}, wx{}, wy{}, wgx{}, wgy{};
  Floats m0{}, muu{}, mvv{}, muv{}, k_seen{}, k_all{};
  const std::size_t columns = RoundUp(inner_.width());
  for (int row = inner_.top; row <= inner_.bottom; ++row) {
    const auto j = static_cast<std::size_t>(row - inner_.top);
    const float* value = Row(value_, row) + (inner_.left - outer_.left);
    const float* use = Row(use_, row) + (inner_.left - outer_.left);
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
  fit->by_dark_u_px2 = dark * Sum(wwx) / (du * du) + plane_.slope_variance * slope_u * slope_u;
  fit->by_dark_v_px2 = dark * Sum(wwy) / (dv * dv) + plane_.slope_variance * slope_v * slope_v;
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
