#include "guidance/app/record_command.h"

#include <atomic>
#include <chrono>
#include <mutex>
#include <tuple>

#include <fmt/format.h>

#include "devices/app/end_signals.h"
#include "guidance/app/journal.h"
#include "guidance/app/journal_topic.h"
#include "guidance/app/output_file.h"
#include "idl/cpp/participant.h"
#include "idl/cpp/subscriber.h"
#include "pose/base/clock.h"

namespace tbm {
namespace {

// One topic into the journal. Samples come from one DDS thread at a time.
template <class Message>
class RecordedTopic {
 public:
  RecordedTopic(dds::Participant& participant, Journal& journal)
      : topic_(journal),
        subscriber_(participant, [this](const Message& message, const dds::SampleFacts&) {
          if (!topic_.Add(message, clock_.Now())) return;
          ++samples_;
          bytes_ += topic_.encoded_bytes();
        }) {}

  std::uint64_t samples() const { return samples_; }

  std::string Summary() const {
    const dds::SubscriberCounters counters = subscriber_.counters();
    std::string text = fmt::format("{:<28} {:>10} samples {:>12} bytes",
                                   dds::TopicOf<Message>().name,
                                   samples_.load(),
                                   bytes_.load());
    if (counters.lost > 0) text += fmt::format(", {} lost by DDS", counters.lost);
    const std::uint64_t refused = counters.rejected + counters.from_other_interface;
    if (refused > 0) text += fmt::format(", {} refused at the boundary", refused);
    return text + "\n";
  }

 private:
  SystemClock clock_;
  JournalTopic<Message> topic_;
  std::atomic<std::uint64_t> samples_ = 0;
  std::atomic<std::uint64_t> bytes_ = 0;
  dds::Subscriber<Message> subscriber_;  // ends first: its thread uses the others
};

template <class... Messages>
class RecordedTopics {
 public:
  RecordedTopics(dds::Participant& participant, Journal& journal)
      : topics_(Both<Messages>{participant, journal}...) {}

  std::uint64_t samples() const {
    return std::apply([](const auto&... topic) { return (topic.topic.samples() + ...); }, topics_);
  }
  std::string Summary() const {
    return std::apply([](const auto&... topic) { return (topic.topic.Summary() + ...); }, topics_);
  }

 private:
  // What a tuple element is made of in place.
  template <class Message>
  struct Both {
    dds::Participant& participant;
    Journal& journal;
  };
  template <class Message>
  struct Held {
    Held(const Both<Message>& both)  // NOLINT(google-explicit-constructor): made by the tuple
        : topic(both.participant, both.journal) {}
    RecordedTopic<Message> topic;
  };

  std::tuple<Held<Messages>...> topics_;
};

using AllTopics = RecordedTopics<dds::FrameFeatures,
                                 dds::TiltReading,
                                 dds::RelativePose,
                                 dds::DeviceHealth,
                                 dds::Event,
                                 dds::StationObservation,
                                 dds::StationSetUp,
                                 dds::ShieldPose,
                                 dds::Guidance,
                                 dds::AlarmStatus,
                                 dds::Command,
                                 dds::CommandReply,
                                 dds::TrolleyState,
                                 dds::RailLinePiece,
                                 dds::SettlementPiece,
                                 dds::CalibrationStatus>;
static_assert(dds::kTopics.size() == 16, "a new topic has to be recorded");

JournalOptions OptionsOf(const RecordRequest& request) {
  JournalOptions options;
  options.folder = request.out;
  options.program = request.program;
  options.total_max_bytes = request.limit_mb * 1'000'000;
  options.file_max_duration =
      std::chrono::duration_cast<Duration>(std::chrono::duration<double>(60.0 * request.minutes));
  return options;
}

std::string JournalSummary(const JournalStatus& status) {
  std::string text = fmt::format("{}: {} messages, {} bytes in {} files\n",
                                 status.file.empty() ? std::string("no file") : status.file,
                                 status.messages_written,
                                 status.bytes_written,
                                 status.files_begun);
  if (status.files_deleted > 0) {
    text += fmt::format("{} older files deleted to stay below the limit\n", status.files_deleted);
  }
  return text;
}

}  // namespace

ExitCode RunRecord(const RecordRequest& request, const Console& console) {
  const auto config = ParticipantOn(request.network, "tbm_record", console);
  if (!config) return ExitCode::kBadInput;
  if (const auto fault = MakeFolder(request.out)) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  HoldSignals();
  Journal journal(OptionsOf(request));
  std::mutex mutex;
  dds::Participant participant(*config, [&](const dds::Alarm& alarm) {
    // Who speaks and who is silent is for the journal's reader to say.
    if (!alarm.active || alarm.kind == dds::AlarmKind::kSilent) return;
    const std::lock_guard lock(mutex);
    Complain(console, fmt::format("{}: {}", dds::AlarmCode(alarm.kind), alarm.text));
  });
  std::uint64_t samples = 0;
  {
    const AllTopics topics(participant, journal);
    if (console.err_is_terminal) console.err << "recording; Ctrl-C ends\n" << std::flush;
    WaitForEnd(request.seconds);
    samples = topics.samples();
    console.out << topics.Summary();
  }
  journal.Close();
  const JournalStatus status = journal.status();
  console.out << JournalSummary(status) << std::flush;
  if (samples == 0 && request.seconds > 0.0) {
    Complain(console,
             fmt::format(
                 "nothing heard on domain {} in {} s", request.network.domain_id, request.seconds));
    return ExitCode::kDds;
  }
  if (status.messages_dropped > 0) {
    Complain(console,
             fmt::format("{} messages were dropped: {}",
                         status.messages_dropped,
                         status.what.empty() ? "the disk was too slow" : status.what));
    return ExitCode::kDevice;
  }
  return ExitCode::kDone;
}

}  // namespace tbm
