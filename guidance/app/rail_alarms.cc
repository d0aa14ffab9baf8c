#include "guidance/app/rail_alarms.h"

#include <utility>

#include <fmt/format.h>

#include "guidance/app/rail_words.h"
#include "guidance/core/alarm_command.h"

namespace tbm {
namespace {

// In the order of the enumeration.
const std::array<AlarmRule, kRailAlarmCount>& Rules() {
  static const std::array<AlarmRule, kRailAlarmCount> rules = {{
      {.code = "imu_silent",
       .priority = AlarmPriority::kHigh,
       .cause = "no samples of the inertial unit: the line has a gap here",
       .response = "let the trolley stand; cable, supply and setting of the unit"},
      {.code = "start_failed",
       .priority = AlarmPriority::kHigh,
       .cause = "the start of the run cannot be used",
       .response = "end the run, let the trolley rest as long as rail.yaml says, begin again"},
      {.code = "measurements_late",
       .priority = AlarmPriority::kLow,
       .cause = "measurements come later than lag_ms and are not used live",
       .response = "a longer lag_ms, or a faster computer; the finished line has them",
       .clear_after = std::chrono::seconds(60)},
      {.code = "run_not_written",
       .priority = AlarmPriority::kHigh,
       .cause = "what is measured does not reach the disk",
       .response = "room and rights of the folder `runs`"},
      {.code = "line_not_written",
       .priority = AlarmPriority::kHigh,
       .cause = "there is no line of this run",
       .response = "what stands in the text; then tbm line on the run's folder"},
      {.code = "settlement_found",
       .priority = AlarmPriority::kHigh,
       .cause = "the rail has moved by more than is allowed (settlement.alert_mm)",
       .response = "measure again; then as the monitoring plan says"},
      {.code = "calibration_due",
       .priority = AlarmPriority::kLow,
       .cause = "the trolley's calibration is older than calibration.due_after_days",
       .response = "calibrate the trolley and write the day down"},
      {.code = "clock_set",
       .priority = AlarmPriority::kMedium,
       .cause = "the computer's clock was set during the run",
       .response = "the run keeps its time; where a camera box finds targets, begin a new run"},
      {.code = "datum_shift",
       .priority = AlarmPriority::kMedium,
       .cause = "the whole line is higher or lower than the base: rather its targets than the rail",
       .response = "survey targets and start point again; then as the monitoring plan says"},
      {.code = "targets_silent",
       .priority = AlarmPriority::kMedium,
       .cause = "the camera box says nothing: the place drifts",
       .response = "power and cable of the box; is its machine_id the trolley's?",
       .raise_after = std::chrono::seconds(5)},
      {.code = "inclinometer_silent",
       .priority = AlarmPriority::kMedium,
       .cause = "the trolley's inclinometer says nothing",
       .response = "its cable, supply and address",
       .raise_after = std::chrono::seconds(5)},
      {.code = "measurements_lost",
       .priority = AlarmPriority::kMedium,
       .cause =
           "measurements are missing in the record: too late, twice, or more than it could take",
       .response = "clocks of the instruments, load of the computer; measure again"},
  }};
  return rules;
}

dds::Severity SeverityOf(AlarmPriority priority) {
  return priority == AlarmPriority::kLow ? dds::Severity::kWarning : dds::Severity::kAlarm;
}

}  // namespace

RailAlarms::RailAlarms(std::string_view machine_id) : machine_id_(machine_id), board_(Rules()) {}

void RailAlarms::Watch(RailAlarm alarm,
                       std::optional<double> value,
                       Timestamp now,
                       std::string what) {
  const auto index = static_cast<std::size_t>(alarm);
  if (!what.empty()) what_[index] = std::move(what);
  board_.Update(index, value, now);
}

Result<std::string, std::string> RailAlarms::Obey(const dds::Command& command, Timestamp now) {
  const auto order =
      AlarmOrderOf(board_, command.verb.view(), command.argument.view(), command.because.view());
  if (!order) return Failure{order.error()};
  Carry(*order, now, &board_);
  if (order->verb == AlarmVerb::kAcknowledge) acknowledged_by_[order->rule] = command.by;
  if (order->verb == AlarmVerb::kShelve) shelved_by_[order->rule] = command;
  return DoneText(*order);
}

RailAlarms::News RailAlarms::Take(bool all, Timestamp now) {
  News news;
  for (std::size_t i = 0; i < kRailAlarmCount; ++i) {
    const AlarmRule& rule = board_.rule(i);
    const Alarm& alarm = board_.alarm(i);
    const bool changed =
        alarm.state != told_[i].state || alarm.shelved_until != told_[i].shelved_until;
    if (!changed && !all) continue;
    if (alarm.state == AlarmState::kUnacknowledged) acknowledged_by_[i] = {};
    const std::string cause =
        what_[i].empty() ? std::string(rule.cause) : fmt::format("{}: {}", rule.cause, what_[i]);
    const bool fits = cause.size() <= decltype(dds::AlarmStatus::cause)::capacity();
    dds::AlarmStatus status;
    status.machine_id = machine_id_;
    status.source = kRailLineSource;
    status.code = rule.code;
    status.published_at = now;
    status.phase = static_cast<dds::AlarmPhase>(alarm.state);
    status.urgency = static_cast<dds::AlarmUrgency>(rule.priority);
    if (alarm.times_raised > 0) {
      status.since = alarm.since;
      status.raised_at = alarm.raised_at;
    }
    status.raise_number = alarm.raise_number;
    status.times_raised = alarm.times_raised;
    status.value = alarm.value.value_or(dds::kNaN);
    status.raise_above = rule.raise_above;
    status.clear_below = rule.clear_below;
    // The code says the rest.
    status.cause = std::string_view(fits ? cause : what_[i]);
    status.response = rule.response;
    status.acknowledged_by = acknowledged_by_[i];
    if (alarm.shelved_until) {
      status.shelved_until = *alarm.shelved_until;
      status.shelved_by = shelved_by_[i].by;
      status.shelved_because = shelved_by_[i].because;
    }
    news.alarms.push_back(status);
    if (alarm.is_active() != told_[i].is_active()) {
      dds::Event event;
      event.machine_id = machine_id_;
      event.source = kRailLineSource;
      event.code = rule.code;
      event.at = now;
      event.severity = SeverityOf(rule.priority);
      event.active = alarm.is_active();
      event.text = std::string_view(cause);
      news.events.push_back(event);
    }
    told_[i] = alarm;
  }
  return news;
}

}  // namespace tbm
