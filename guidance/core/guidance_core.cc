#include "guidance/core/guidance_core.h"

#include <algorithm>
#include <cmath>

#include "guidance/shield/front_shield.h"

namespace tbm {
namespace {

FixedVector<AlarmRule, kGuidanceAlarmCount> Plain(
    const std::array<GuidanceAlarmRule, kGuidanceAlarmCount>& rules) {
  FixedVector<AlarmRule, kGuidanceAlarmCount> plain;
  for (const GuidanceAlarmRule& rule : rules) plain.push_back(rule.rule);
  return plain;
}
AlarmBoard BoardOf(const std::array<GuidanceAlarmRule, kGuidanceAlarmCount>& rules) {
  const auto plain = Plain(rules);
  return AlarmBoard({plain.data(), plain.size()});
}

GuidanceReason ReasonOf(AxisFailure failure) {
  switch (failure) {
    case AxisFailure::kBeforeStart:
      return GuidanceReason::kBeforeStart;
    case AxisFailure::kBeyondEnd:
      return GuidanceReason::kBeyondEnd;
    case AxisFailure::kAmbiguous:
      return GuidanceReason::kAmbiguousChainage;
    case AxisFailure::kTooFar:
    case AxisFailure::kNotFinite:
    case AxisFailure::kNoProfile:
      return GuidanceReason::kTooFarFromAxis;
  }
  return GuidanceReason::kTooFarFromAxis;
}

FreshnessLimits LimitsOf(const SourceLimits& limits) {
  return {limits.period_s, limits.stale_after_s, 0.0};
}

SourceState StateOf(std::optional<Timestamp> newest, Timestamp now, const SourceLimits& limits) {
  SourceState state;
  if (newest) state.age_s = SecondsBetween(*newest, now);
  state.freshness = FreshnessOf(state.age_s, 0.0, LimitsOf(limits));
  return state;
}

bool IsUsable(const SourceState& source) {
  return source.freshness == Freshness::kFresh || source.freshness == Freshness::kCoasting;
}

// Attitude and the rest of a shield that has a pose.
ShieldState Stated(const UncertainRigid3& site_from_shield, double age_s, GuidanceReason reason) {
  ShieldState state;
  state.worth = reason == GuidanceReason::kNone ? Worth::kValid : Worth::kDegraded;
  state.reason = reason;
  state.age_s = age_s;
  state.site_from_shield = site_from_shield;
  state.attitude = AttitudeOf(site_from_shield.b_from_a);
  state.attitude_covariance = CovarianceOfAttitude(site_from_shield);
  return state;
}
ShieldState Without(GuidanceReason reason) {
  ShieldState state;
  state.reason = reason;
  return state;
}

}  // namespace

GuidanceCore::GuidanceCore(const Machine& machine, const Rig& rig, const DesignAxis& axis)
    : machine_(machine),
      rig_(rig),
      axis_(axis),
      rules_(GuidanceAlarmRules(machine)),
      alarms_(BoardOf(rules_)),
      rear_(machine, rig) {
  TBM_CHECK(machine.prisms.size() <= kMaxPrisms && machine.points.size() <= kMaxGuidedPoints);
  TBM_CHECK(machine.steer_by < machine.points.size());
  for (std::size_t i = 0; i < machine.points.size(); ++i) {
    tracks_.push_back({Track(machine.track), Track(machine.track), {}});
  }
}

const Snapshot& GuidanceCore::Advance(std::span<const GuidanceInput> inputs, Timestamp now) {
  if (last_now_ && now < *last_now_ - kClockSetBack) Forget();
  last_now_ = now;
  for (const GuidanceInput& input : inputs) {
    std::visit([this](const auto& one) { Take(one); }, input);
  }
  if (rear_.quarantines() != quarantines_) GiveUpWhatWasTakenBack();
  snapshot_.at = now;
  WatchSources();
  const bool has_exposure = snapshot_.camera.freshness == Freshness::kFresh;
  snapshot_.valid_at = has_exposure ? relative_->sensed_at : now;
  PlaceRear();
  PlaceFront();
  PlaceJoint();
  PlacePoints();
  LookAhead();
  UpdateAlarms(snapshot_, machine_, axis_.end().m, alarms_);
  return snapshot_;
}

void GuidanceCore::Take(const PrismSeen& seen) { rear_.Add(seen, camera_tilt_, joint_); }
void GuidanceCore::Take(const SetUpKnown& set_up) { rear_.Add(set_up, camera_tilt_, joint_); }

void GuidanceCore::Take(const RelativeSeen& seen) {
  snapshot_.camera_trouble = seen.reason;
  if (seen.status == PoseStatus::kNone) return;
  if (relative_ && seen.sensed_at <= relative_->sensed_at) return;  // late or doubled
  relative_ = seen;
  front_then_.reset();
  joint_.Add(seen.sensed_at, RearFromFront().b_from_a.translation.x());
}

void GuidanceCore::Take(const TiltSeen& seen) {
  if (!seen.inclination) return;
  TiltMean& mean = seen.place == TiltPlace::kTarget ? target_tilt_ : camera_tilt_;
  mean.Add(seen.sensed_at, *seen.inclination);
}

void GuidanceCore::Take(const AlarmOrder& order) { Carry(order, *last_now_, &alarms_); }

void GuidanceCore::Forget() {
  rear_.Forget();
  relative_.reset();
  front_then_.reset();
  target_tilt_.Forget();
  camera_tilt_.Forget();
  joint_.Forget();
}

// Which of the looks of a track came from readings that are not trusted any more nobody has written
// down: all of them go.
void GuidanceCore::GiveUpWhatWasTakenBack() {
  quarantines_ = rear_.quarantines();
  front_then_.reset();
  for (PointTrack& track : tracks_) {
    track.right = Track(machine_.track);
    track.up = Track(machine_.track);
  }
}

void GuidanceCore::WatchSources() {
  const Timestamp now = snapshot_.at;
  const RearShieldFix* fix = rear_.fix();
  std::optional<Timestamp> fixed_at;
  std::optional<Timestamp> exposed_at;
  if (fix != nullptr) fixed_at = fix->at;
  if (relative_) exposed_at = relative_->sensed_at;
  snapshot_.station = StateOf(fixed_at, now, machine_.station);
  snapshot_.camera = StateOf(exposed_at, now, machine_.camera);
  snapshot_.target_tilt = StateOf(target_tilt_.newest(), now, machine_.tilt);
  snapshot_.camera_tilt = StateOf(camera_tilt_.newest(), now, machine_.tilt);
  snapshot_.set_up_number = rear_.set_up_number();
  snapshot_.fix.reset();
  if (fix != nullptr) snapshot_.fix = *fix;
  snapshot_.fix_trouble = rear_.IsSuspect() ? GuidanceReason::kSetUpSuspect : rear_.trouble();
}

void GuidanceCore::PlaceRear() {
  const RearShieldFix* fix = rear_.fix();
  const SourceState& station = snapshot_.station;
  if (fix == nullptr || !IsUsable(station)) {
    GuidanceReason reason = GuidanceReason::kStationStale;
    if (rear_.IsSuspect()) {
      reason = GuidanceReason::kSetUpSuspect;
    } else if (fix == nullptr) {
      reason = rear_.trouble() == GuidanceReason::kNone ? GuidanceReason::kNoFix : rear_.trouble();
    }
    snapshot_.rear = Without(reason);
    return;
  }
  GuidanceReason reason = GuidanceReason::kNone;
  if (station.freshness == Freshness::kCoasting) reason = GuidanceReason::kStationCoasting;
  if (fix->dof <= 1) reason = GuidanceReason::kFewPrisms;
  if (fix->exchanged) reason = GuidanceReason::kPrismsExchanged;
  if (fix->left_out) reason = GuidanceReason::kPrismLeftOut;
  if (rear_.IsSuspect()) reason = GuidanceReason::kSetUpSuspect;
  snapshot_.rear = Stated(RearAt(*fix, snapshot_.valid_at), *station.age_s, reason);
  snapshot_.rear.speed_m_per_s = fix->speed_m_per_s;
  snapshot_.rear.speed_sigma_m_per_s = fix->speed_sigma_m_per_s;
}

// The last fix, grown old by the coasting law; pulled after the front shield by what the joint has
// closed since, going about where it points. Where nobody watches the joint, a regrip may have
// taken place at any time.
UncertainRigid3 GuidanceCore::RearAt(const RearShieldFix& fix, Timestamp when) const {
  const double age_s = std::max(SecondsBetween(fix.at, when), 0.0);
  UncertainRigid3 now = Coasted({fix.site_from_rear_shield, fix.covariance},
                                fix.speed_m_per_s,
                                fix.speed_sigma_m_per_s,
                                age_s,
                                machine_.coast);
  const std::optional<double> closed_m = joint_.Between(fix.at, when);
  const Eigen::Matrix3d turned = now.b_from_a.rotation.toRotationMatrix();
  Eigen::Vector3d sigma_m(RegripSigma(age_s), 0.0, 0.0);
  double turn_rad2 = 0.0;
  if (closed_m) {
    now.b_from_a.translation += turned.col(0) * *closed_m;
    const double across_m = machine_.track.crab_sigma_per_m * *closed_m;
    const double along_m =
        std::hypot(ClosingSigma(*closed_m), UnwatchedSigma(joint_, fix.at, when));
    sigma_m = {along_m, across_m, across_m};
    const double steering = machine_.track.steering_per_sqrt_m;
    turn_rad2 = steering * steering * *closed_m;
  }
  now.covariance.topLeftCorner<3, 3>().diagonal().array() += turn_rad2;
  now.covariance.bottomRightCorner<3, 3>() +=
      turned * sigma_m.cwiseAbs2().asDiagonal() * turned.transpose();
  return now;
}

UncertainRigid3 GuidanceCore::RearFromFront() const {
  return machine_.geometry.rear_shield_from_camera * relative_->camera_from_target *
         Inverse(machine_.geometry.front_shield_from_target);
}

RelativeFix GuidanceCore::RelativeWithTilts() const {
  RelativeFix relative{relative_->camera_from_target, {}, {}};
  if (!relative_->tilts_used) return relative;
  const auto target = target_tilt_.Around(relative_->sensed_at);
  const auto camera = camera_tilt_.Around(relative_->sensed_at);
  if (target && camera) {
    relative.target_tilt = TiltObservation{target->inclination, rig_.target_tilt.sigma_rad};
    relative.camera_tilt = TiltObservation{camera->inclination, rig_.camera_tilt.sigma_rad};
  }
  return relative;
}

void GuidanceCore::PlaceFront() {
  const SourceState& camera = snapshot_.camera;
  if (!IsUsable(camera)) {
    snapshot_.front =
        Without(relative_ ? GuidanceReason::kCameraStale : GuidanceReason::kNoRelativePose);
    return;
  }
  if (camera.freshness == Freshness::kFresh) {
    if (snapshot_.rear.worth == Worth::kInvalid) {
      front_then_.reset();
      snapshot_.front = Without(snapshot_.rear.reason);
      return;
    }
    PlaceFrontThen(*rear_.fix());
    GuidanceReason reason = snapshot_.rear.reason;
    if (reason == GuidanceReason::kNone && relative_->status == PoseStatus::kDegraded) {
      reason = GuidanceReason::kCameraDegraded;
    }
    snapshot_.front = Stated(*front_then_, std::max(*camera.age_s, snapshot_.rear.age_s), reason);
  } else {
    CoastFront();
  }
}

// The front shield at the last relative pose, on the rear shield as this fix puts it there.
void GuidanceCore::PlaceFrontThen(const RearShieldFix& fix) {
  const UncertainRigid3 site_from_rear = RearAt(fix, relative_->sensed_at);
  RearShieldFix rear = fix;
  rear.site_from_rear_shield = site_from_rear.b_from_a;
  rear.covariance = site_from_rear.covariance;
  front_then_ = FrontShieldInSite(rear, rig_, machine_.geometry, RelativeWithTilts());
  front_rests_on_ = fix.at;
}

// The front shield coasts by itself from where it was seen last, whatever the rear one does.
void GuidanceCore::CoastFront() {
  const RearShieldFix* fix = rear_.fix();
  if (!front_then_ && fix != nullptr && fix->at <= relative_->sensed_at) PlaceFrontThen(*fix);
  if (!front_then_) {
    snapshot_.front =
        Without(snapshot_.rear.worth == Worth::kInvalid ? snapshot_.rear.reason
                                                        : GuidanceReason::kCameraStale);
    return;
  }
  const double rests_on_s = SecondsBetween(front_rests_on_, snapshot_.at);
  if (rests_on_s > machine_.station.stale_after_s) {
    snapshot_.front =
        Without(rear_.IsSuspect() ? GuidanceReason::kSetUpSuspect : GuidanceReason::kStationStale);
    return;
  }
  const double age_s = std::max(SecondsBetween(relative_->sensed_at, snapshot_.at), 0.0);
  snapshot_.front =
      Stated(Coasted(*front_then_, 0.0, 0.0, age_s, machine_.coast),
             std::max(age_s, rests_on_s),
             rear_.IsSuspect() ? GuidanceReason::kSetUpSuspect : GuidanceReason::kCameraCoasting);
}

void GuidanceCore::PlaceJoint() {
  snapshot_.joint.reset();
  if (snapshot_.camera.freshness != Freshness::kFresh) return;
  const UncertainRigid3 rear_from_front = RearFromFront();
  JointState joint;
  joint.articulation = ArticulationOf(rear_from_front.b_from_a);
  joint.articulation_covariance = CovarianceOfArticulation(rear_from_front);
  if (machine_.closed_joint_m) {
    joint.stroke_m = rear_from_front.b_from_a.translation.x() - *machine_.closed_joint_m;
    joint.stroke_sigma_m = std::sqrt(rear_from_front.covariance(3, 3));
  }
  snapshot_.joint = joint;
}

void GuidanceCore::PlacePoints() {
  snapshot_.points.resize(machine_.points.size());
  for (std::size_t i = 0; i < machine_.points.size(); ++i) PlacePoint(i);
  snapshot_.lead.reset();
  if (snapshot_.front.worth != Worth::kInvalid) {
    const auto lead =
        LeadOf(axis_, snapshot_.front.site_from_shield, tracks_[machine_.steer_by].hint);
    if (lead) snapshot_.lead = *lead;
  }
  snapshot_.ring_number.reset();
  if (machine_.rings && snapshot_.rear.worth != Worth::kInvalid) {
    const auto foot =
        axis_.Project(snapshot_.rear.site_from_shield.b_from_a.translation, rear_hint_);
    if (foot) {
      rear_hint_ = foot->chainage;
      const RingCount& rings = *machine_.rings;
      snapshot_.ring_number =
          rings.first_number + static_cast<std::int64_t>(std::floor(
                                   (foot->chainage.m - rings.first_chainage_m) / rings.length_m));
    }
  }
}

void GuidanceCore::PlacePoint(std::size_t index) {
  const MachinePoint& point = machine_.points[index];
  PointState& state = snapshot_.points[index];
  PointTrack& track = tracks_[index];
  const ShieldState& shield = point.shield == ShieldName::kFront ? snapshot_.front : snapshot_.rear;
  state = {};
  state.reason = shield.reason;
  if (shield.worth == Worth::kInvalid) return;
  const UncertainPoint in_shield{point.p_in_shield,
                                 Eigen::Matrix3d::Identity() * (point.sigma_m * point.sigma_m)};
  state.p_in_site = shield.site_from_shield * in_shield;
  const auto deviation = DeviationOf(axis_, state.p_in_site, track.hint);
  if (!deviation) {
    state.reason = ReasonOf(deviation.error());
    return;
  }
  const double sigma_m = std::max(deviation->right_sigma_m, deviation->up_sigma_m);
  if (!(sigma_m <= machine_.useful_sigma_m)) {
    state.reason = GuidanceReason::kSigmaTooLarge;
    return;
  }
  track.hint = deviation->chainage;
  state.deviation = *deviation;
  state.worth = shield.worth;
  // What coasts has not been looked at.
  if (shield.reason == GuidanceReason::kNone || shield.reason == GuidanceReason::kCameraDegraded) {
    std::optional<double> lead_right;
    std::optional<double> lead_up;
    double right_sigma = 0.0;
    double up_sigma = 0.0;
    if (const auto lead = LeadOf(axis_, shield.site_from_shield, track.hint)) {
      lead_right = lead->right_per_m;
      lead_up = lead->up_per_m;
      right_sigma = lead->right_sigma_per_m;
      up_sigma = lead->up_sigma_per_m;
    }
    track.right.Add({deviation->chainage, deviation->right_m, deviation->right_sigma_m},
                    lead_right,
                    right_sigma);
    if (deviation->up_m) {
      track.up.Add(
          {deviation->chainage, *deviation->up_m, deviation->up_sigma_m}, lead_up, up_sigma);
    }
  }
  state.trend_right = track.right.Over(machine_.trend_length_m);
  state.trend_up = track.up.Over(machine_.trend_length_m);
}

void GuidanceCore::LookAhead() {
  snapshot_.ahead.clear();
  const PointState& point = snapshot_.points[machine_.steer_by];
  if (point.worth == Worth::kInvalid) return;
  const PointTrack& track = tracks_[machine_.steer_by];
  for (int ahead_m = 1; ahead_m <= kPredictions; ++ahead_m) {
    AheadState ahead;
    ahead.ahead_m = ahead_m;
    const auto right = track.right.Ahead(ahead_m);
    if (!right) return;
    // What all looks have in common comes on top of what the path may do.
    ahead.right = {right->off_m, std::hypot(right->sigma_m, point.deviation.right_sigma_m)};
    if (const auto up = track.up.Ahead(ahead_m); up && point.deviation.up_m) {
      ahead.up = Prediction{up->off_m, std::hypot(up->sigma_m, point.deviation.up_sigma_m)};
    }
    snapshot_.ahead.push_back(ahead);
  }
}

}  // namespace tbm
