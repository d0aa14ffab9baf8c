#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "pose/base/fixed_vector.h"
#include "pose/base/time.h"

namespace tbm {

// Alarms in the words of ISA-18.2: an alarm is something the operator must answer.

// How soon. Few are urgent, or none is.
enum class AlarmPriority { kLow, kMedium, kHigh };

enum class AlarmState {
  kNormal,
  kUnacknowledged,          // active, nobody has answered
  kAcknowledged,            // active, somebody has
  kReturnedUnacknowledged,  // the cause is gone, and nobody has seen that it was there
};

// "normal", "unacknowledged", "acknowledged", "returned_unacknowledged".
std::string_view StateCode(AlarmState state);

// When an alarm is raised and what it says. Texts outlive the board.
struct AlarmRule {
  std::string_view code;  // append only: stands in journals, e.g. "front_deviation_high"
  AlarmPriority priority = AlarmPriority::kMedium;
  std::string_view cause;     // what is wrong, for who reads it at four in the morning
  std::string_view response;  // what to do now
  // Raised above the one, cleared below the other: between them it stays as it is. A condition
  // that holds or does not is the value 1 or 0 with the limits 0.5 and 0.5.
  double raise_above = 0.5;
  double clear_below = 0.5;
  // The value must lie beyond its limit for so long.
  Duration raise_after{};
  Duration clear_after{};
};

struct Alarm {
  AlarmState state = AlarmState::kNormal;
  Timestamp since;                 // of the present state
  Timestamp raised_at;             // the last time it was raised
  std::uint64_t raise_number = 0;  // order over all alarms: the lowest standing one came first
  std::uint32_t times_raised = 0;
  std::optional<double> value;  // the last one that was there
  // Not to be shown or sounded before this; empty: not shelved. It hides the alarm and does nothing
  // else: state, order and counts go on underneath.
  std::optional<Timestamp> shelved_until;

  bool is_active() const {
    return state == AlarmState::kUnacknowledged || state == AlarmState::kAcknowledged;
  }
  bool is_unanswered() const {
    return state == AlarmState::kUnacknowledged || state == AlarmState::kReturnedUnacknowledged;
  }
};

// All alarms of a process, one for each rule. Pure: the same updates give the same states.
class AlarmBoard {
 public:
  static constexpr std::size_t kMostAlarms = 64;

  // A shelf ends by itself: what is put away for longer is a fault of the plant or of the rule, and
  // is mended there. Nobody puts an urgent alarm away for a whole shift.
  static constexpr Duration LongestShelf(AlarmPriority priority) {
    return priority == AlarmPriority::kHigh ? std::chrono::minutes(30) : std::chrono::hours(8);
  }

  // At most kMostAlarms rules with clear_below <= raise_above; anything else is our mistake.
  explicit AlarmBoard(std::span<const AlarmRule> rules);

  // Tells the value that rule `index` watches. Without a value (or with one that is no number)
  // nothing is known: no alarm is raised and none is cleared. True when the state changed. Also
  // ends a shelf whose time is over, or that was begun under a clock that has been set back since:
  // more would remain of it than was asked for.
  bool Update(std::size_t index, std::optional<double> value, Timestamp now);

  // True when there was something to acknowledge.
  bool Acknowledge(std::size_t index, Timestamp now);

  // Puts the alarm away, whatever its state, or changes until when it is. False, and nothing has
  // changed, unless `until` is after `now` by at most LongestShelf.
  bool Shelve(std::size_t index, Timestamp until, Timestamp now);
  // True when it was shelved.
  bool Unshelve(std::size_t index);

  std::size_t size() const { return rules_.size(); }
  const AlarmRule& rule(std::size_t index) const { return rules_[index]; }
  const Alarm& alarm(std::size_t index) const { return alarms_[index]; }
  // The rule with this code; empty when there is none.
  std::optional<std::size_t> Find(std::string_view code) const;

  // Of those that stand (not kNormal) the one that was raised first: most often the cause of the
  // others. A shelved one too: that nobody looks at it does not make the next one the cause.
  std::optional<std::size_t> FirstOut() const;

 private:
  void Enter(Alarm& alarm, AlarmState state, Timestamp now);

  FixedVector<AlarmRule, kMostAlarms> rules_;
  FixedVector<Alarm, kMostAlarms> alarms_;
  // Since when the value asks for the other state.
  FixedVector<std::optional<Timestamp>, kMostAlarms> asked_since_;
  FixedVector<Timestamp, kMostAlarms> shelved_at_;
  std::uint64_t raised_ = 0;
};

}  // namespace tbm
