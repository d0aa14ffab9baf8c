#include "guidance/app/guidance_step.h"

#include <fmt/format.h>

namespace tbm {
namespace {

constexpr Duration kAlarmPeriod = std::chrono::seconds(1);
constexpr std::size_t kMostInputs = 1024;  // room taken at the start

dds::Severity SeverityOf(AlarmPriority priority) {
  return priority == AlarmPriority::kLow ? dds::Severity::kWarning : dds::Severity::kAlarm;
}

bool IsActive(AlarmState state) {
  return state == AlarmState::kUnacknowledged || state == AlarmState::kAcknowledged;
}

}  // namespace

GuidanceStep::GuidanceStep(const Machine& machine,
                           const Rig& rig,
                           const DesignAxis& axis,
                           const std::string& machine_sha256)
    : machine_(machine), core_(machine, rig, axis) {
  names_.machine_id = std::string_view(machine.machine_id);
  names_.axis_name = std::string_view(axis.name());
  names_.axis_sha256 = std::string_view(axis.file_sha256());
  names_.machine_sha256 = std::string_view(machine_sha256);
  names_.steer_by = machine.points[machine.steer_by].name;
  inputs_.reserve(kMostInputs);
  output_.alarms.reserve(kGuidanceAlarmCount);
  output_.events.reserve(kGuidanceAlarmCount);
}

bool GuidanceStep::Take(const GuidanceMessage& message) {
  const auto is_ours = [&](const auto& one) { return one.machine_id == names_.machine_id; };
  if (!std::visit(is_ours, message)) return false;
  if (const auto* command = std::get_if<dds::Command>(&message)) {
    if (command->addressee.view() == kGuidanceSource) commands_.push_back(*command);
    return true;
  }
  std::optional<GuidanceInput> input;
  if (const auto* pose = std::get_if<dds::RelativePose>(&message)) {
    input = InputOf(*pose);
  } else if (const auto* tilt = std::get_if<dds::TiltReading>(&message)) {
    input = InputOf(*tilt);
  } else if (const auto* observation = std::get_if<dds::StationObservation>(&message)) {
    input = InputOf(*observation, machine_);
  } else if (const auto* set_up = std::get_if<dds::StationSetUp>(&message)) {
    input = InputOf(*set_up);
  }
  if (input) inputs_.push_back(*input);
  return true;
}

const GuidanceStep::Output& GuidanceStep::Step(Timestamp now) {
  output_.alarms.clear();
  output_.events.clear();
  output_.replies.clear();
  for (const dds::Command& command : commands_) Obey(command, now);
  commands_.clear();
  const Snapshot& snapshot = core_.Advance(inputs_, now);
  inputs_.clear();
  ++step_number_;
  output_.rear = PoseMessageOf(snapshot, ShieldName::kRear, names_);
  output_.front = PoseMessageOf(snapshot, ShieldName::kFront, names_);
  FillGuidance(snapshot, machine_, names_, &output_.guidance);
  for (dds::ShieldPose* pose : {&output_.rear, &output_.front}) {
    pose->sample_number = step_number_;
    pose->published_at = now;
  }
  output_.guidance.sample_number = step_number_;
  output_.guidance.published_at = now;
  ListAlarms(now);
  return output_;
}

void GuidanceStep::ListAlarms(Timestamp now) {
  const bool all = !all_told_at_ || now - *all_told_at_ >= kAlarmPeriod || now < *all_told_at_;
  if (all) all_told_at_ = now;
  for (std::size_t i = 0; i < kGuidanceAlarmCount; ++i) {
    const Alarm& alarm = core_.alarms().alarm(i);
    const GuidanceAlarmRule& rule = core_.alarm_rules()[i];
    const bool changed = alarm.state != told_[i];
    if (!changed && !all) continue;
    if (alarm.state == AlarmState::kUnacknowledged) acknowledged_by_[i] = {};
    dds::AlarmStatus status = AlarmMessageOf(rule, alarm, names_);
    status.published_at = now;
    status.acknowledged_by = acknowledged_by_[i];
    output_.alarms.push_back(status);
    if (IsActive(alarm.state) != IsActive(told_[i])) {
      dds::Event event;
      event.machine_id = names_.machine_id;
      event.source = kGuidanceSource;
      event.code = rule.rule.code;
      event.at = now;
      event.sample_number = ++event_number_;
      event.severity = SeverityOf(rule.rule.priority);
      event.active = IsActive(alarm.state);
      event.text = rule.rule.cause;
      output_.events.push_back(event);
    }
    told_[i] = alarm.state;
  }
}

void GuidanceStep::Obey(const dds::Command& command, Timestamp now) {
  using enum dds::CommandOutcome;
  if (now > command.expires_at) return Reply(command, kRefused, "it came too late", now);
  if (command.verb.view() != "acknowledge") {
    return Reply(command, kRefused, "the guidance knows the verb acknowledge, with a code", now);
  }
  const auto rule = core_.alarms().Find(command.argument.view());
  if (!rule) {
    return Reply(
        command, kRefused, fmt::format("no alarm has the code '{}'", command.argument.view()), now);
  }
  const AlarmState state = core_.alarms().alarm(*rule).state;
  if (state != AlarmState::kUnacknowledged && state != AlarmState::kReturnedUnacknowledged) {
    return Reply(command, kRefused, "there is nothing to acknowledge", now);
  }
  inputs_.push_back(AlarmAnswered{*rule});
  acknowledged_by_[*rule] = command.by;
  Reply(command, kDone, "acknowledged", now);
}

void GuidanceStep::Reply(const dds::Command& command,
                         dds::CommandOutcome outcome,
                         const std::string& text,
                         Timestamp now) {
  dds::CommandReply reply;
  reply.machine_id = names_.machine_id;
  reply.request_id = command.request_id;
  reply.source = kGuidanceSource;
  reply.outcome = outcome;
  reply.text = std::string_view(text);
  reply.published_at = now;
  output_.replies.push_back(reply);
}

}  // namespace tbm
