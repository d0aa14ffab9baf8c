#include "guidance/app/watch_command.h"

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <map>
#include <mutex>
#include <thread>

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "guidance/app/watch_board.h"
#include "guidance/app/watch_text.h"
#include "idl/cpp/participant.h"
#include "idl/cpp/subscriber.h"
#include "pose/base/clock.h"

namespace tbm {
namespace {

using Instant = std::chrono::steady_clock::time_point;

std::atomic<bool> stop_asked{false};
void AskToStop(int) { stop_asked = true; }

// Ctrl-C ends the loop, so that the cursor comes back; the old handlers return with the object.
class StopSignals {
 public:
  StopSignals() {
    stop_asked = false;
    old_interrupt_ = std::signal(SIGINT, AskToStop);
    old_terminate_ = std::signal(SIGTERM, AskToStop);
  }
  ~StopSignals() {
    std::signal(SIGINT, old_interrupt_);
    std::signal(SIGTERM, old_terminate_);
  }
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

 private:
  void (*old_interrupt_)(int) = nullptr;
  void (*old_terminate_)(int) = nullptr;
};

WatchNow Now() {
  const SystemClock clock;
  return {clock.Steady(), clock.Now()};
}

Timestamp TimeOf(const dds::RelativePose& message) { return message.sensed_at; }
Timestamp TimeOf(const dds::TiltReading& message) { return message.sensed_at; }
Timestamp TimeOf(const dds::FrameFeatures& message) { return message.sensed_at; }
Timestamp TimeOf(const dds::DeviceHealth& message) { return message.published_at; }
Timestamp TimeOf(const dds::Event& message) { return message.at; }
Timestamp TimeOf(const dds::Guidance& message) { return message.valid_at; }
Timestamp TimeOf(const dds::ShieldPose& message) { return message.valid_at; }
Timestamp TimeOf(const dds::StationSetUp& message) { return message.published_at; }
Timestamp TimeOf(const dds::AlarmStatus& message) { return message.published_at; }
Timestamp TimeOf(const dds::TrolleyState& message) { return message.published_at; }
Timestamp TimeOf(const dds::RailLinePiece& message) { return message.published_at; }
Timestamp TimeOf(const dds::SettlementPiece& message) { return message.published_at; }
Timestamp TimeOf(const dds::CalibrationStatus& message) { return message.published_at; }

// Meeting point of the DDS threads, which bring samples, and the one that shows them.
class Inbox {
 public:
  explicit Inbox(bool keeps_lines) : keeps_lines_(keeps_lines) {}

  template <class Message>
  void Add(const Message& message, Instant received_at) {
    const std::lock_guard lock(mutex_);
    has_heard_ = true;
    board_.Add(message, received_at);
    if (keeps_lines_) AddLine(WatchLine(message, WatchAgeS(received_at, TimeOf(message), Now())));
  }
  void AddAlarm(const dds::Alarm& alarm) {
    const std::lock_guard lock(mutex_);
    board_.Add(alarm);
    if (keeps_lines_) AddLine(WatchLine(alarm));
  }

  std::vector<std::string> TakeLines() {
    const std::lock_guard lock(mutex_);
    if (dropped_ > 0) lines_.push_back(fmt::format("dropped lines={}", dropped_));
    dropped_ = 0;
    return std::exchange(lines_, {});
  }
  std::vector<WatchRow> Rows() const {
    const std::lock_guard lock(mutex_);
    return board_.Rows(Now());
  }
  bool has_heard() const {
    const std::lock_guard lock(mutex_);
    return has_heard_;
  }

 private:
  // A reader of the pipe that sleeps must not let the lines pile up.
  void AddLine(std::string line) {
    constexpr std::size_t kMostLines = 10'000;
    if (lines_.size() < kMostLines) {
      lines_.push_back(std::move(line));
    } else {
      ++dropped_;
    }
  }

  const bool keeps_lines_;
  mutable std::mutex mutex_;
  WatchBoard board_;
  std::vector<std::string> lines_;
  std::uint64_t dropped_ = 0;
  bool has_heard_ = false;
};

// One subscriber per topic, all into one inbox.
class Subscriptions {
 public:
  Subscriptions(dds::Participant& participant, Inbox& inbox)
      : poses_(participant, Into<dds::RelativePose>(inbox)),
        tilts_(participant, Into<dds::TiltReading>(inbox)),
        features_(participant, Into<dds::FrameFeatures>(inbox)),
        health_(participant, Into<dds::DeviceHealth>(inbox)),
        events_(participant, Into<dds::Event>(inbox)),
        guidance_(participant, Into<dds::Guidance>(inbox)),
        shields_(participant, Into<dds::ShieldPose>(inbox)),
        set_ups_(participant, Into<dds::StationSetUp>(inbox)),
        alarms_(participant, Into<dds::AlarmStatus>(inbox)),
        trolleys_(participant, Into<dds::TrolleyState>(inbox)),
        lines_(participant, Into<dds::RailLinePiece>(inbox)),
        settlements_(participant, Into<dds::SettlementPiece>(inbox)),
        calibrations_(participant, Into<dds::CalibrationStatus>(inbox)) {}

