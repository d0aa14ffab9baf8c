#include "devices/camera/exposure_control.h"

#include <algorithm>
#include <cmath>

namespace tbm {
namespace {

// Cameras round an exposure to their own step; this much is the same exposure.
constexpr double kSameExposure = 0.03;

bool IsAbout(double a, double b) { return std::abs(a - b) <= kSameExposure * b + 1.0; }

template <std::size_t N>
double Median(std::array<double, N> values) {
  std::nth_element(values.begin(), values.begin() + N / 2, values.end());
  return values[N / 2];
}

}  // namespace

std::optional<double> ExposureControl::Update(const ExposureSample& sample) {
  if (!(sample.exposure_us > 0.0) || IsWaiting(sample.exposure_us)) return std::nullopt;
  if (sample.is_saturated) return Step(sample.exposure_us, sample.exposure_us / kLargestStep);
  if (sample.leds.empty()) return Search(sample);
  without_leds_ = 0;

  Levels levels{0.0, 1.0, false};
  for (const LedLevel& led : sample.leds) {
    const double level = std::min(led.peak_dn / sample.full_scale_dn, 1.0);
    levels.brightest = std::max(levels.brightest, level);
    levels.faintest = std::min(levels.faintest, level);
    levels.is_clipped = levels.is_clipped || led.is_clipped;
  }
  recent_[count_++] = levels;
  if (count_ < kFrames) return std::nullopt;
  const double factor = Factor();
  count_ = 0;
  if (factor == 1.0) return std::nullopt;
  return Step(sample.exposure_us, sample.exposure_us * factor);
}

bool ExposureControl::IsWaiting(double exposure_us) {
  if (!requested_us_) return false;
  const bool has_arrived = IsAbout(exposure_us, *requested_us_);
  if (has_arrived && ++settled_ <= kSettle) return true;
  if (!has_arrived && ++waited_ <= kPatience) return true;
  requested_us_.reset();
  return false;
}

double ExposureControl::Factor() const {
  std::array<double, kFrames> bright{};
  std::array<double, kFrames> faint{};
  std::size_t clipped = 0;
  for (std::size_t i = 0; i < kFrames; ++i) {
    bright[i] = recent_[i].brightest;
    faint[i] = recent_[i].faintest;
    clipped += recent_[i].is_clipped ? 1 : 0;
  }
  // How far above full scale a clipped peak would be, nobody knows; when the faintest is clipped
  // as well the step is the largest one.
  if (2 * clipped > kFrames) return Median(faint) > kHighest ? 1.0 / kLargestStep : kClippedStep;

  const double brightest = Median(bright);
  const double faintest = Median(faint);
  const double factor = std::min(kTarget / std::sqrt(brightest * faintest), kBrightest / brightest);
  const bool is_too_bright = brightest > kHighest;
  const bool is_too_dark = faintest < kLowest && factor > 1.0;
  if (!is_too_bright && !is_too_dark) return 1.0;
  // A rise of a few per cent is worth less than the steadiness it costs.
  if (is_too_dark && factor < 1.08) return 1.0;
  return std::clamp(factor, 1.0 / kLargestStep, kLargestStep);
}

std::optional<double> ExposureControl::Search(const ExposureSample& sample) {
  count_ = 0;
  if (++without_leds_ < kHold) return std::nullopt;
  const bool is_at_end = sample.exposure_us >= limits_.max_us * (1.0 - kSameExposure);
  const double next_us = is_at_end ? limits_.min_us : sample.exposure_us * kSearch;
  // The next exposures are tried faster than the first change of mind; they have shown nothing.
  const std::optional<double> step = Step(sample.exposure_us, next_us);
  without_leds_ = kHold - 3;
  return step;
}

std::optional<double> ExposureControl::Step(double from_us, double to_us) {
  const double clamped_us = std::clamp(to_us, limits_.min_us, limits_.max_us);
  count_ = 0;
  if (IsAbout(clamped_us, from_us)) return std::nullopt;
  requested_us_ = clamped_us;
  waited_ = 0;
  settled_ = 0;
  return clamped_us;
}

}  // namespace tbm
