#include "guidance/app/guidance_process.h"

#include <array>
#include <mutex>
#include <optional>
#include <set>
#include <vector>

#include <fmt/format.h>

#include "guidance/app/guidance_inbox.h"
#include "guidance/app/guidance_step.h"
#include "guidance/app/journal.h"
#include "guidance/app/journal_topic.h"
#include "guidance/journal/local_record.h"
#include "idl/cpp/dds_process.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"

namespace tbm {
namespace {

constexpr std::chrono::milliseconds kLongestWait{180};  // five steps a second also without a camera
constexpr std::chrono::seconds kHealthPeriod{1};

JournalOptions OptionsOf(const GuidanceConfig& config) {
  JournalOptions options;
  options.folder = config.journal_folder;
  options.program = "guidance " TBM_VERSION;
  options.file_max_duration = config.journal_file_length;
  options.total_max_bytes = config.journal_limit_bytes;
  return options;
}

// What the process keeps of all that is said on the machine's topics. Inputs of the steps and what
// they conclude are written by the step thread, in the order in which they were used; the rest by
// the thread that received it.
struct Record {
  explicit Record(const GuidanceConfig& config)
      : journal(OptionsOf(config)),
        files(journal.AddChannel({std::string(kFileTopic), "cdr", FileSchema()})),
        steps(journal.AddChannel({std::string(kStepTopic), "cdr", StepSchema()})),
        poses(journal),
        tilts(journal),
        observations(journal),
        set_ups(journal),
        commands(journal),
        shields(journal),
        guidance(journal),
        alarms(journal),
        events(journal),
        replies(journal),
        other_features(journal),
        other_health(journal),
        other_events(journal),
        other_alarms(journal),
        other_replies(journal) {}

  void Add(const GuidanceMessage& message, Timestamp received_at) {
    if (const auto* pose = std::get_if<dds::RelativePose>(&message)) {
      poses.Add(*pose, received_at);
    } else if (const auto* tilt = std::get_if<dds::TiltReading>(&message)) {
      tilts.Add(*tilt, received_at);
    } else if (const auto* observation = std::get_if<dds::StationObservation>(&message)) {
      observations.Add(*observation, received_at);
    } else if (const auto* set_up = std::get_if<dds::StationSetUp>(&message)) {
      set_ups.Add(*set_up, received_at);
    } else if (const auto* command = std::get_if<dds::Command>(&message)) {
      commands.Add(*command, received_at);
    }
  }
  void Add(const ReadFile& file, std::string_view role, Timestamp now) {
    const Bytes bytes = Encoded(FileRecord{std::string(role), file.path, file.content});
    journal.Add(files, bytes, now, now);
  }
  void AddStep(Timestamp now, std::uint64_t number) {
    const Bytes bytes = Encoded(StepRecord{now, number});
    journal.Add(steps, bytes, now, now);
  }

  Journal journal;
  Journal::Channel files;
  Journal::Channel steps;
  // The step thread's.
  JournalTopic<dds::RelativePose> poses;
  JournalTopic<dds::TiltReading> tilts;
  JournalTopic<dds::StationObservation> observations;
  JournalTopic<dds::StationSetUp> set_ups;
  JournalTopic<dds::Command> commands;
  JournalTopic<dds::ShieldPose> shields;
  JournalTopic<dds::Guidance> guidance;
  JournalTopic<dds::AlarmStatus> alarms;
  JournalTopic<dds::Event> events;
  JournalTopic<dds::CommandReply> replies;
  // Each its subscriber's.
  JournalTopic<dds::FrameFeatures> other_features;
  JournalTopic<dds::DeviceHealth> other_health;
  JournalTopic<dds::Event> other_events;
  JournalTopic<dds::AlarmStatus> other_alarms;
  JournalTopic<dds::CommandReply> other_replies;
};

// What others say and only the journal keeps. Of the process' own words it keeps the originals.
struct Bystander {
  Bystander(dds::Participant& participant, Record& record, const Clock& clock)
      : features(participant,
                 [&](const dds::FrameFeatures& m, const dds::SampleFacts&) {
                   record.other_features.Add(m, clock.Now());
                 }),
        health(participant,
               [&](const dds::DeviceHealth& m, const dds::SampleFacts&) {
                 record.other_health.Add(m, clock.Now());
               }),
        events(participant,
               [&](const dds::Event& m, const dds::SampleFacts&) {
                 if (!m.source.view().starts_with(kGuidanceSource)) {
                   record.other_events.Add(m, clock.Now());
                 }
               }),
        alarms(participant,
               [&](const dds::AlarmStatus& m, const dds::SampleFacts&) {
                 if (m.source.view() != kGuidanceSource) record.other_alarms.Add(m, clock.Now());
               }),
        replies(participant, [&](const dds::CommandReply& m, const dds::SampleFacts&) {
          if (m.source.view() != kGuidanceSource) record.other_replies.Add(m, clock.Now());
        }) {}

