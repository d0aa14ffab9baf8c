#include "hmi_bridge/core/own_alarms.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "guidance/core/alarm_command.h"

namespace tbm::hmi {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view kSource = "hmi_bridge";

struct ConsoleRule {
  ConsoleAlarm alarm;
  std::string_view code;
  AlarmPriority urgency;
  Duration raise_after;
  std::string_view cause;
  std::string_view response;
};

// In the order of ConsoleAlarm.
constexpr std::array<ConsoleRule, kConsoleAlarmCount> kRules{{
    {ConsoleAlarm::kGuidanceSilent,
     "guidance_silent",
     AlarmPriority::kHigh,
     1s,
     "The guidance says nothing: there is no deviation.",
     "Stop steering by this screen. See whether the program guidance runs and its computer is on."},
    {ConsoleAlarm::kCameraBoxSilent,
     "camera_box_silent",
     AlarmPriority::kMedium,
     2s,
     "The camera box says nothing.",
     "See whether the box has power and its cable is in."},
    {ConsoleAlarm::kTotalStationSilent,
     "total_station_silent",
     AlarmPriority::kMedium,
     2s,
     "The total station's process says nothing.",
     "See whether the program total_station runs; call the surveyor."},
    {ConsoleAlarm::kNoNetwork,
     "no_network",
     AlarmPriority::kHigh,
     1s,
     "The console's computer has no network: nothing can come.",
     "See whether its network cable is in; the address must be the one of its configuration."},
    {ConsoleAlarm::kOtherMachineFile,
     "other_machine_file",
     AlarmPriority::kMedium,
     2s,
     "Guidance was started with another machine file than the console.",
     "Call the surveyor: limits and design on this screen may not be those of the guidance."},
    {ConsoleAlarm::kClockDisagrees,
     "clock_disagrees",
     AlarmPriority::kMedium,
     5s,
     "The stamps of the guidance and the clock of the console's computer disagree.",
     "Have both clocks set by the same time server; until then values look stale."},
    {ConsoleAlarm::kSecondWriter,
     "second_writer",
     AlarmPriority::kHigh,
     0s,
     "Two programs send the same topic: which of them is right is not known.",
     "End the one that does not belong here."},
    {ConsoleAlarm::kInterfaceMismatch,
     "interface_mismatch",
     AlarmPriority::kMedium,
     0s,
     "A program of another version is on the network; what it sends is refused.",
     "Bring all programs to the same version."},
    {ConsoleAlarm::kIncompatibleQos,
     "incompatible_qos",
     AlarmPriority::kLow,
     0s,
     "A program on the network asks for what is not offered.",
     "Tell the integrator."},
    {ConsoleAlarm::kSampleRejected,
     "sample_rejected",
     AlarmPriority::kMedium,
     0s,
     "Something was sent that breaks the contract, and was refused.",
     "Tell the integrator."},
    {ConsoleAlarm::kCalibrationDue,
     "calibration_due",
     AlarmPriority::kLow,
     0s,
     "A calibration is due:",
     "Call the surveyor; the new day goes into hmi_bridge.yaml."},
    {ConsoleAlarm::kDdsStartFailed,
     "dds_start_failed",
     AlarmPriority::kHigh,
     0s,
     "The console cannot take part in the network's traffic; it tries again.",
     "Tell the integrator."},
    {ConsoleAlarm::kTooManyEvents,
     "too_many_events",
     AlarmPriority::kMedium,
     0s,
     "More events stand than the console keeps; the first of the others:",
     "Answer those that are over; see the journal for the others."},
}};

std::string KeyOf(std::string_view source, std::string_view code) {
  std::string key(source);
  key += '/';
  key += code;
  return key;
}

AlarmPriority UrgencyOf(dds::Severity severity) {
  return severity == dds::Severity::kAlarm ? AlarmPriority::kMedium : AlarmPriority::kLow;
}

bool IsQuietEvent(const std::pair<const std::string, std::unique_ptr<OwnAlarms::Entry>>& place) {
  const OwnAlarms::Entry& entry = *place.second;
  return entry.is_event && entry.alarm().state == AlarmState::kNormal &&
         !entry.alarm().shelved_until;
}

// Text of others stays within its quotes and its line.
std::string OfOneLine(std::string text) {
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f || c == '"') c = '?';
  }
  return text;
}

AlarmBoard BoardOf(const AlarmRule& rule) { return AlarmBoard(std::span(&rule, 1)); }

}  // namespace

std::string_view CodeOf(ConsoleAlarm alarm) { return kRules[static_cast<std::size_t>(alarm)].code; }

OwnAlarms::OwnAlarms() {
  for (const ConsoleRule& rule : kRules) {
    auto entry = std::make_unique<Entry>(Entry{
        .source = std::string(kSource),
        .code = std::string(rule.code),
        .cause = std::string(rule.cause),
        .response = std::string(rule.response),
        .board = BoardOf({.code = rule.code,
                          .priority = rule.urgency,
                          .cause = rule.cause,
                          .response = rule.response,
                          .raise_after = rule.raise_after}),
    });
    entries_.emplace(KeyOf(kSource, rule.code), std::move(entry));
  }
}

