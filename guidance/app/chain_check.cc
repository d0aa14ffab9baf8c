#include "guidance/app/chain_check.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace tbm {
namespace {

constexpr double kInside95 = 7.8147;  // of chi squared with 3 degrees of freedom

Timestamp Shifted(Timestamp at, double seconds) {
  return {at.ns + static_cast<std::int64_t>(std::llround(seconds * 1e9))};
}

GuidedTrack::const_iterator FirstNotBefore(const GuidedTrack& track, Timestamp at) {
  return std::lower_bound(
      track.begin(), track.end(), at, [](const GuidedSample& sample, Timestamp t) {
        return sample.at < t;
      });
}

// A shot together with the track of its point.
struct Sight {
  const MachineShot* shot;
  const GuidedTrack* track;
};

std::vector<Sight> SightsOf(const GuidedTracks& tracks, const std::vector<MachineShot>& shots) {
  std::vector<Sight> sights;
  for (const MachineShot& shot : shots) {
    const auto track = tracks.find(shot.point);
    if (track != tracks.end()) sights.push_back({&shot, &track->second});
  }
  return sights;
}

constexpr double kMostMisfit = 25.0;  // five sigma

// How badly the shots fit when the clock is off by so much. Each shot costs as much as it
// contradicts, and no more than one that has nothing published around it.
double Misfit(const std::vector<Sight>& sights, double ahead_s, const ChainOptions& options) {
  double sum = 0.0;
  for (const Sight& sight : sights) {
    const auto place = PlaceAt(*sight.track, Shifted(sight.shot->at, -ahead_s), options.most_gap);
    if (!place) {
      sum += kMostMisfit;
      continue;
    }
    const double variance_m2 =
        place->covariance_m2.trace() / 3.0 + options.log_sigma_m * options.log_sigma_m + 1e-8;
    sum += std::min(kMostMisfit,
                    (place->p_in_site_m - sight.shot->p_in_site_m).squaredNorm() / variance_m2);
  }
  return sum;
}

// How many shots have published samples around them, and how many of these fit.
struct Fitting {
  std::size_t paired = 0;
  std::size_t good = 0;
};
Fitting FittingAt(const std::vector<Sight>& sights, double ahead_s, const ChainOptions& options) {
  Fitting fitting;
  for (const Sight& sight : sights) {
    if (!PlaceAt(*sight.track, Shifted(sight.shot->at, -ahead_s), options.most_gap)) continue;
    ++fitting.paired;
    if (Misfit({sight}, ahead_s, options) < kMostMisfit) ++fitting.good;
  }
  return fitting;
}

// Where to begin: a clock may be off by whole hours. Zero unless another fits clearly better.
double CoarseClock(const std::vector<Sight>& sights, const ChainOptions& options) {
  constexpr std::size_t kMostSights = 200;
  std::vector<Sight> some;
  const std::size_t step = sights.size() / kMostSights + 1;
  for (std::size_t i = 0; i < sights.size(); i += step) some.push_back(sights[i]);
  const double at_zero = Misfit(some, 0.0, options);
  double best_s = 0.0;
  double best = at_zero;
  for (double away_s = 1.0; away_s <= options.clock_range_s; away_s += 1.0) {
    for (const double ahead_s : {away_s, -away_s}) {
      const double misfit = Misfit(some, ahead_s, options);
      if (misfit < best) {
        best = misfit;
        best_s = ahead_s;
      }
    }
  }
  constexpr double kClearly = 9.0;
  return at_zero - best > kClearly ? best_s : 0.0;
}

// One step of least squares in (clock, bias).
struct ClockStep {
  double step_s = 0.0;
  double sigma_s = INFINITY;
  std::size_t used = 0;
};

ClockStep StepClock(const std::vector<Sight>& sights, double ahead_s, const ChainOptions& options) {
  struct Row {
    Eigen::Vector3d difference_m;
    Eigen::Vector3d velocity_m_per_s;
  };
  std::vector<Row> rows;
  Eigen::Matrix3d prior_m2 = Eigen::Matrix3d::Zero();
  for (const Sight& sight : sights) {
    const Timestamp at = Shifted(sight.shot->at, -ahead_s);
    const auto place = PlaceAt(*sight.track, at, options.most_gap);
    const auto velocity = VelocityAt(*sight.track, at);
    if (!place || !velocity) continue;
    rows.push_back({place->p_in_site_m - sight.shot->p_in_site_m, *velocity});
    prior_m2 += place->covariance_m2;
  }
  ClockStep step;
  step.used = rows.size();
  if (rows.size() < 3) return step;
  prior_m2 = prior_m2 / static_cast<double>(rows.size()) +
             (options.log_sigma_m * options.log_sigma_m + 1e-8) * Eigen::Matrix3d::Identity();

  // A first pass with the published covariance as the noise, then with what the residuals show.
  double noise_m2 = prior_m2.trace() / 3.0;
  for (int pass = 0; pass < 2; ++pass) {
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    normal.bottomRightCorner<3, 3>() = prior_m2.inverse();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (const Row& row : rows) {
      // published(t - ahead) changes by -velocity for each second of `ahead`.
      Eigen::Matrix<double, 3, 4> by;
      by << -row.velocity_m_per_s, -Eigen::Matrix3d::Identity();
      normal += by.transpose() * by / noise_m2;
      right -= by.transpose() * row.difference_m / noise_m2;
    }
    // Keeps a machine that stands from dividing by nothing: a sigma of a million seconds.
    normal(0, 0) += 1e-12;
    const Eigen::LDLT<Eigen::Matrix4d> solver(normal);
    const Eigen::Vector4d solved = solver.solve(right);
    step.step_s = solved[0];
    step.sigma_s = std::sqrt(solver.solve(Eigen::Vector4d::Unit(0))[0]);
    double sum_m2 = 0.0;
    for (const Row& row : rows) {
      sum_m2 +=
          (row.difference_m - row.velocity_m_per_s * solved[0] - solved.tail<3>()).squaredNorm();
    }
    const double dof = std::max(1.0, 3.0 * static_cast<double>(rows.size()) - 4.0);
    constexpr double kLeast_m2 = 1e-8;  // a tenth of a millimetre
    noise_m2 = std::max(kLeast_m2, sum_m2 / dof);
  }
  return step;
}

}  // namespace