 private:
  template <class Message>
  static typename dds::Subscriber<Message>::Handler Into(Inbox& inbox) {
    return [&inbox](const Message& message, const dds::SampleFacts& facts) {
      inbox.Add(message, facts.received_at);
    };
  }

  dds::Subscriber<dds::RelativePose> poses_;
  dds::Subscriber<dds::TiltReading> tilts_;
  dds::Subscriber<dds::FrameFeatures> features_;
  dds::Subscriber<dds::DeviceHealth> health_;
  dds::Subscriber<dds::Event> events_;
  dds::Subscriber<dds::Guidance> guidance_;
  dds::Subscriber<dds::ShieldPose> shields_;
  dds::Subscriber<dds::StationSetUp> set_ups_;
  dds::Subscriber<dds::AlarmStatus> alarms_;
  dds::Subscriber<dds::TrolleyState> trolleys_;
  dds::Subscriber<dds::RailLinePiece> lines_;
  dds::Subscriber<dds::SettlementPiece> settlements_;
  dds::Subscriber<dds::CalibrationStatus> calibrations_;
};

int TerminalWidth() {
  winsize size = {};
  return ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 132;
}

void ShowScreen(const Inbox& inbox, const WatchRequest& request, const Console& console) {
  const bool with_colours = std::getenv("NO_COLOR") == nullptr;
  std::string text = fmt::format("tbm watch, domain {}; lengths in mm; Ctrl-C ends\n\n",
                                 request.network.domain_id);
  text += WatchScreen(inbox.Rows(), TerminalWidth(), with_colours);
  if (!inbox.has_heard())
    text +=
        "\nnothing heard yet: does a camera box or guidance run on this domain and interface?\n";
  std::string screen = "\x1b[H";
  for (const char c : text) screen += c == '\n' ? std::string("\x1b[K\n") : std::string(1, c);
  console.out << screen << "\x1b[J" << std::flush;
}

// A row turning stale is news that no sample brings.
void ShowNewlyStale(const Inbox& inbox,
                    std::map<std::string, bool>& was_stale,
                    const Console& console) {
  for (const WatchRow& row : inbox.Rows()) {
    if (row.what.starts_with(' ')) continue;
    const bool is_stale = row.style == WatchStyle::kStale;
    if (is_stale && !std::exchange(was_stale[row.what], true)) {
      console.out << "stale what=\"" << watch::Harmless(row.what) << "\" age=\"" << row.age
                  << "\"\n";
    }
    if (!is_stale) was_stale[row.what] = false;
  }
}

void ShowLines(Inbox& inbox, std::map<std::string, bool>& was_stale, const Console& console) {
  for (const std::string& line : inbox.TakeLines()) console.out << line << "\n";
  ShowNewlyStale(inbox, was_stale, console);
  console.out << std::flush;
}

}  // namespace

ExitCode RunWatch(const WatchRequest& request, const Console& console) {
  const auto config = ParticipantOn(request.network, "tbm_watch", console);
  if (!config) return ExitCode::kBadInput;
  const StopSignals signals;
  Inbox inbox(!console.out_is_terminal);
  dds::Participant participant(*config, [&](const dds::Alarm& alarm) { inbox.AddAlarm(alarm); });
  const Subscriptions subscriptions(participant, inbox);

  const Instant started_at = std::chrono::steady_clock::now();
  std::map<std::string, bool> was_stale;
  if (console.out_is_terminal) console.out << "\x1b[2J\x1b[?25l";
  const auto is_over = [&] {
    const auto elapsed = std::chrono::steady_clock::now() - started_at;
    return stop_asked || !console.out ||
           (request.seconds > 0.0 &&
            std::chrono::duration<double>(elapsed).count() >= request.seconds);
  };
  while (!is_over()) {
    if (console.out_is_terminal) {
      ShowScreen(inbox, request, console);
    } else {
      ShowLines(inbox, was_stale, console);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  if (!console.out_is_terminal) ShowLines(inbox, was_stale, console);
  if (console.out_is_terminal) console.out << "\x1b[?25h\n" << std::flush;
  if (request.seconds > 0.0 && !stop_asked && !inbox.has_heard()) {
    Complain(console,
             fmt::format(
                 "nothing heard on domain {} in {} s", request.network.domain_id, request.seconds));
    return ExitCode::kDds;
  }
  return ExitCode::kDone;
}

}  // namespace tbm