// The rule's texts are those of the entry, whose address stands.
OwnAlarms::Entry& OwnAlarms::NewEntry(std::string source, std::string code, AlarmPriority urgency) {
  const std::string key = KeyOf(source, code);
  auto entry = std::make_unique<Entry>(Entry{.source = std::move(source),
                                             .code = std::move(code),
                                             .is_event = true,
                                             .board = BoardOf({})});
  entry->board = BoardOf({.code = entry->code, .priority = urgency, .cause = {}, .response = {}});
  return *entries_.emplace(key, std::move(entry)).first->second;
}

bool OwnAlarms::HasRoom() const {
  return entries_.size() < kMostEvents + kConsoleAlarmCount ||
         std::any_of(entries_.begin(), entries_.end(), IsQuietEvent);
}

void OwnAlarms::MakeRoom() {
  if (entries_.size() < kMostEvents + kConsoleAlarmCount) return;
  entries_.erase(std::find_if(entries_.begin(), entries_.end(), IsQuietEvent));
}

void OwnAlarms::Add(const dds::Event& event, Timestamp now) {
  const std::string key = KeyOf(event.source.view(), event.code.view());
  auto found = entries_.find(key);
  const bool raises = event.active && event.severity != dds::Severity::kInfo;
  if (found == entries_.end()) {
    if (!raises) return;
    if (!HasRoom()) {
      Set(ConsoleAlarm::kTooManyEvents, true, key);
      return;
    }
    MakeRoom();
    NewEntry(std::string(event.source.view()),
             std::string(event.code.view()),
             UrgencyOf(event.severity));
    found = entries_.find(key);
  }
  Entry& entry = *found->second;
  if (!entry.is_event) return;
  if (event.active) entry.cause = std::string(event.text.view());
  entry.event_at = event.at;
  entry.value = event.active ? 1.0 : 0.0;
  if (event.active && entry.alarm().state == AlarmState::kNormal) entry.acknowledged_by.clear();
  if (entry.board.Update(0, entry.value, now) && event.active) entry.raised_event_at = event.at;
  const auto answer = answers_.find(key);
  if (answer != answers_.end() && event.at <= answer->second.event_at) {
    entry.board.Acknowledge(0, now);
    entry.acknowledged_by = answer->second.by;
  }
}

void OwnAlarms::Forget(std::string_view source, std::string_view code) {
  const auto found = entries_.find(KeyOf(source, code));
  if (found != entries_.end() && found->second->is_event) entries_.erase(found);
}

void OwnAlarms::Set(ConsoleAlarm alarm, std::optional<bool> holds, std::string_view detail) {
  const ConsoleRule& rule = kRules[static_cast<std::size_t>(alarm)];
  Entry& entry = *entries_.at(KeyOf(kSource, rule.code));
  entry.value.reset();
  if (holds) entry.value = *holds ? 1.0 : 0.0;
  if (holds.value_or(false)) {
    entry.cause = std::string(rule.cause);
    if (!detail.empty()) entry.cause += " " + std::string(detail);
  }
}

bool OwnAlarms::Tick(Timestamp now) {
  bool changed = false;
  if (HasRoom()) Set(ConsoleAlarm::kTooManyEvents, false);
  for (auto& [key, entry] : entries_) {
    const AlarmState before = entry->alarm().state;
    const auto shelf_before = entry->alarm().shelved_until;
    entry->board.Update(0, entry->value, now);
    if (before != entry->alarm().state) {
      changed = true;
      if (!entry->alarm().is_active() || entry->alarm().is_unanswered()) {
        entry->acknowledged_by.clear();
      }
    }
    if (shelf_before && !entry->alarm().shelved_until) {
      changed = true;
      entry->shelved_by.clear();
      entry->shelved_because.clear();
    }
  }
  return changed;
}

std::vector<std::string> OwnAlarms::TakeNews() {
  std::vector<std::string> lines;
  for (auto& [key, entry] : entries_) {
    const AlarmState state = entry->alarm().state;
    if (state == entry->logged_state) continue;
    entry->logged_state = state;
    lines.push_back(
        fmt::format("source=hmi_bridge code=alarm alarm={} state={} by=\"{}\" text=\"{}\"",
                    OfOneLine(key),
                    StateCode(state),
                    OfOneLine(entry->acknowledged_by),
                    OfOneLine(entry->cause)));
  }
  return lines;
}

Result<std::string, std::string> OwnAlarms::Obey(std::string_view verb,
                                                 std::string_view argument,
                                                 std::string_view by,
                                                 std::string_view because,
                                                 Timestamp now) {
  const std::string_view key = argument.substr(0, argument.find(' '));
  const auto found = entries_.find(std::string(key));
  if (found == entries_.end()) {
    return Failure{"There is no alarm '" + std::string(key) + "' of the console's own."};
  }
  Entry& entry = *found->second;
  std::string of_board = entry.code;
  of_board += argument.substr(key.size());
  const auto order = AlarmOrderOf(entry.board, verb, of_board, because);
  if (!order) return Failure{order.error()};
  Carry(*order, now, &entry.board);
  switch (order->verb) {
    case AlarmVerb::kAcknowledge:
      entry.acknowledged_by = std::string(by);
      if (entry.is_event) answers_[found->first] = {entry.event_at, std::string(by)};
      break;
    case AlarmVerb::kShelve:
      entry.shelved_by = std::string(by);
      entry.shelved_because = std::string(because);
      break;
    case AlarmVerb::kUnshelve:
      entry.shelved_by.clear();
      entry.shelved_because.clear();
      break;
  }
  return DoneText(*order);
}

}  // namespace tbm::hmi
