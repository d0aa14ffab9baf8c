#include "guidance/core/rear_tracker.h"

#include <algorithm>
#include <cmath>

#include "guidance/shield/attitude.h"

namespace tbm {
namespace {

// Beside what the joint shows: both shields may advance together, as one. Without the joint nobody
// says whether the machine bores or regrips, and both lie within two sigma.
constexpr double kSpeedPrior_m_per_s = 2e-3;
constexpr double kSpeedPriorWithoutJoint_m_per_s = 5e-3;
// Readings of one second share the vibration of that second: averaging more of them gains nothing.
constexpr int kMostIndependentTilts = 25;
// A fix comes with every prism, every few seconds, and a check of the references every ten minutes:
// what is kept must reach back behind the last check. Two within this time are kept at most.
constexpr Duration kFixesApart = std::chrono::seconds(30);

GuidanceReason ReasonOf(RearShieldFailure failure) {
  switch (failure) {
    case RearShieldFailure::kTooFewFixes:
    case RearShieldFailure::kNoStart:
      return GuidanceReason::kTooFewPrisms;
    case RearShieldFailure::kNotObservable:
      return GuidanceReason::kNotObservable;
    case RearShieldFailure::kNotFinite:
    case RearShieldFailure::kNotConverged:
    case RearShieldFailure::kInconsistent:
      return GuidanceReason::kPrismsDisagree;
  }
  return GuidanceReason::kPrismsDisagree;
}

}  // namespace

double ClosingSigma(double closed_m) {
  constexpr double kDeadBandSigma_m = 0.003;
  constexpr double kSlip = 0.02;
  return closed_m == 0.0 ? 0.0 : std::hypot(kDeadBandSigma_m, kSlip * closed_m);
}

double RegripSigma(double unwatched_s) {
  constexpr double kFastRegrip_m_per_s = 8e-3;
  constexpr double kLongestStroke_m = 2.0;
  return std::clamp(kFastRegrip_m_per_s * unwatched_s, 0.0, kLongestStroke_m);
}

double UnwatchedSigma(const JointClosing& joint, Timestamp one, Timestamp other) {
  const auto [from, to] = std::minmax(one, other);
  const Timestamp since = joint.last() ? std::max(from, *joint.last()) : from;
  return RegripSigma(SecondsBetween(since, to));
}

bool RearTracker::IsTrusted(Timestamp sensed_at) const {
  return set_up_ && set_up_->number != 0 &&
         !(set_up_->trusted_until && sensed_at > *set_up_->trusted_until);
}

void RearTracker::Add(const PrismSeen& seen,
                      const TiltMean& camera_tilt,
                      const JointClosing& joint) {
  if (seen.prism >= machine_.prisms.size()) return;
  Kept& kept = kept_[seen.prism];
  // Late and doubled readings change nothing. The set-up's number says nothing of the order: one
  // that is taken up again has its old number.
  if (kept.is_there && seen.sensed_at <= kept.seen.sensed_at) return;
  kept = {seen, true};
  Fix(camera_tilt, joint);
}

void RearTracker::Add(const SetUpKnown& set_up,
                      const TiltMean& camera_tilt,
                      const JointClosing& joint) {
  const bool is_another =
      !set_up_ || set_up_->number != set_up.number || set_up_->covariance != set_up.covariance;
  const RearShieldFix* before = fix();
  set_up_ = set_up;
  const RearShieldFix* now = fix();
  if (before != nullptr && (now == nullptr || now->at < before->at)) ++quarantines_;
  DropDoubted(set_up);
  if (set_up.number == 0) {
    trouble_ = GuidanceReason::kNoSetUp;
  } else if (is_another) {
    trouble_ = past_.empty() ? GuidanceReason::kNoFix : GuidanceReason::kNone;
    Fix(camera_tilt, joint);
  }
}

// When another set-up comes instead of a suspect one, nobody will say any more whether the readings
// that were doubted are good.
void RearTracker::DropDoubted(const SetUpKnown& set_up) {
  if (set_up.number == 0) return;
  if (suspect_ && suspect_->number != set_up.number) {
    while (!past_.empty() && past_.back().newest_reading > *suspect_->trusted_until) {
      past_.erase(past_.size() - 1);
    }
  }
  suspect_.reset();
  if (set_up.trusted_until) suspect_ = set_up;
}

void RearTracker::Fix(const TiltMean& camera_tilt, const JointClosing& joint) {
  if (!set_up_ || set_up_->number == 0) return;
  RearShieldProblem problem;
  problem.station_covariance = set_up_->covariance;
  problem.speed_sigma_m_per_s = kSpeedPrior_m_per_s;
  Timestamp newest{};
  for (const Kept& kept : kept_) {
    if (kept.is_there && kept.seen.set_up_number == set_up_->number) {
      newest = std::max(newest, kept.seen.sensed_at);
    }
  }
  for (std::size_t i = 0; i < machine_.prisms.size(); ++i) {
    problem.prisms.push_back(machine_.prisms[i].prism);
    const Kept& kept = kept_[i];
    if (!kept.is_there || kept.seen.set_up_number != set_up_->number ||
        SecondsBetween(kept.seen.sensed_at, newest) > machine_.fix_window_s) {
      continue;
    }
    const std::optional<double> moved_m = joint.Between(newest, kept.seen.sensed_at);
    double moved_sigma_m = 0.0;
    if (moved_m) {
      moved_sigma_m =
          std::hypot(ClosingSigma(*moved_m), UnwatchedSigma(joint, kept.seen.sensed_at, newest));
    } else {
      problem.speed_sigma_m_per_s = kSpeedPriorWithoutJoint_m_per_s;
    }
    problem.fixes.push_back({static_cast<int>(i),
                             kept.seen.sensed_at,
                             kept.seen.p_in_site,
                             kept.seen.covariance,
                             kept.seen.by_station,
                             moved_m.value_or(0.0),
                             moved_sigma_m});
  }
  // Of a set-up that is taken up again some readings may be left from before the later one.
  if (problem.fixes.empty() || (!past_.empty() && newest < past_.back().newest_reading)) return;
  problem.at = newest;
  if (const auto tilt = camera_tilt.Around(newest)) {
    const double sigma_rad =
        rig_.camera_tilt.sigma_rad / std::sqrt(std::min(tilt->count, kMostIndependentTilts));
    problem.up = UpOfRearShield(rig_, machine_.geometry, tilt->inclination, sigma_rad);
  }
  if (!past_.empty()) problem.start = past_.back().fix.site_from_rear_shield;
  // One prism and the tilt leave the heading open: the last one that was measured, grown old.
  if (problem.fixes.size() == 1) problem.heading = EarlierHeading(newest);
  const auto fix = FixRearShield(problem, {});
  if (!fix) {
    trouble_ = ReasonOf(fix.error());
    return;
  }
  trouble_ = GuidanceReason::kNone;
  Keep({*fix, newest, !problem.heading});
}

// Of three that are close together the middle one goes, or the first if it is worth less.
void RearTracker::Keep(const PastFix& newest) {
  const std::size_t count = past_.size();
  if (count >= 2) {
    const PastFix& first = past_[count - 2];
    const PastFix& middle = past_[count - 1];
    const bool is_newest_trusted =
        IsTrusted(middle.newest_reading) && !IsTrusted(newest.newest_reading);
    if (newest.newest_reading - first.newest_reading < kFixesApart && !is_newest_trusted) {
      past_.erase(WorthOf(first) < WorthOf(middle) ? count - 2 : count - 1);
    }
  }
  if (past_.full()) past_.erase(0);
  past_.push_back(newest);
}

// May it be used, and how many prisms check each other; one alone has not even a heading of its
// own.
std::pair<bool, int> RearTracker::WorthOf(const PastFix& past) const {
  return {IsTrusted(past.newest_reading), past.fix.prisms_used};
}

std::optional<HeadingFix> RearTracker::EarlierHeading(Timestamp at) const {
  for (std::size_t i = past_.size(); i-- > 0;) {
    const PastFix& past = past_[i];
    const double age_s = SecondsBetween(past.newest_reading, at);
    if (!past.has_own_heading || !IsTrusted(past.newest_reading)) continue;
    if (age_s < 0.0 || age_s > machine_.station.stale_after_s) return {};
    const Rigid3& site_from_rear = past.fix.site_from_rear_shield;
    const double variance = CovarianceOfAttitude({site_from_rear, past.fix.covariance})(0, 0);
    const double turned_rad = machine_.coast.turn_rad_per_s * age_s;
    return HeadingFix{HeadingOf(site_from_rear), std::sqrt(variance + turned_rad * turned_rad)};
  }
  return {};
}

const RearShieldFix* RearTracker::fix() const {
  for (std::size_t i = past_.size(); i-- > 0;) {
    if (IsTrusted(past_[i].newest_reading)) return &past_[i].fix;
  }
  return nullptr;
}

void RearTracker::Forget() {
  past_.clear();
  for (Kept& kept : kept_) kept.is_there = false;
  trouble_ = set_up_number() == 0 ? GuidanceReason::kNoSetUp : GuidanceReason::kNoFix;
}

}  // namespace tbm