Result<GuidedPlace, NoGuidedPlace> PlaceAt(const GuidedTrack& track,
                                           Timestamp at,
                                           Duration most_gap) {
  const auto after = FirstNotBefore(track, at);
  if (after == track.end()) return Failure{NoGuidedPlace::kNoPartner};
  if (after->at == at) {
    if (!after->is_valid) return Failure{NoGuidedPlace::kInvalid};
    return GuidedPlace{after->p_in_site_m, after->covariance_m2};
  }
  if (after == track.begin()) return Failure{NoGuidedPlace::kNoPartner};
  const auto before = std::prev(after);
  if (after->at - before->at > most_gap) return Failure{NoGuidedPlace::kNoPartner};
  if (!before->is_valid || !after->is_valid) return Failure{NoGuidedPlace::kInvalid};
  const double part = SecondsBetween(before->at, at) / SecondsBetween(before->at, after->at);
  const bool is_after_worse = after->covariance_m2.trace() > before->covariance_m2.trace();
  return GuidedPlace{before->p_in_site_m + part * (after->p_in_site_m - before->p_in_site_m),
                     is_after_worse ? after->covariance_m2 : before->covariance_m2};
}

std::optional<Eigen::Vector3d> VelocityAt(const GuidedTrack& track, Timestamp at) {
  constexpr Duration kWithin = std::chrono::seconds(15);
  constexpr double kLeast_s = 5.0;
  const auto begin = FirstNotBefore(track, at - kWithin);
  double count = 0.0;
  double sum_s = 0.0;
  double sum_s2 = 0.0;
  Eigen::Vector3d sum_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d sum_sm = Eigen::Vector3d::Zero();
  double sum_m2 = 0.0;
  std::optional<double> first_s;
  double last_s = 0.0;
  Eigen::Vector3d first_m;
  for (auto sample = begin; sample != track.end() && sample->at <= at + kWithin; ++sample) {
    if (!sample->is_valid) continue;
    const double t_s = SecondsBetween(at, sample->at);
    if (!first_s) {
      first_s = t_s;
      first_m = sample->p_in_site_m;
    }
    last_s = t_s;
    const Eigen::Vector3d p_m = sample->p_in_site_m - first_m;
    count += 1.0;
    sum_s += t_s;
    sum_s2 += t_s * t_s;
    sum_m += p_m;
    sum_sm += t_s * p_m;
    sum_m2 += p_m.squaredNorm();
  }
  if (!first_s || last_s - *first_s < kLeast_s) return std::nullopt;
  const double spread_s2 = sum_s2 - sum_s * sum_s / count;
  const Eigen::Vector3d velocity = (sum_sm - sum_s / count * sum_m) / spread_s2;
  const double scatter_m2 =
      sum_m2 - sum_m.squaredNorm() / count - velocity.squaredNorm() * spread_s2;
  const double sigma_m_per_s =
      std::sqrt(std::max(0.0, scatter_m2) / std::max(1.0, count - 2.0) / spread_s2);
  constexpr double kStanding_m_per_s = 1e-4;
  if (velocity.norm() < std::max(kStanding_m_per_s, 5.0 * sigma_m_per_s)) {
    return Eigen::Vector3d::Zero();
  }
  return velocity;
}

