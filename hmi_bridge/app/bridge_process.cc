#include "hmi_bridge/app/bridge_process.h"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <mutex>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "hmi_bridge/app/answer_file.h"
#include "hmi_bridge/app/audit_log.h"
#include "hmi_bridge/app/report_runner.h"
#include "hmi_bridge/server/console_server.h"
#include "idl/cpp/codec.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/request_id.h"
#include "idl/cpp/subscriber.h"
#include "idl/cpp/topics.h"

namespace tbm::hmi {
namespace {

using namespace std::chrono_literals;

constexpr auto kTick = 200ms;
constexpr std::int64_t kAuditLimit_bytes = 50'000'000;
// An addressee that gets it later does not begin.
constexpr std::chrono::seconds kCommandLives{30};

// Longer without guidance, and the others' news goes out by itself.
constexpr std::int64_t kPaceLost_ms = 300;

// Of the command topic: what tools are passed on.
constexpr int kOwnReaders = 1;

std::int64_t SteadyMs(std::chrono::steady_clock::time_point at) {
  return std::chrono::duration_cast<std::chrono::milliseconds>(at.time_since_epoch()).count();
}

std::vector<RawChannel> AllChannels() {
  std::vector<RawChannel> channels;
  for (const dds::TopicRow& topic : dds::kTopics) {
    channels.push_back({std::string(topic.name),
                        std::string(topic.type),
                        std::string(dds::IdlTextOf(topic.type))});
  }
  return channels;
}

template <class Message>
std::size_t ChannelOf() {
  std::size_t channel = 0;
  while (dds::kTopics[channel].name != dds::TopicOf<Message>().name) ++channel;
  return channel;
}

// What is not, is passed on to who reads the topics themselves.
template <class Message>
constexpr bool IsShown() {
  return requires(ConsoleBoard & board, const Message& message, const Arrival& arrival) {
    board.Add(message, arrival, hmi::Moment{});
  };
}

}  // namespace

class BridgeProcess::Impl {
 public:
  Impl(ConsoleMachine machine,
       BridgeFacts facts,
       const PrivateFolder& state_folder,
       ReportPlaces report_places,
       dds::Participant& participant,
       const Clock& clock)
      : machine_id_(std::string_view(machine.machine.machine_id)),
        participant_(participant),
        clock_(clock),
        channels_(AllChannels()),
        answers_(state_folder),
        audit_(state_folder.PathOf("audit.log"), kAuditLimit_bytes),
        commands_(participant),
        board_(std::move(machine), std::move(facts), Moment()),
        reports_(std::move(report_places), state_folder.PathOf("reports"), clock) {
    board_.own_alarms().Restore(answers_.Load());
  }

  void Listen(ConsoleServer& server) {
    server_ = &server;
    Hear(features_);
    Hear(tilts_);
    Hear(poses_);
    Hear(health_);
    Hear(events_);
    Hear(observations_);
    Hear(set_ups_);
    Hear(shields_);
    Hear(guidance_);
    Hear(alarms_);
    Hear(commands_in_);
    Hear(replies_);
    Hear(trolleys_);
    Hear(line_pieces_);
    Hear(settlements_);
    Hear(calibrations_);
  }

  void StopListening() {
    features_.reset();
    tilts_.reset();
    poses_.reset();
    health_.reset();
    events_.reset();
    observations_.reset();
    set_ups_.reset();
    shields_.reset();
    guidance_.reset();
    alarms_.reset();
    commands_in_.reset();
    replies_.reset();
    trolleys_.reset();
    line_pieces_.reset();
    settlements_.reset();
    calibrations_.reset();
    server_ = nullptr;
  }

  void Run(const std::stop_token& stop, const std::function<void()>& on_alive) {
    while (!stop.stop_requested()) {
      // Asked before our lock is taken: DDS holds its own while it reports an alarm.
      const bool is_running = participant_.IsRunning();
      std::vector<std::string> news;
      {
        const std::lock_guard lock(mutex_);
        const hmi::Moment now = Moment();
        board_.SetNetwork(is_running, now);
        board_.Tick(now);
        news = board_.own_alarms().TakeNews();
      }
      for (const std::string& line : news) fmt::print(stderr, "{}\n", line);
      ConsoleServer* server = server_.load();
      if (server != nullptr && SteadyMs(clock_.Steady()) - paced_steady_ms_ > kPaceLost_ms) {
        server->Notify();
      }
      if (on_alive) on_alive();
      std::this_thread::sleep_for(kTick);
    }
  }

  void Report(const dds::Alarm& alarm) {
    const std::lock_guard lock(mutex_);
    board_.Add(alarm, Moment());
  }

  Picture Now() {
    const std::lock_guard lock(mutex_);
    const hmi::Moment now = Moment();
    std::vector<Section> sections = board_.Sections();
    sections.push_back(reports_.View());
    return {std::move(sections),
            static_cast<double>(Milliseconds(now.utc)),
            static_cast<double>(now.steady_ms)};
  }