  dds::Subscriber<dds::FrameFeatures> features;
  dds::Subscriber<dds::DeviceHealth> health;
  dds::Subscriber<dds::Event> events;
  dds::Subscriber<dds::AlarmStatus> alarms;
  dds::Subscriber<dds::CommandReply> replies;
};

}  // namespace

class GuidanceProcess::Impl {
 public:
  Impl(const GuidanceConfig& config,
       const GuidedMachine& machine,
       dds::Participant& participant,
       const Clock& clock)
      : machine_(machine),
        clock_(clock),
        step_(machine.machine, machine.rig, machine.axis, machine.machine_sha256),
        started_at_(clock.Now()),
        shields_(participant),
        guidance_(participant),
        alarms_(participant),
        events_(participant),
        health_(participant),
        replies_(participant) {
    if (!config.journal_folder.empty()) {
      record_ = std::make_unique<Record>(config);
      bystander_ = std::make_unique<Bystander>(participant, *record_, clock);
      record_->Add(machine.machine_file, "machine", started_at_);
      record_->Add(machine.rig_file, "rig", started_at_);
      record_->Add(machine.axis_file, "axis", started_at_);
    }
    Listen<dds::RelativePose>(participant, poses_in_);
    Listen<dds::TiltReading>(participant, tilts_in_);
    Listen<dds::StationObservation>(participant, observations_in_);
    Listen<dds::StationSetUp>(participant, set_ups_in_);
    Listen<dds::Command>(participant, commands_in_);
  }

  void Run(const std::stop_token& stop, const std::function<void()>& on_alive) {
    std::vector<GuidanceInbox::Received> taken;
    while (!stop.stop_requested()) {
      inbox_.TakeAll(clock_.Steady() + kLongestWait, stop, &taken);
      for (const GuidanceInbox::Received& one : taken) {
        if (!step_.Take(one.message)) TellStranger(one.message);
        if (record_) record_->Add(one.message, one.received_at);
      }
      const Timestamp now = clock_.Now();
      Publish(step_.Step(now), now);
      if (clock_.Steady() >= health_due_) {
        health_due_ = clock_.Steady() + kHealthPeriod;
        TellHealth();
      }
      if (on_alive) on_alive();
    }
  }

  void Report(const dds::Alarm& alarm) {
    if (!alarm.ChangesKind()) return;
    const std::lock_guard lock(alarm_mutex_);
    if (reported_.size() < kMostReports) reported_.push_back(alarm);
  }

 private:
  static constexpr std::size_t kMostReports = 256;
  static constexpr std::size_t kMostStrangers = 16;

  template <class Message>
  void Listen(dds::Participant& participant, std::optional<dds::Subscriber<Message>>& subscriber) {
    subscriber.emplace(participant, [this](const Message& message, const dds::SampleFacts& facts) {
      // Two camera boxes or stations of one name: neither is taken for granted, the numbers coast,
      // and DDS' alarm says why.
      if (facts.contested) return;
      inbox_.Add(message, clock_.Now());
    });
  }

  // First to those who wait for it, then into the journal, in the order of the steps.
  void Publish(const GuidanceStep::Output& concluded, Timestamp now) {
    dds::ShieldPose rear = concluded.rear;
    dds::ShieldPose front = concluded.front;
    guidance_message_ = concluded.guidance;
    rear.published_at = front.published_at = guidance_message_.published_at = clock_.Now();
    guidance_.Write(guidance_message_);
    shields_.Write(front);
    shields_.Write(rear);
    for (const dds::AlarmStatus& alarm : concluded.alarms) alarms_.Write(alarm);
    for (const dds::Event& event : concluded.events) Tell(event);
    for (const dds::CommandReply& reply : concluded.replies) replies_.Write(reply);
    if (!record_) return;
    record_->AddStep(now, concluded.guidance.sample_number);
    record_->guidance.Add(guidance_message_, now);
    record_->shields.Add(rear, now);
    record_->shields.Add(front, now);
    for (const dds::AlarmStatus& alarm : concluded.alarms) record_->alarms.Add(alarm, now);
    for (const dds::Event& event : concluded.events) record_->events.Add(event, now);
    for (const dds::CommandReply& reply : concluded.replies) record_->replies.Add(reply, now);
  }

  void Tell(const dds::Event& event) {
    events_.Write(event);
    dds::LogEvent(event);
  }

  // What the process has to say of itself, beside its steps: `tbm replay` does not meet it.
  void TellOwn(std::string_view source,
               std::string_view code,
               dds::Severity severity,
               bool active,
               const std::string& text) {
    dds::Event event;
    event.machine_id = std::string_view(machine_.machine.machine_id);
    event.source = source;
    event.code = code;
    event.at = clock_.Now();
    event.sample_number = ++own_event_number_;
    event.severity = severity;
    event.active = active;
    event.text = std::string_view(text);
    Tell(event);
    if (record_) record_->events.Add(event, event.at);
  }

  // Mostly a slip of the pen in one of the configurations; told once for each.
  void TellStranger(const GuidanceMessage& message) {
    const std::string name =
        std::visit([](const auto& one) { return std::string(one.machine_id.view()); }, message);
    if (strangers_.size() == kMostStrangers || !strangers_.insert(name).second) return;
    TellOwn("guidance_process",
            "other_machine",
            dds::Severity::kWarning,
            false,
            fmt::format("machine '{}' is heard and ignored; this guidance is of '{}' (machine_id)",
                        name,
                        machine_.machine.machine_id));
  }

