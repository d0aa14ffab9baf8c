#include "guidance/rail/quiet_watch.h"

#include <algorithm>
#include <cmath>

namespace tbm {
namespace {

constexpr double kWindow_s = 0.25;
// A window whose mean is off by so many sigma of a mean, or whose spread is so many times the
// unit's, is no rest.
constexpr double kMostMeanSigmas = 7.0;
constexpr double kMostSpread = 2.0;
constexpr double kMostForceOff_m_s2 = 0.02;
constexpr double kLeastQuiet_s = 1.0;
// A sample that ends later than one and a half periods after the one before leaves a gap.
constexpr double kGapPeriods = 1.5;

// Where the rail is canted the axes feel gravity otherwise, but no more and no less of it, but for
// what their biases change.
bool FeelsGravityAlone(const QuietMean& window, const RestSignature& rest) {
  return std::abs(window.accel.norm() - rest.mean_accel_m_s2.norm()) < kMostForceOff_m_s2;
}

}  // namespace

QuietMean MeanOf(const std::vector<ImuSample>& imu, std::size_t begin, std::size_t end) {
  QuietMean mean;
  const double count = static_cast<double>(end - begin);
  for (std::size_t i = begin; i < end; ++i) {
    mean.gyro += imu[i].gyro_rad_s / count;
    mean.accel += imu[i].accel_m_s2 / count;
  }
  for (std::size_t i = begin; i < end; ++i) {
    mean.gyro_sigma += (imu[i].gyro_rad_s - mean.gyro).cwiseAbs2() / count;
    mean.accel_sigma += (imu[i].accel_m_s2 - mean.accel).cwiseAbs2() / count;
  }
  mean.gyro_sigma = mean.gyro_sigma.cwiseSqrt();
  mean.accel_sigma = mean.accel_sigma.cwiseSqrt();
  return mean;
}

bool IsNear(const Eigen::Vector3d& mean,
            const Eigen::Vector3d& rest_mean,
            const Eigen::Vector3d& rest_sigma,
            double samples) {
  const Eigen::Array3d limit = kMostMeanSigmas * rest_sigma.array() / std::sqrt(samples);
  return ((mean - rest_mean).array().abs() <= limit).all();
}

bool IsQuiet(const QuietMean& window, const RestSignature& rest, double samples) {
  const bool is_even =
      (window.gyro_sigma.array() <= kMostSpread * rest.sigma_gyro_rad_s.array()).all() &&
      (window.accel_sigma.array() <= kMostSpread * rest.sigma_accel_m_s2.array()).all();
  return is_even && IsNear(window.gyro, rest.mean_gyro_rad_s, rest.sigma_gyro_rad_s, samples);
}

double GapBefore(const RailSetup& setup, Timestamp last, const ImuSample& sample) {
  const double span_s = SecondsBetween(last, sample.ends_at);
  return span_s > kGapPeriods / setup.imu.rate_hz ? span_s : 0.0;
}

std::size_t QuietWindowSamples(const RailSetup& setup) {
  return std::max<std::size_t>(8, static_cast<std::size_t>(kWindow_s * setup.imu.rate_hz));
}

QuietWatch::QuietWatch(const RailSetup& setup, const RestSignature& rest)
    : setup_(setup), rest_(rest), window_samples_(QuietWindowSamples(setup)) {}

void QuietWatch::Break() {
  window_.clear();
  quiet_windows_ = 0;
  is_told_ = false;
}

void QuietWatch::Feed(const ImuSample& sample) {
  if (last_ && GapBefore(setup_, *last_, sample) > 0.0) Break();
  last_ = sample.ends_at;
  window_.push_back(sample);
  if (window_.size() < window_samples_) return;
  const QuietMean mean = MeanOf(window_, 0, window_.size());
  const Timestamp first = window_.front().ends_at;
  const bool is_quiet =
      IsQuiet(mean, rest_, static_cast<double>(window_.size())) && FeelsGravityAlone(mean, rest_);
  if (!is_quiet) return Break();
  window_.clear();
  ++quiet_windows_;
  if (quiet_windows_ == 2) span_.begins_at = first;
  if (quiet_windows_ < 3) return;
  span_.ends_at = first;
  if (is_told_) {
    spans_.back() = span_;
  } else if (SecondsBetween(span_.begins_at, span_.ends_at) >= kLeastQuiet_s - 2.0 * kWindow_s) {
    spans_.push_back(span_);
    is_told_ = true;
  }
}

}  // namespace tbm
