#include "guidance/shield/trend.h"

#include <algorithm>
#include <cmath>

namespace tbm {
namespace {

// Where the shield points differs from where it goes by its crab, which changes over metres: one
// lead a metre is as good as many.
constexpr double kBetweenLeads_m = 1.0;
// Places are kept this far apart at least, so that 256 of them reach back over 25 m.
constexpr double kBetweenPlaces_m = 0.1;
constexpr double kLeastSigma_m = 1e-6;

}  // namespace

bool Track::Add(const TrackPoint& look, std::optional<double> lead_per_m, double lead_sigma_per_m) {
  if (!std::isfinite(look.at.m) || !std::isfinite(look.off_m) ||
      !std::isfinite(look.random_sigma_m)) {
    return false;
  }
  const double step_m = look.at.m - at_m_;
  const bool goes_back = step_m < -options_.least_step_m;
  if (has_begun_ && goes_back && step_m > -options_.back_m) return false;
  if (!has_begun_ || goes_back) {
    Begin(look);
  } else {
    if (step_m > 0.0) Go(step_m);
    const double sigma_m = std::max(look.random_sigma_m, kLeastSigma_m);
    Observe({1.0, 0.0}, look.off_m, sigma_m * sigma_m);
    Keep(look);
  }
  const bool lead_is_new = places_.size() == 1 || at_m_ - pointed_at_m_ >= kBetweenLeads_m;
  if (lead_per_m && std::isfinite(*lead_per_m) && lead_is_new) {
    Observe({0.0, 1.0},
            *lead_per_m,
            lead_sigma_per_m * lead_sigma_per_m +
                options_.crab_sigma_per_m * options_.crab_sigma_per_m);
    pointed_at_m_ = at_m_;
  }
  return true;
}

void Track::Begin(const TrackPoint& look) {
  has_begun_ = true;
  at_m_ = look.at.m;
  pointed_at_m_ = at_m_ - kBetweenLeads_m;
  state_ = {look.off_m, 0.0};
  const double sigma_m = std::max(look.random_sigma_m, kLeastSigma_m);
  covariance_ =
      Eigen::Vector2d(sigma_m * sigma_m, options_.start_slope_sigma * options_.start_slope_sigma)
          .asDiagonal();
  places_.clear();
  places_.push_back({look.at.m, look.at.m, look.off_m, sigma_m * sigma_m});
}

// P = F P F^T + Q, with the noise on the slope carried into the offset: q [ds^3/3 ds^2/2; . ds].
void Track::Go(double step_m) {
  const double q = options_.steering_per_sqrt_m * options_.steering_per_sqrt_m;
  Eigen::Matrix2d forward;
  forward << 1.0, step_m, 0.0, 1.0;
  Eigen::Matrix2d noise;
  noise << step_m * step_m * step_m / 3.0, step_m * step_m / 2.0, step_m * step_m / 2.0, step_m;
  state_ = forward * state_;
  covariance_ = forward * covariance_ * forward.transpose() + q * noise;
  at_m_ += step_m;
}

// Joseph's form: stays symmetric and positive however often one place is looked at.
void Track::Observe(const Eigen::RowVector2d& by_state, double value, double variance) {
  const Eigen::Vector2d toward = covariance_ * by_state.transpose();
  const Eigen::Vector2d gain = toward / (by_state.dot(toward) + variance);
  state_ += gain * (value - by_state.dot(state_));
  const Eigen::Matrix2d left = Eigen::Matrix2d::Identity() - gain * by_state;
  covariance_ = left * covariance_ * left.transpose() + variance * gain * gain.transpose();
}

// Looks at one place are averaged by their weights; the oldest place makes room.
void Track::Keep(const TrackPoint& look) {
  const double sigma_m = std::max(look.random_sigma_m, kLeastSigma_m);
  const double variance = sigma_m * sigma_m;
  Place& last = places_.back();
  if (look.at.m - last.from_m < kBetweenPlaces_m) {
    const double share = last.variance_m2 / (last.variance_m2 + variance);
    last.at_m += share * (look.at.m - last.at_m);
    last.off_m += share * (look.off_m - last.off_m);
    last.variance_m2 *= variance / (last.variance_m2 + variance);
    return;
  }
  if (places_.full()) places_.erase(0);
  places_.push_back({look.at.m, look.at.m, look.off_m, variance});
}

std::optional<InternalChainage> Track::at() const {
  if (!has_begun_) return {};
  return InternalChainage{at_m_};
}

std::optional<Prediction> Track::Ahead(double ahead_m) const {
  if (!has_begun_) return {};
  Track there = *this;
  if (ahead_m > 0.0) there.Go(ahead_m);
  return Prediction{there.state_[0], std::sqrt(there.covariance_(0, 0))};
}

std::optional<Slope> Track::Over(double length_m) const {
  double sum = 0.0;
  double sum_at = 0.0;
  double sum_off = 0.0;
  double first_m = 0.0;
  int count = 0;
  for (const Place& place : places_) {
    if (place.at_m < places_.back().at_m - length_m) continue;
    if (count++ == 0) first_m = place.at_m;
    sum += 1.0 / place.variance_m2;
    sum_at += (place.at_m - first_m) / place.variance_m2;
    sum_off += place.off_m / place.variance_m2;
  }
  const double driven_m = count == 0 ? 0.0 : places_.back().at_m - first_m;
  if (count < 3 || driven_m < length_m / 3.0) return {};
  const double mean_at_m = first_m + sum_at / sum;
  const double mean_off_m = sum_off / sum;
  double moment = 0.0;
  double product = 0.0;
  for (const Place& place : places_) {
    if (place.at_m < first_m) continue;
    moment += (place.at_m - mean_at_m) * (place.at_m - mean_at_m) / place.variance_m2;
    product += (place.at_m - mean_at_m) * (place.off_m - mean_off_m) / place.variance_m2;
  }
  const double slope = product / moment;
  double chi2 = 0.0;
  for (const Place& place : places_) {
    if (place.at_m < first_m) continue;
    const double left = place.off_m - mean_off_m - slope * (place.at_m - mean_at_m);
    chi2 += left * left / place.variance_m2;
  }
  // A path that is no line is known no better than it scatters about one.
  const double scale = std::max(1.0, chi2 / (count - 2));
  return Slope{slope, std::sqrt(scale / moment), driven_m};
}

}  // namespace tbm