  void TellHealth() {
    std::vector<dds::Alarm> reported;
    {
      const std::lock_guard lock(alarm_mutex_);
      reported.swap(reported_);
    }
    for (const dds::Alarm& alarm : reported) {
      TellOwn("guidance_process",
              dds::AlarmCode(alarm.kind),
              dds::Severity::kWarning,
              alarm.active,
              alarm.topic.empty() ? alarm.text : fmt::format("{}: {}", alarm.topic, alarm.text));
    }
    WriteHealth("guidance", dds::DeviceState::kStreaming, started_at_, OwnHealth());
    if (record_) WriteHealth("journal", JournalDeviceState(), journal_since_, JournalHealth());
  }

  dds::DeviceHealth OwnHealth() const {
    dds::DeviceHealth health;
    health.samples_good = guidance_.counters().written;
    health.samples_lost = inbox_.dropped();
    health.errors = guidance_.counters().refused;
    if (health.samples_lost > 0) {
      health.detail = "messages came faster than steps are taken: the computer is too slow";
    }
    if (health.errors > 0) {
      const std::string text =
          fmt::format("samples break the contract and are not sent: {}; please report it",
                      dds::FaultText(guidance_.counters().refused_because));
      health.detail = std::string_view(text);
    }
    return health;
  }

  dds::DeviceState JournalDeviceState() {
    const JournalState state = record_->journal.status().state;
    const dds::DeviceState told = state == JournalState::kWriting ? dds::DeviceState::kStreaming
                                  : state == JournalState::kIdle  ? dds::DeviceState::kOpening
                                                                  : dds::DeviceState::kFault;
    if (told == journal_state_) return told;
    const bool was_fault = journal_state_ == dds::DeviceState::kFault;
    const bool is_fault = told == dds::DeviceState::kFault;
    journal_since_ = clock_.Now();
    journal_state_ = told;
    if (was_fault != is_fault) {
      TellOwn("guidance_process",
              "journal_not_written",
              dds::Severity::kAlarm,
              is_fault,
              is_fault ? record_->journal.status().what : "the journal is written again");
    }
    return told;
  }
  dds::DeviceHealth JournalHealth() const {
    const JournalStatus status = record_->journal.status();
    dds::DeviceHealth health;
    health.samples_good = status.messages_written;
    health.samples_lost = status.messages_dropped;
    health.detail = std::string_view(status.what);
    return health;
  }

  void WriteHealth(std::string_view device,
                   dds::DeviceState state,
                   Timestamp since,
                   dds::DeviceHealth health) {
    health.machine_id = std::string_view(machine_.machine.machine_id);
    health.device_id = device;
    health.state = state;
    health.state_since = since;
    health.published_at = clock_.Now();
    health_.Write(health);
  }

  const GuidedMachine& machine_;
  const Clock& clock_;
  GuidanceInbox inbox_;
  GuidanceStep step_;
  const Timestamp started_at_;
  std::unique_ptr<Record> record_;
  std::unique_ptr<Bystander> bystander_;  // stops before the record
  dds::Publisher<dds::ShieldPose> shields_;
  dds::Publisher<dds::Guidance> guidance_;
  dds::Publisher<dds::AlarmStatus> alarms_;
  dds::Publisher<dds::Event> events_;
  dds::Publisher<dds::DeviceHealth> health_;
  dds::Publisher<dds::CommandReply> replies_;
  dds::Guidance guidance_message_;
  std::chrono::steady_clock::time_point health_due_{};
  dds::DeviceState journal_state_ = dds::DeviceState::kClosed;
  Timestamp journal_since_ = started_at_;
  std::uint64_t own_event_number_ = 0;
  std::mutex alarm_mutex_;
  std::vector<dds::Alarm> reported_;
  std::set<std::string> strangers_;
  // Last: they stop before what they write to.
  std::optional<dds::Subscriber<dds::RelativePose>> poses_in_;
  std::optional<dds::Subscriber<dds::TiltReading>> tilts_in_;
  std::optional<dds::Subscriber<dds::StationObservation>> observations_in_;
  std::optional<dds::Subscriber<dds::StationSetUp>> set_ups_in_;
  std::optional<dds::Subscriber<dds::Command>> commands_in_;
};

GuidanceProcess::GuidanceProcess(const GuidanceConfig& config,
                                 const GuidedMachine& machine,
                                 dds::Participant& participant,
                                 const Clock& clock)
    : impl_(std::make_unique<Impl>(config, machine, participant, clock)) {}
GuidanceProcess::~GuidanceProcess() = default;
void GuidanceProcess::Run(const std::stop_token& stop, const std::function<void()>& on_alive) {
  impl_->Run(stop, on_alive);
}
void GuidanceProcess::Report(const dds::Alarm& alarm) { impl_->Report(alarm); }

}  // namespace tbm
