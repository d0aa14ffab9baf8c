#include "guidance/core/alarm_board.h"

#include <cmath>

namespace tbm {

std::string_view StateCode(AlarmState state) {
  switch (state) {
    case AlarmState::kNormal:
      return "normal";
    case AlarmState::kUnacknowledged:
      return "unacknowledged";
    case AlarmState::kAcknowledged:
      return "acknowledged";
    case AlarmState::kReturnedUnacknowledged:
      return "returned_unacknowledged";
  }
  return "";
}

AlarmBoard::AlarmBoard(std::span<const AlarmRule> rules) {
  TBM_CHECK(rules.size() <= kMostAlarms);
  for (const AlarmRule& rule : rules) {
    TBM_CHECK(rule.clear_below <= rule.raise_above);
    rules_.push_back(rule);
  }
  alarms_.resize(rules.size());
  asked_since_.resize(rules.size());
  shelved_at_.resize(rules.size());
}

bool AlarmBoard::Update(std::size_t index, std::optional<double> value, Timestamp now) {
  const AlarmRule& rule = rules_[index];
  Alarm& alarm = alarms_[index];
  std::optional<Timestamp>& asked_since = asked_since_[index];
  if (alarm.shelved_until && (now >= *alarm.shelved_until || now < shelved_at_[index])) {
    alarm.shelved_until.reset();
  }
  if (!value || !std::isfinite(*value)) {
    asked_since.reset();
    return false;
  }
  alarm.value = value;
  const bool was_active = alarm.is_active();
  const bool asks = was_active ? *value < rule.clear_below : *value > rule.raise_above;
  if (!asks) {
    asked_since.reset();
    return false;
  }
  // A clock that was set back starts the wait again.
  if (!asked_since || *asked_since > now) asked_since = now;
  if (now - *asked_since < (was_active ? rule.clear_after : rule.raise_after)) return false;
  asked_since.reset();
  if (was_active) {
    Enter(alarm,
          alarm.state == AlarmState::kAcknowledged ? AlarmState::kNormal
                                                   : AlarmState::kReturnedUnacknowledged,
          now);
    return true;
  }
  Enter(alarm, AlarmState::kUnacknowledged, now);
  alarm.raised_at = now;
  alarm.raise_number = ++raised_;
  ++alarm.times_raised;
  return true;
}

bool AlarmBoard::Acknowledge(std::size_t index, Timestamp now) {
  Alarm& alarm = alarms_[index];
  if (alarm.state == AlarmState::kUnacknowledged) {
    Enter(alarm, AlarmState::kAcknowledged, now);
    return true;
  }
  if (alarm.state == AlarmState::kReturnedUnacknowledged) {
    Enter(alarm, AlarmState::kNormal, now);
    return true;
  }
  return false;
}

bool AlarmBoard::Shelve(std::size_t index, Timestamp until, Timestamp now) {
  if (until <= now || until - now > LongestShelf(rules_[index].priority)) return false;
  alarms_[index].shelved_until = until;
  shelved_at_[index] = now;
  return true;
}

bool AlarmBoard::Unshelve(std::size_t index) {
  const bool was_shelved = alarms_[index].shelved_until.has_value();
  alarms_[index].shelved_until.reset();
  return was_shelved;
}

std::optional<std::size_t> AlarmBoard::Find(std::string_view code) const {
  for (std::size_t i = 0; i < rules_.size(); ++i) {
    if (rules_[i].code == code) return i;
  }
  return {};
}

std::optional<std::size_t> AlarmBoard::FirstOut() const {
  std::optional<std::size_t> first;
  for (std::size_t i = 0; i < alarms_.size(); ++i) {
    if (alarms_[i].state == AlarmState::kNormal) continue;
    if (!first || alarms_[i].raise_number < alarms_[*first].raise_number) first = i;
  }
  return first;
}

void AlarmBoard::Enter(Alarm& alarm, AlarmState state, Timestamp now) {
  alarm.state = state;
  alarm.since = now;
}

}  // namespace tbm