  ApiAnswer History(const HistoryQuestion& question) {
    const std::lock_guard lock(mutex_);
    const auto view = board_.history().Between(question.point,
                                               static_cast<std::int64_t>(question.from_utc_ms),
                                               static_cast<std::int64_t>(question.to_utc_ms),
                                               static_cast<std::size_t>(question.most));
    return AnswerOf(question.point, view);
  }

  ApiAnswer Advance(const AdvanceQuestion& question) {
    const std::lock_guard lock(mutex_);
    return AnswerOf(question.point, board_.history().Back(question.point, question.length_m));
  }

  ApiAnswer Ask(const CommandRequest& request, const std::string& user, Role role) {
    const auto asked = CommandOf(request, user, role);
    const Timestamp now = clock_.Now();
    if (!asked) {
      // Who tried what they may not is of interest too; that it cannot be written changes nothing.
      (void)audit_.Add(now, user, role, request, "refused: " + asked.error().text);
      return asked.error();
    }
    dds::Command command = asked.value();
    command.machine_id = machine_id_;
    const std::string request_id = dds::NewRequestId();
    command.request_id = std::string_view(request_id);
    command.issued_at = now;
    command.expires_at = now + kCommandLives;
    if (!audit_.Add(now, user, role, request, "sent as " + request_id)) {
      return ApiFault{
          503, "cannot_send", "the audit log cannot be written, and nothing is done without it"};
    }
    const ApiAnswer answer = Send(command, request_id);
    if (const auto* fault = std::get_if<ApiFault>(&answer)) {
      (void)audit_.Add(
          clock_.Now(), user, role, request, "not sent: " + request_id + ": " + fault->text);
    }
    return answer;
  }

  ApiAnswer StartReport(std::string_view json, const std::string& user, Role role) {
    CommandRequest asked{
        std::string(kOwnAddressee), "report", std::string(json.substr(0, 200)), ""};
    const Timestamp now = clock_.Now();
    if (role < Role::kSurveyor) {
      (void)audit_.Add(now, user, role, asked, "refused: not a surveyor");
      return ApiFault{403, "forbidden", "reports are for surveyors"};
    }
    if (!audit_.Add(now, user, role, asked, "asked")) {
      return ApiFault{503, "cannot_send", "the audit log cannot be written"};
    }
    return reports_.Start(json, user);
  }

  std::shared_ptr<const std::string> ReportFile(std::string_view id, std::string_view name) {
    return reports_.File(id, name);
  }

  std::string Metrics() {
    std::string text;
    {
      const std::lock_guard lock(mutex_);
      text = board_.Metrics(Moment());
    }
    text +=
        "# HELP tbm_samples_total of each topic, since the bridge began\n"
        "# TYPE tbm_samples_total counter\n";
    AppendSamples(features_, &text);
    AppendSamples(tilts_, &text);
    AppendSamples(poses_, &text);
    AppendSamples(health_, &text);
    AppendSamples(events_, &text);
    AppendSamples(observations_, &text);
    AppendSamples(set_ups_, &text);
    AppendSamples(shields_, &text);
    AppendSamples(guidance_, &text);
    AppendSamples(alarms_, &text);
    AppendSamples(commands_in_, &text);
    AppendSamples(replies_, &text);
    AppendSamples(trolleys_, &text);
    AppendSamples(line_pieces_, &text);
    AppendSamples(settlements_, &text);
    AppendSamples(calibrations_, &text);
    return text;
  }

  const std::vector<RawChannel>& Channels() const { return channels_; }

 private:
  template <class Message>
  using Input = std::optional<dds::Subscriber<Message>>;

  template <class Message>
  static void AppendSamples(const Input<Message>& input, std::string* text) {
    if (!input) return;
    const dds::SubscriberCounters counters = input->counters();
    const auto append = [&](std::string_view outcome, std::uint64_t count) {
      *text += fmt::format("tbm_samples_total{{topic=\"{}\",outcome=\"{}\"}} {}\n",
                           dds::TopicOf<Message>().name,
                           outcome,
                           count);
    };
    append("delivered", counters.delivered);
    append("rejected", counters.rejected);
    append("other_interface", counters.from_other_interface);
    append("lost", counters.lost);
  }
  static_assert(dds::kTopics.size() == 16, "a new topic has to be heard");

  hmi::Moment Moment() const { return {clock_.Now(), SteadyMs(clock_.Steady())}; }

  template <class Message>
  void Hear(Input<Message>& input) {
    input.emplace(participant_, [this](const Message& message, const dds::SampleFacts& facts) {
      const Arrival arrival{SteadyMs(facts.received_at), facts.contested};
      if constexpr (IsShown<Message>()) {
        const std::lock_guard lock(mutex_);
        board_.Add(message, arrival, Moment());
      }
      // Guidance sets the pace: what else is told goes out with it, a few milliseconds later, and
      // so never makes it wait for its turn.
      if constexpr (std::is_same_v<Message, dds::Guidance>) {
        paced_steady_ms_ = arrival.heard_steady_ms;
        server_.load()->Notify();
      }
      PassOn(message);
    });
  }

