#pragma once

#include <optional>
#include <span>
#include <vector>

#include "guidance/axis/design_axis.h"
#include "guidance/core/alarm_board.h"
#include "guidance/core/guidance_alarms.h"
#include "guidance/core/input.h"
#include "guidance/core/joint_closing.h"
#include "guidance/core/machine.h"
#include "guidance/core/rear_tracker.h"
#include "guidance/core/snapshot.h"
#include "guidance/core/tilt_mean.h"
#include "guidance/shield/trend.h"
#include "pose/rig/rig.h"

namespace tbm {

// From what total station, camera box and inclinometers said to what the operator steers by.
//
// Pure: the same inputs at the same `now`s give the same snapshots, bit for bit; a journal of a
// shift replays. One thread; no heap after construction.
//
// How the numbers grow old. The rear shield rests on its last trusted fix, moved on by its speed
// and by what the telescopic joint has closed since; the front shield on that and the last relative
// pose. What a check of the references takes back is given up by everything that rests on it. Up to
// two periods of its source a pose is valid; then it coasts (guidance/shield/coast.h: sigma grows
// by a stated law) and says so; beyond `stale_after_s`, or when a deviation's sigma exceeds
// `useful_sigma_m`, it is invalid.
class GuidanceCore {
 public:
  // All three outlive the core.
  GuidanceCore(const Machine& machine, const Rig& rig, const DesignAxis& axis);

  // One step: takes what has come since the last one, in the order in which it came, and concludes.
  // `now` may stand still; one that is more than kClockSetBack before the last step's means that
  // the clock was set, and everything measured under the old one is forgotten.
  const Snapshot& Advance(std::span<const GuidanceInput> inputs, Timestamp now);

  const Snapshot& snapshot() const { return snapshot_; }
  const AlarmBoard& alarms() const { return alarms_; }
  const std::array<GuidanceAlarmRule, kGuidanceAlarmCount>& alarm_rules() const { return rules_; }

 private:
  struct PointTrack {
    Track right;
    Track up;
    std::optional<InternalChainage> hint;
  };

  void Take(const PrismSeen& seen);
  void Take(const SetUpKnown& set_up);
  void Take(const RelativeSeen& seen);
  void Take(const TiltSeen& seen);
  void Take(const AlarmOrder& order);
  void Forget();
  void GiveUpWhatWasTakenBack();
  void WatchSources();
  void PlaceRear();
  UncertainRigid3 RearAt(const RearShieldFix& fix, Timestamp when) const;
  UncertainRigid3 RearFromFront() const;
  void PlaceFront();
  void PlaceFrontThen(const RearShieldFix& fix);
  void CoastFront();
  void PlaceJoint();
  void PlacePoints();
  void PlacePoint(std::size_t index);
  void LookAhead();
  RelativeFix RelativeWithTilts() const;

  const Machine& machine_;
  const Rig& rig_;
  const DesignAxis& axis_;
  const std::array<GuidanceAlarmRule, kGuidanceAlarmCount> rules_;
  AlarmBoard alarms_;
  RearTracker rear_;
  TiltMean target_tilt_;
  TiltMean camera_tilt_;
  JointClosing joint_;
  std::optional<RelativeSeen> relative_;  // the last usable one
  // The front shield at that exposure, as long as the rear shield was known then.
  std::optional<UncertainRigid3> front_then_;
  Timestamp front_rests_on_;       // when the rear shield was fixed, under front_then_
  std::uint64_t quarantines_ = 0;  // of the rear shield's fixes, that have been followed
  std::optional<InternalChainage> rear_hint_;
  std::vector<PointTrack> tracks_;  // one for each point; its size never changes
  std::optional<Timestamp> last_now_;
  Snapshot snapshot_;
};

}  // namespace tbm
