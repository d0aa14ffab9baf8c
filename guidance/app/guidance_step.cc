#include "guidance/app/guidance_step.h"

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
  ObeyAll(now);
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
    const bool changed = alarm.state != told_[i] || alarm.shelved_until != told_shelf_[i];
    if (!changed && !all) continue;
    if (alarm.state == AlarmState::kUnacknowledged) acknowledged_by_[i] = {};
    dds::AlarmStatus status = AlarmMessageOf(rule, alarm, names_);
    status.published_at = now;
    status.acknowledged_by = acknowledged_by_[i];
    if (alarm.shelved_until) {
      status.shelved_until = *alarm.shelved_until;
      status.shelved_by = shelved_by_[i].by;
      status.shelved_because = shelved_by_[i].because;
    }
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
    told_shelf_[i] = alarm.shelved_until;
  }
}

// The core carries the orders out with its other inputs. A command is judged on a board on which
// the ones before it are carried out already.
void GuidanceStep::ObeyAll(Timestamp now) {
  if (commands_.empty()) return;
  AlarmBoard board = core_.alarms();
  for (const dds::Command& command : commands_) Obey(command, now, &board);
  commands_.clear();
}

void GuidanceStep::Obey(const dds::Command& command, Timestamp now, AlarmBoard* board) {
  using enum dds::CommandOutcome;
  if (now > command.expires_at) return Reply(command, kRefused, "it came too late", now);
  const std::string_view verb = command.verb.view();
  if (!IsAlarmVerb(verb)) {
    return Reply(command, kRefused, "the guidance knows acknowledge, shelve and unshelve", now);
  }
  const auto order = AlarmOrderOf(*board, verb, command.argument.view(), command.because.view());
  if (!order) return Reply(command, kRefused, order.error(), now);
  Carry(*order, now, board);
  inputs_.push_back(*order);
  if (order->verb == AlarmVerb::kAcknowledge) acknowledged_by_[order->rule] = command.by;
  if (order->verb == AlarmVerb::kShelve) shelved_by_[order->rule] = command;
  Reply(command, kDone, DoneText(*order), now);
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
