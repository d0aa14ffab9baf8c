#include "guidance/app/journal_replay.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "idl/cpp/codec.h"
#include "idl/cpp/topics.h"

namespace tbm {
namespace {

constexpr std::size_t kMostDifferences = 10;

template <class Message>
std::optional<Message> Decoded(BytesView data) {
  Message message;
  if (dds::DecodeCdr(data, &message) != dds::BoundaryFault::kNone) return {};
  return message;
}
template <class Message>
Bytes EncodedBytes(const Message& message) {
  Bytes bytes;
  dds::EncodeCdr(message, &bytes);
  return bytes;
}

bool IsInput(std::string_view topic) {
  return topic == dds::kRelativePoseTopic.name || topic == dds::kInclinationTopic.name ||
         topic == dds::kStationObservationTopic.name || topic == dds::kStationSetUpTopic.name ||
         topic == dds::kCommandTopic.name;
}

std::string Millimetres(double m) { return fmt::format("{:.4f} mm", 1e3 * m); }

}  // namespace

// One life of the process: its files, and the step it took last.
struct JournalReplay::Run {
  explicit Run(GuidedMachine read)
      : machine(std::move(read)),
        step(machine.machine, machine.rig, machine.axis, machine.machine_sha256) {}

  GuidedMachine machine;
  GuidanceStep step;
  const GuidanceStep::Output* output = nullptr;
  StepRecord record;
  std::size_t alarms_seen = 0;
};

JournalReplay::JournalReplay(std::optional<ReadFile> other_machine)
    : other_machine_(std::move(other_machine)) {}
JournalReplay::~JournalReplay() = default;

void JournalReplay::Take(const McapChannel& channel, const McapMessage& message) {
  const std::string_view topic = channel.topic;
  if (topic == kFileTopic) return TakeFile(message.data);
  if (topic == dds::kAlarmStatusTopic.name) {
    if (run_) CompareAlarm(message);  // several processes write this topic
    return;
  }
  const bool is_input = IsInput(topic);
  if (!IsNew(channel.topic, message.sequence, is_input)) return;
  if (topic == kStepTopic) return TakeStep(message.data);
  if (!run_) {
    if (is_input) ++report_.skipped;
    return;
  }
  if (topic == dds::kRelativePoseTopic.name) return TakeInput<dds::RelativePose>(message.data);
  if (topic == dds::kInclinationTopic.name) return TakeInput<dds::TiltReading>(message.data);
  if (topic == dds::kStationObservationTopic.name) {
    return TakeInput<dds::StationObservation>(message.data);
  }
  if (topic == dds::kStationSetUpTopic.name) return TakeInput<dds::StationSetUp>(message.data);
  if (topic == dds::kCommandTopic.name) return TakeInput<dds::Command>(message.data);
  if (topic == dds::kGuidanceTopic.name) return CompareGuidance(message.data);
  if (topic == dds::kShieldPoseTopic.name) return CompareShield(message.data);
}

// Sequence numbers run from 1 and on from file to file. A gap is what the journal did not keep; one
// that stands twice was written again after the disk had failed.
bool JournalReplay::IsNew(const std::string& stream, std::uint32_t sequence, bool counts_gaps) {
  const auto [known, is_first] = last_sequence_.try_emplace(stream, sequence);
  if (is_first) return true;
  if (sequence <= known->second) return false;
  if (counts_gaps && run_) report_.lost += sequence - known->second - 1;
  known->second = sequence;
  return true;
}

void JournalReplay::TakeFile(BytesView data) {
  const auto record = FileFrom(data);
  if (!record) {
    ++report_.unreadable;
    return;
  }
  if (record->role == "machine") {  // the first of the three: a process has started
    run_.reset();
    files_.clear();
    last_sequence_.clear();
  }
  files_[record->role] = {record->path, record->content};
  if (files_.size() < 3) return;
  MachineFaults warnings;
  const ReadFile& machine_file = other_machine_ ? *other_machine_ : files_["machine"];
  auto machine = ParseGuidedMachine(machine_file, files_["rig"], files_["axis"], &warnings);
  files_.clear();
  if (!machine) {
    report_.faults.insert(report_.faults.end(), machine.error().begin(), machine.error().end());
    return;
  }
  run_ = std::make_unique<Run>(std::move(machine).value());
  ++report_.runs;
}

template <class Message>
void JournalReplay::TakeInput(BytesView data) {
  const auto message = Decoded<Message>(data);
  if (!message) {
    ++report_.unreadable;
    return;
  }
  run_->step.Take(*message);
}

void JournalReplay::TakeStep(BytesView data) {
  const auto record = StepFrom(data);
  if (!record) {
    ++report_.unreadable;
    return;
  }
  if (!run_) {
    ++report_.skipped;
    return;
  }
  run_->output = &run_->step.Step(record->now);
  run_->record = *record;
  run_->alarms_seen = 0;
  ++report_.steps;
  if (run_->output->guidance.sample_number != record->step_number) {
    Note(kStepTopic,
         fmt::format("is the {}th that the journal holds: steps before it are missing",
                     run_->output->guidance.sample_number));
  }
}

void JournalReplay::Note(std::string_view topic, std::string what) {
  ++report_.different;
  if (report_.first.size() == kMostDifferences) return;
  report_.first.push_back(
      {run_->record.step_number, run_->record.now, std::string(topic), std::move(what)});
}

// Bit for bit, but for the moment in which it was sent.
template <class Message>
void JournalReplay::Compare(std::string_view topic,
                            const Message& said,
                            std::optional<Message> now) {
  ++report_.compared;
  if (!now) return Note(topic, "is not concluded now");
  now->published_at = said.published_at;
  if (EncodedBytes(said) == EncodedBytes(*now)) return;
  if constexpr (std::is_same_v<Message, dds::Guidance>) {
    for (std::size_t i = 0; i < std::min(said.points.size(), now->points.size()); ++i) {
      if (!(said.points[i].name == said.steer_by)) continue;
      const double right_m = now->points[i].deviation_right_m - said.points[i].deviation_right_m;
      const double up_m = now->points[i].deviation_up_m - said.points[i].deviation_up_m;
      if (std::abs(right_m) > report_.largest_right_m) report_.largest_right_m = std::abs(right_m);
      if (std::abs(up_m) > report_.largest_up_m) report_.largest_up_m = std::abs(up_m);
      return Note(topic,
                  fmt::format("{} now {} to the right and {} up of what it was, '{}' for '{}'",
                              said.steer_by.view(),
                              Millimetres(right_m),
                              Millimetres(up_m),
                              now->reason.view(),
                              said.reason.view()));
    }
  }
  Note(topic, "differs");
}

void JournalReplay::CompareGuidance(BytesView data) {
  const auto said = Decoded<dds::Guidance>(data);
  if (!said || run_->output == nullptr) {
    ++report_.unreadable;
    return;
  }
  Compare(dds::kGuidanceTopic.name, *said, std::optional(run_->output->guidance));
}

void JournalReplay::CompareShield(BytesView data) {
  const auto said = Decoded<dds::ShieldPose>(data);
  if (!said || run_->output == nullptr) {
    ++report_.unreadable;
    return;
  }
  const bool is_rear = said->shield == run_->output->rear.shield;
  Compare(dds::kShieldPoseTopic.name,
          *said,
          std::optional(is_rear ? run_->output->rear : run_->output->front));
}

void JournalReplay::CompareAlarm(const McapMessage& message) {
  const auto said = Decoded<dds::AlarmStatus>(message.data);
  if (!said) {
    ++report_.unreadable;
    return;
  }
  if (said->source.view() != kGuidanceSource || run_->output == nullptr) return;
  if (!IsNew("alarms of guidance", message.sequence, false)) return;
  const auto& alarms = run_->output->alarms;
  std::optional<dds::AlarmStatus> now;
  if (run_->alarms_seen < alarms.size()) now = alarms[run_->alarms_seen++];
  Compare(dds::kAlarmStatusTopic.name, *said, now);
}

}  // namespace tbm
