#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "guidance/core/input.h"
#include "guidance/core/joint_closing.h"
#include "guidance/core/machine.h"
#include "guidance/core/reason.h"
#include "guidance/core/tilt_mean.h"
#include "guidance/shield/rear_shield.h"
#include "pose/base/fixed_vector.h"

namespace tbm {

// How well the closing of the joint says how far the rear shield has come: its dead band, and what
// the front shield may have slipped back.
double ClosingSigma(double closed_m);

// How far a regrip may have pulled the rear shield in a time in which nobody watched the joint.
double RegripSigma(double unwatched_s);
// The same for what lies behind the joint's last length between one moment and the other.
double UnwatchedSigma(const JointClosing& joint, Timestamp one, Timestamp other);

// The rear shield from what the total station sees, prism by prism: keeps the last reading of each
// prism, makes a fix with every new one, and remembers past fixes, because a check of the
// references may say later that the newest are not to be used. No heap.
class RearTracker {
 public:
  RearTracker(const Machine& machine, const Rig& rig) : machine_(machine), rig_(rig) {}

  void Add(const PrismSeen& seen, const TiltMean& camera_tilt, const JointClosing& joint);
  void Add(const SetUpKnown& set_up, const TiltMean& camera_tilt, const JointClosing& joint);

  // The newest fix that rests on nothing but trusted readings.
  const RearShieldFix* fix() const;
  // The station may have moved: readings after a moment are not to be used.
  bool IsSuspect() const { return set_up_ && set_up_->number != 0 && set_up_->trusted_until; }
  // How often fixes were taken back: whatever was made of them since is to be thought over.
  std::uint64_t quarantines() const { return quarantines_; }
  GuidanceReason trouble() const { return trouble_; }
  std::uint64_t set_up_number() const { return set_up_ ? set_up_->number : 0; }

  void Forget();  // everything but the set-up: the clock was set

 private:
  static constexpr std::size_t kMostFixes = 64;  // at least a quarter of an hour

  struct Kept {
    PrismSeen seen;
    bool is_there = false;
  };
  struct PastFix {
    RearShieldFix fix;
    Timestamp newest_reading;
    bool has_own_heading = true;  // not taken from an earlier fix
  };

  void Fix(const TiltMean& camera_tilt, const JointClosing& joint);
  std::optional<HeadingFix> EarlierHeading(Timestamp at) const;
  void Keep(const PastFix& newest);
  std::pair<bool, int> WorthOf(const PastFix& past) const;
  bool IsTrusted(Timestamp sensed_at) const;
  void DropDoubted(const SetUpKnown& set_up);

  const Machine& machine_;
  const Rig& rig_;
  std::array<Kept, kMaxPrisms> kept_{};
  std::optional<SetUpKnown> set_up_;
  std::optional<SetUpKnown> suspect_;      // the last one, until it is found good again
  FixedVector<PastFix, kMostFixes> past_;  // oldest first
  std::uint64_t quarantines_ = 0;
  GuidanceReason trouble_ = GuidanceReason::kNoSetUp;
};

}  // namespace tbm