  template <class Message>
  void PassOn(const Message& message) {
    static const std::size_t channel = ChannelOf<Message>();
    ConsoleServer& server = *server_.load();
    if (!server.HasListener(channel)) return;
    std::vector<std::byte> bytes;
    if (dds::EncodeCdr(message, &bytes) != dds::BoundaryFault::kNone) return;
    server.Publish(channel, clock_.Now(), bytes);
  }

  ApiAnswer AnswerOf(const std::string& point, const std::optional<Json>& view) const {
    if (view) return view->dump();
    return ApiFault{400, "unknown_point", "the machine has no point '" + point + "'"};
  }

  ApiAnswer Send(const dds::Command& command, const std::string& request_id) {
    const bool is_own = command.addressee.view() == kOwnAddressee;
    if (!is_own && commands_.matched_readers() <= kOwnReaders) {
      return ApiFault{503,
                      "cannot_send",
                      fmt::format("nobody hears commands: does {} run?", command.addressee.view())};
    }
    {
      const std::lock_guard lock(mutex_);
      board_.Send(command, Moment());
    }
    // Also what the bridge does itself: so it stands in the journal.
    const dds::WriteOutcome outcome = commands_.Write(command);
    if (!is_own && outcome != dds::WriteOutcome::kWritten) {
      const std::lock_guard lock(mutex_);
      board_.Withdraw(command);
      return ApiFault{503,
                      "cannot_send",
                      outcome == dds::WriteOutcome::kRefused
                          ? std::string(dds::FaultText(commands_.counters().refused_because))
                          : "there is no network"};
    }
    if (is_own) {
      const std::lock_guard lock(mutex_);
      if (board_.Obey(command, Moment())) answers_.Keep(board_.own_alarms().answers());
    }
    if (ConsoleServer* server = server_.load()) server->Notify();
    return Json({{"request_id", request_id}}).dump();
  }

  const dds::MachineId machine_id_;
  dds::Participant& participant_;
  const Clock& clock_;
  const std::vector<RawChannel> channels_;
  AnswerFile answers_;
  AuditLog audit_;
  dds::Publisher<dds::Command> commands_;
  std::atomic<ConsoleServer*> server_ = nullptr;
  std::atomic<std::int64_t> paced_steady_ms_ = 0;

  std::mutex mutex_;  // guards board_
  ConsoleBoard board_;
  ReportRunner reports_;  // has a lock of its own

  Input<dds::FrameFeatures> features_;
  Input<dds::TiltReading> tilts_;
  Input<dds::RelativePose> poses_;
  Input<dds::DeviceHealth> health_;
  Input<dds::Event> events_;
  Input<dds::StationObservation> observations_;
  Input<dds::StationSetUp> set_ups_;
  Input<dds::ShieldPose> shields_;
  Input<dds::Guidance> guidance_;
  Input<dds::AlarmStatus> alarms_;
  Input<dds::Command> commands_in_;
  Input<dds::CommandReply> replies_;
  Input<dds::TrolleyState> trolleys_;
  Input<dds::RailLinePiece> line_pieces_;
  Input<dds::SettlementPiece> settlements_;
  Input<dds::CalibrationStatus> calibrations_;
};

BridgeProcess::BridgeProcess(ConsoleMachine machine,
                             BridgeFacts facts,
                             const PrivateFolder& state_folder,
                             ReportPlaces report_places,
                             dds::Participant& participant,
                             const Clock& clock)
    : impl_(std::make_unique<Impl>(std::move(machine),
                                   std::move(facts),
                                   state_folder,
                                   std::move(report_places),
                                   participant,
                                   clock)) {}
BridgeProcess::~BridgeProcess() = default;

void BridgeProcess::Listen(ConsoleServer& server) { impl_->Listen(server); }
void BridgeProcess::StopListening() { impl_->StopListening(); }
void BridgeProcess::Run(const std::stop_token& stop, const std::function<void()>& on_alive) {
  impl_->Run(stop, on_alive);
}
void BridgeProcess::Report(const dds::Alarm& alarm) { impl_->Report(alarm); }
Picture BridgeProcess::Now() { return impl_->Now(); }
ApiAnswer BridgeProcess::History(const HistoryQuestion& question) {
  return impl_->History(question);
}
ApiAnswer BridgeProcess::Advance(const AdvanceQuestion& question) {
  return impl_->Advance(question);
}
ApiAnswer BridgeProcess::Ask(const CommandRequest& request, const std::string& user, Role role) {
  return impl_->Ask(request, user, role);
}
ApiAnswer BridgeProcess::StartReport(std::string_view json, const std::string& user, Role role) {
  return impl_->StartReport(json, user, role);
}
std::shared_ptr<const std::string> BridgeProcess::ReportFile(std::string_view id,
                                                             std::string_view name) {
  return impl_->ReportFile(id, name);
}
std::string BridgeProcess::Metrics() { return impl_->Metrics(); }
const std::vector<RawChannel>& BridgeProcess::Channels() const { return impl_->Channels(); }

}  // namespace tbm::hmi
