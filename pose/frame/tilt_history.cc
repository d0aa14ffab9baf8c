#include "pose/frame/tilt_history.h"

#include <algorithm>
#include <cmath>

namespace tbm {
namespace {

bool IsFinite(const Inclination& inclination) {
  return std::isfinite(inclination.beta_rad) && std::isfinite(inclination.gamma_rad);
}

Duration Between(Timestamp a, Timestamp b) { return a < b ? b - a : a - b; }

// Ratio s^2 / sigma^2 above which `pairs` differences are noisier than the rig says, at about 0.1 %
// false alarms: the Wilson-Hilferty approximation of the chi-squared quantile, divided by its
// degrees of freedom. Differences of neighbours share readings, so about two thirds of them are
// independent.
double SignificantVarianceRatio(int pairs) {
  const double dof = 2.0 * pairs * (2.0 / 3.0);
  const double t = 2.0 / (9.0 * dof);
  const double cube_root = 1.0 - t + 3.09 * std::sqrt(t);
  return cube_root * cube_root * cube_root;
}

}  // namespace

void TiltHistory::Add(Timestamp sensed_at, const Inclination& inclination) {
  if (!entries_.empty() && entries_[entries_.size() - 1].sensed_at - sensed_at > kClockSetBack) {
    entries_.clear();
  }
  if (entries_.full()) {
    if (sensed_at < entries_[0].sensed_at) return;
    entries_.erase(0);
  }
  std::size_t place = entries_.size();
  while (place > 0 && sensed_at < entries_[place - 1].sensed_at) --place;
  if (place > 0 && entries_[place - 1].sensed_at == sensed_at) {
    entries_[place - 1].inclination = inclination;
    return;
  }
  entries_.push_back({});
  for (std::size_t i = entries_.size() - 1; i > place; --i) entries_[i] = entries_[i - 1];
  entries_[place] = {sensed_at, inclination};
}

Result<TiltObservation, PoseReason> TiltHistory::At(Timestamp at, const TiltMount& mount) const {
  if (entries_.empty()) return Failure{PoseReason::kTiltMissing};

  const Entry* before = nullptr;
  const Entry* after = nullptr;
  for (const Entry& entry : entries_) {
    if (entry.sensed_at <= at) {
      before = &entry;
    } else {
      after = &entry;
      break;
    }
  }
  if (before != nullptr && at - before->sensed_at > options_.max_age) before = nullptr;
  if (after != nullptr && after->sensed_at - at > options_.max_age) after = nullptr;
  if (before == nullptr && after == nullptr) return Failure{PoseReason::kTiltStale};

  Inclination reading;
  if (before != nullptr && after != nullptr) {
    if (!IsFinite(before->inclination) || !IsFinite(after->inclination)) {
      return Failure{PoseReason::kTiltNotFinite};
    }
    const double part =
        SecondsBetween(before->sensed_at, at) / SecondsBetween(before->sensed_at, after->sensed_at);
    reading.beta_rad = before->inclination.beta_rad +
                       part * (after->inclination.beta_rad - before->inclination.beta_rad);
    reading.gamma_rad = before->inclination.gamma_rad +
                        part * (after->inclination.gamma_rad - before->inclination.gamma_rad);
  } else {
    reading = (before != nullptr ? before : after)->inclination;
  }
  reading.beta_rad *= mount.sign[0];
  reading.gamma_rad *= mount.sign[1];

  const auto up = UpInTilt(reading);
  if (!up) {
    return Failure{up.error() == TiltFailure::kNotFinite ? PoseReason::kTiltNotFinite
                                                         : PoseReason::kTiltOutOfRange};
  }
  return TiltObservation{reading, SigmaAt(at, mount.sigma_rad)};
}

double TiltHistory::SigmaAt(Timestamp at, double rig_sigma_rad) const {
  double sum_of_squares = 0.0;
  int pairs = 0;
  for (std::size_t i = 1; i < entries_.size(); ++i) {
    const Entry& a = entries_[i - 1];
    const Entry& b = entries_[i];
    if (Between(b.sensed_at, at) > options_.noise_window) continue;
    if (b.sensed_at - a.sensed_at > options_.noise_pair_max) continue;
    if (!IsFinite(a.inclination) || !IsFinite(b.inclination)) continue;
    const double beta_step = b.inclination.beta_rad - a.inclination.beta_rad;
    const double gamma_step = b.inclination.gamma_rad - a.inclination.gamma_rad;
    sum_of_squares += beta_step * beta_step + gamma_step * gamma_step;
    ++pairs;
  }
  if (pairs < 4) return rig_sigma_rad;
  // Each difference holds the noise of two readings, each pair two outputs.
  const double variance = sum_of_squares / (4.0 * pairs);
  const double limit = SignificantVarianceRatio(pairs) * rig_sigma_rad * rig_sigma_rad;
  return variance > limit ? std::sqrt(variance) : rig_sigma_rad;
}

}  // namespace tbm