Result<ClockEstimate, NoClockEstimate> EstimateClock(const GuidedTracks& tracks,
                                                     const std::vector<MachineShot>& shots,
                                                     const ChainOptions& options) {
  const std::vector<Sight> sights = SightsOf(tracks, shots);
  if (sights.size() < 3) return Failure{NoClockEstimate::kTooFewShots};
  ClockEstimate estimate;
  estimate.ahead_s = CoarseClock(sights, options);
  constexpr double kMostSigma_s = 60.0;
  for (int round = 0; round < 20; ++round) {
    const ClockStep step = StepClock(sights, estimate.ahead_s, options);
    if (step.used < 3) return Failure{NoClockEstimate::kTooFewShots};
    if (!(step.sigma_s <= kMostSigma_s)) return Failure{NoClockEstimate::kMovedTooLittle};
    estimate.ahead_s += step.step_s;
    estimate.sigma_s = step.sigma_s;
    if (std::abs(step.step_s) < 1e-3) break;
  }
  const Fitting found = FittingAt(sights, estimate.ahead_s, options);
  const std::size_t paired = std::max(found.paired, FittingAt(sights, 0.0, options).paired);
  if (5 * found.good < 4 * paired) return Failure{NoClockEstimate::kOtherFault};
  estimate.is_significant = std::abs(estimate.ahead_s) > 3.0 * estimate.sigma_s;
  return estimate;
}

bool ChainObservation::IsInside95() const { return standardised_2 <= kInside95; }

ChainPairs PairShots(const GuidedTracks& tracks,
                     const std::vector<MachineShot>& shots,
                     double ahead_s,
                     double ahead_sigma_s,
                     const ChainOptions& options) {
  ChainPairs pairs;
  for (const Sight& sight : SightsOf(tracks, shots)) {
    const Timestamp at = Shifted(sight.shot->at, -ahead_s);
    const auto place = PlaceAt(*sight.track, at, options.most_gap);
    if (!place) {
      ++(place.error() == NoGuidedPlace::kInvalid ? pairs.without_pose : pairs.without_partner);
      continue;
    }
    ChainObservation one{at, sight.shot->point, place->p_in_site_m, sight.shot->p_in_site_m};
    Eigen::Matrix3d covariance_m2 = place->covariance_m2;
    covariance_m2.diagonal().array() += options.log_sigma_m * options.log_sigma_m;
    if (ahead_sigma_s > 0.0) {
      const Eigen::Vector3d velocity =
          VelocityAt(*sight.track, at).value_or(Eigen::Vector3d::Zero());
      covariance_m2 += ahead_sigma_s * ahead_sigma_s * velocity * velocity.transpose();
    }
    one.sigma_m = std::sqrt(covariance_m2.trace());
    one.standardised_2 = one.difference_m().dot(covariance_m2.ldlt().solve(one.difference_m()));
    pairs.observations.push_back(std::move(one));
  }
  return pairs;
}

}  // namespace tbm
