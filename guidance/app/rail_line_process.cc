#include "guidance/app/rail_line_process.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "guidance/app/even_clock.h"
#include "guidance/app/rail_alarms.h"
#include "guidance/app/rail_devices.h"
#include "guidance/app/rail_outcome.h"
#include "guidance/app/rail_recorder.h"
#include "guidance/app/rail_replay.h"
#include "guidance/app/rail_start_words.h"
#include "guidance/app/rail_words.h"
#include "guidance/config/sha256.h"
#include "guidance/core/alarm_command.h"
#include "guidance/rail/rail_tracker.h"
#include "idl/cpp/dds_process.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"

namespace tbm {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kTick{10};
constexpr std::chrono::milliseconds kStatePeriod{100};
constexpr std::chrono::seconds kHealthPeriod{1};
// Who was asked to end by a signal goes on for so long at the most, until all have the line.
constexpr std::chrono::seconds kFarewell{1};
// Clocks that are brought together slowly go together with the steady one; what is more was set.
constexpr Duration kClockSet = std::chrono::milliseconds(20);
constexpr std::size_t kMostWarningsTold = 5;
constexpr std::size_t kMostReports = 256;
constexpr std::size_t kMostCommands = 64;
constexpr std::size_t kMostAnswered = 64;

std::vector<std::string> NamesOf(const std::vector<SurveyedTarget>& targets) {
  std::vector<std::string> names;
  for (const SurveyedTarget& target : targets) names.push_back(target.name);
  return names;
}

std::unique_ptr<RailSource> SourceOf(const RailLineConfig& config,
                                     const RailRun& run,
                                     dds::Participant& participant,
                                     const Clock& clock) {
  if (config.replay) return std::make_unique<RailReplay>(run.recording, *config.replay);
  return std::make_unique<RailDevices>(config, run.recording.targets.size(), participant, clock);
}

}  // namespace

class RailLineProcess::Impl {
 public:
  Impl(const RailLineConfig& config,
       const RailRun& run,
       const Texts& texts,
       RunFolders& folders,
       dds::Participant& participant,
       const Clock& clock)
      : config_(config),
        setup_(run.setup),
        folders_(folders),
        clock_(clock),
        even_clock_(clock),
        run_id_(folders.FreeName(clock.Now())),
        rail_yaml_sha256_(Sha256(texts.rail_yaml)),
        source_(SourceOf(config, run, participant, even_clock_)),
        tracker_(run.setup, run.recording.targets, {.lag_s = config.lag_s}),
        recorder_(folders.RunPath(run_id_),
                  {texts.rail_yaml, texts.targets_csv, NamesOf(run.recording.targets)},
                  HoldBack(config)),
        alarms_(config.machine_id),
        states_(participant),
        lines_(participant),
        settlements_(participant),
        calibrations_(participant),
        health_(participant),
        alarm_statuses_(participant),
        events_(participant),
        replies_(participant) {
    commands_in_.emplace(participant, [this](const dds::Command& command, const dds::SampleFacts&) {
      const std::lock_guard lock(mutex_);
      if (commands_.size() < kMostCommands) commands_.push_back(command);
    });
  }

  ExitCode Run(const std::stop_token& stop, const std::function<void()>& on_alive) {
    for (const std::string& path : folders_.CleanUp()) {
      TellOnce("unfinished_run",
               dds::Severity::kWarning,
               path + " was left by a process that died; tbm line may still make its line");
    }
    if (const auto failed = recorder_.Begin()) {
      Watch(RailAlarm::kRunNotWritten, true, *failed);
      Beat(clock_.Now());
      return ExitCode::kBadInput;
    }
    TellOnce("run_begun", dds::Severity::kInfo, fmt::format("run {}", run_id_));
    heard_at_ = clock_.Steady();
    while (!stop.stop_requested() && !is_asked_to_end_ && !source_->has_ended()) {
      TakeInputs();
      BeatWhenDue();
      if (on_alive) on_alive();
      std::this_thread::sleep_for(kTick);
    }
    has_ended_ = true;
    TellState(clock_.Now());
    const ExitCode code = Finish(on_alive);
    folders_.Release();
    Hold(stop, on_alive);
    return code;
  }

  void Report(const dds::Alarm& alarm) {
    if (!alarm.ChangesKind()) return;
    const std::lock_guard lock(mutex_);
    if (reported_.size() < kMostReports) reported_.push_back(alarm);
  }

 private:
  // The recorder waits longer than the tracker: what is too late for the live numbers is still good
  // for the line.
  static Duration HoldBack(const RailLineConfig& config) {
    return Duration(std::llround((config.lag_s + 5.0) * 1e9));
  }

  void TakeInputs() {
    source_->Take(clock_.Steady(), &inputs_);
    for (const RailInput& input : inputs_) {
      recorder_.Add(input);
      std::visit([this](const auto& one) { Count(one); }, input);
    }
  }

  // The unit lives while its time goes on: the tracker takes no sample that is not newer.
  void Count(const ImuSample& sample) {
    ++samples_;
    if (sample.ends_at > newest_sample_) {
      newest_sample_ = sample.ends_at;
      heard_at_ = clock_.Steady();
    }
    tracker_.Add(sample);
  }
  void Count(const TrolleyTilt& tilt) {
    ++tilts_;
    tracker_.Add(tilt);
  }
  void Count(const TargetImage& image) {
    ++images_;
    tracker_.Add(image);
  }
  void Count(const OdometerReading& reading) { tracker_.Add(reading); }

  void BeatWhenDue() {
    ObeyAll();
    if (clock_.Steady() >= state_due_) {
      state_due_ = clock_.Steady() + kStatePeriod;
      TellState(clock_.Now());
    }
    if (clock_.Steady() >= health_due_) {
      health_due_ = clock_.Steady() + kHealthPeriod;
      if (!has_ended_) {
        const auto failed = recorder_.Flush();
        Watch(RailAlarm::kRunNotWritten, failed.has_value(), failed.value_or(""));
      }
      Beat(clock_.Now());
    } else {
      TellAlarms(false, clock_.Now());
    }
  }

  bool IsImuSilent() const {
    const std::chrono::duration<double> silent = clock_.Steady() - heard_at_;
    return !has_ended_ && std::max(silent.count(), BehindS()) > config_.imu_silent_after_s;
  }

  // How old the newest sample was when it came. One that is played is as old as its run.
  double BehindS() const {
    if (!config_.devices || samples_ == 0) return 0.0;
    return SecondsBetween(newest_sample_, even_clock_.Now());
  }

  std::string_view WhyNone() const {
    if (has_ended_) return "ended";
    if (IsImuSilent()) return "imu_silent";
    switch (tracker_.phase()) {
      case RailTrackerPhase::kNoRun:
        return "no_run";
      case RailTrackerPhase::kWaitingForRest:
        return "waiting_for_rest";
      case RailTrackerPhase::kStartFailed:
        return "start_failed";
      case RailTrackerPhase::kTracks:
        return "";
    }
    return "";
  }

  void TellState(Timestamp now) {
    const std::string_view why_none = WhyNone();
    const auto place = why_none.empty() ? tracker_.Place() : std::nullopt;
    dds::TrolleyState state =
        TrolleyStateOf(place, why_none.empty() && !place ? "waiting_for_rest" : why_none);
    if (!place) state.valid_at = now;
    state.machine_id = std::string_view(config_.machine_id);
    state.published_at = now;
    state.sample_number = ++state_number_;
    state.run_id = std::string_view(run_id_);
    state.came_too_late = tracker_.came_too_late();
    state.gaps = tracker_.gaps();
    states_.Write(state);
    Watch(RailAlarm::kImuSilent, IsImuSilent());
    const auto& why_no_start = tracker_.start_failure();
    Watch(RailAlarm::kStartFailed,
          why_no_start.has_value(),
          why_no_start ? Explain(*why_no_start, setup_) : "");
    Watch(RailAlarm::kComesTooLate, tracker_.came_too_late() > late_told_);
    late_told_ = tracker_.came_too_late();
  }

  void Watch(RailAlarm alarm, bool holds, const std::string& what = "") {
    alarms_.Watch(alarm, holds ? 1.0 : 0.0, clock_.Now(), holds ? what : "");
  }

  void Beat(Timestamp now) {
    std::vector<dds::Alarm> reported;
    {
      const std::lock_guard lock(mutex_);
      reported.swap(reported_);
    }
    for (const dds::Alarm& alarm : reported) {
      Tell(dds::AlarmCode(alarm.kind),
           dds::Severity::kWarning,
           alarm.active,
           alarm.topic.empty() ? alarm.text : fmt::format("{}: {}", alarm.topic, alarm.text));
    }
    bool is_due = false;
    for (dds::CalibrationStatus& status : CalibrationsOf(setup_, config_, rail_yaml_sha256_, now)) {
      is_due = is_due || status.state == dds::CalibrationState::kDue;
      status.published_at = now;
      calibrations_.Write(status);
    }
    Watch(RailAlarm::kCalibrationDue, is_due);
    WatchClock();
    TellHealth(now);
    TellAlarms(true, now);
  }

  // A run that is played has its own time.
  void WatchClock() {
    if (!config_.devices || has_ended_) return;
    const Duration set = even_clock_.SetSince();
    Watch(RailAlarm::kClockSet,
          std::chrono::abs(set) > kClockSet,
          fmt::format("by {:+.2f} s", std::chrono::duration<double>(set).count()));
  }

  void TellHealth(Timestamp now) {
    const auto state = [&](std::uint64_t heard, bool silent = false) {
      if (has_ended_) return dds::DeviceState::kClosed;
      if (heard == 0) return dds::DeviceState::kOpening;
      return silent ? dds::DeviceState::kSilent : dds::DeviceState::kStreaming;
    };
    const auto& devices = config_.devices;
    const std::uint64_t lost = recorder_.not_recorded();
    WatchLost(WriteHealth(
        "rail_line", dds::DeviceState::kStreaming, states_.counters().written, lost, now));
    WriteHealth("imu", state(samples_, IsImuSilent()), samples_, tracker_.gaps(), now);
    if (setup_.tilt) {
      WatchSilence(RailAlarm::kInclinometerSilent,
                   devices && devices->inclinometer,
                   WriteHealth("inclinometer", state(tilts_), tilts_, 0, now));
    }
    if (setup_.camera) {
      WatchSilence(RailAlarm::kTargetsSilent,
                   devices && devices->has_target_pixels,
                   WriteHealth("targets", state(images_), images_, 0, now));
    }
  }

  void WatchSilence(RailAlarm alarm, bool is_expected, const dds::DeviceHealth& health) {
    if (!is_expected) return;
    Watch(alarm,
          !has_ended_ && health.state != dds::DeviceState::kStreaming,
          std::string(health.detail));
  }

  // What the line will miss.
  void WatchLost(const dds::DeviceHealth& health) {
    if (has_ended_) return;
    alarms_.Watch(RailAlarm::kMeasurementsLost,
                  static_cast<double>(health.samples_lost),
                  clock_.Now(),
                  health.samples_lost > 0 ? fmt::format("{} so far", health.samples_lost) : "");
  }

  dds::DeviceHealth WriteHealth(std::string_view device,
                                dds::DeviceState state,
                                std::uint64_t good,
                                std::uint64_t lost,
                                Timestamp now) {
    dds::DeviceHealth health;
    health.state = state;
    health.samples_good = good;
    health.samples_lost = lost;
    if (!has_ended_) source_->FillHealth(device, &health);
    DeviceSince& since = since_[std::string(device)];
    if (since.state != health.state || since.at.ns == 0) since = {health.state, now};
    health.machine_id = std::string_view(config_.machine_id);
    health.device_id = device;
    health.state_since = since.at;
    health.published_at = now;
    health_.Write(health);
    return health;
  }

  void TellAlarms(bool all, Timestamp now) {
    const RailAlarms::News news = alarms_.Take(all, now);
    for (const dds::AlarmStatus& status : news.alarms) alarm_statuses_.Write(status);
    for (const dds::Event& event : news.events) Tell(event);
  }

  void Tell(dds::Event event) {
    event.sample_number = ++event_number_;
    events_.Write(event);
    dds::LogEvent(event);
  }
  void Tell(std::string_view code, dds::Severity severity, bool active, const std::string& text) {
    dds::Event event;
    event.machine_id = std::string_view(config_.machine_id);
    event.source = kRailLineSource;
    event.code = code;
    event.at = clock_.Now();
    event.severity = severity;
    event.active = active;
    event.text = std::string_view(text);
    Tell(event);
  }
  void TellOnce(std::string_view code, dds::Severity severity, const std::string& text) {
    Tell(code, severity, false, text);
  }

  void ObeyAll() {
    std::vector<dds::Command> commands;
    {
      const std::lock_guard lock(mutex_);
      commands.swap(commands_);
    }
    for (const dds::Command& command : commands) {
      const bool is_ours = command.machine_id.view() == config_.machine_id &&
                           command.addressee.view() == kRailLineSource;
      if (!is_ours || answered_.contains(std::string(command.request_id))) continue;
      if (answered_.size() == kMostAnswered) answered_.clear();
      answered_.insert(std::string(command.request_id));
      Obey(command);
    }
  }

  void Obey(const dds::Command& command) {
    using enum dds::CommandOutcome;
    const Timestamp now = clock_.Now();
    if (now > command.expires_at) return Reply(command, kRefused, "it came too late");
    if (command.verb.view() == "end_run") {
      if (has_ended_) return Reply(command, kRefused, "the run has ended");
      is_asked_to_end_ = true;
      return Reply(command, kAccepted, "the run ends, and its line is made");
    }
    if (!IsAlarmVerb(command.verb.view())) {
      return Reply(command, kRefused, "rail_line knows end_run, acknowledge, shelve and unshelve");
    }
    const auto done = alarms_.Obey(command, now);
    Reply(command, done ? kDone : kRefused, done ? *done : done.error());
  }

  void Reply(const dds::Command& command, dds::CommandOutcome outcome, const std::string& text) {
    dds::CommandReply reply;
    reply.machine_id = command.machine_id;
    reply.request_id = command.request_id;
    reply.source = kRailLineSource;
    reply.outcome = outcome;
    reply.text = std::string_view(text);
    reply.published_at = clock_.Now();
    replies_.Write(reply);
  }

  // Makes the line while health and alarms go on.
  ExitCode Finish(const std::function<void()>& on_alive) {
    if (const auto failed = recorder_.Finish()) {
      Watch(RailAlarm::kRunNotWritten, true, *failed);
      return ExitCode::kBadInput;
    }
    TellOnce("run_ended",
             dds::Severity::kInfo,
             fmt::format("{}: {} samples", recorder_.folder(), recorder_.samples()));
    std::future<RailOutcome> making =
        std::async(std::launch::async, [this] { return MakeOutcome(config_, folders_, run_id_); });
    while (making.wait_for(kTick) != std::future_status::ready) {
      BeatWhenDue();
      if (on_alive) on_alive();
    }
    const RailOutcome outcome = making.get();
    TellWarnings(outcome.warnings);
    if (!outcome.line) {
      for (const std::string& trouble : outcome.troubles) {
        fmt::print(stderr, "{}: {}\n", run_id_, trouble);
      }
      Watch(RailAlarm::kLineNotWritten, true, outcome.troubles.front());
      return ExitCode::kBadInput;
    }
    TellLine(*outcome.line);
    TellComparison(outcome);
    return ExitCode::kDone;
  }

  // All of them stand in the log; who listens gets the first few.
  void TellWarnings(const std::vector<std::string>& warnings) {
    for (std::size_t i = 0; i < warnings.size(); ++i) {
      if (i < kMostWarningsTold) {
        TellOnce("line_warning", dds::Severity::kWarning, warnings[i]);
      } else {
        fmt::print(stderr, "{}: {}\n", run_id_, warnings[i]);
      }
    }
    if (warnings.size() <= kMostWarningsTold) return;
    TellOnce("line_warning",
             dds::Severity::kWarning,
             fmt::format("and {} more; tbm line says them", warnings.size() - kMostWarningsTold));
  }

  void TellLine(const FinishedLine& line) {
    const Timestamp now = clock_.Now();
    for (dds::RailLinePiece& piece : PiecesOf(line, config_.publish_step_m)) {
      piece.machine_id = std::string_view(config_.machine_id);
      piece.published_at = now;
      lines_.Write(piece);
    }
    TellOnce(
        "line_made",
        dds::Severity::kInfo,
        fmt::format("{}: {:.3f} m", folders_.LinePath(run_id_), line.points.back().distance_m));
  }

  void TellComparison(const RailOutcome& outcome) {
    if (!outcome.no_comparison.empty()) {
      TellOnce("not_compared", dds::Severity::kWarning, outcome.no_comparison);
    }
    if (!outcome.comparison) return;
    const LineComparison& comparison = *outcome.comparison;
    const Timestamp now = clock_.Now();
    for (dds::SettlementPiece piece : comparison.pieces) {
      piece.machine_id = std::string_view(config_.machine_id);
      piece.published_at = now;
      settlements_.Write(piece);
    }
    TellOnce("compared",
             dds::Severity::kInfo,
             fmt::format("against {}: {}", config_.base_line, comparison.told));
    const auto watch = [&](RailAlarm alarm, std::size_t size) {
      const std::string what =
          size > 0 ? fmt::format("size {}; {}", size, comparison.told) : std::string();
      alarms_.Watch(alarm, static_cast<double>(size), now, what);
    };
    watch(RailAlarm::kSettlementFound, comparison.alert);
    watch(RailAlarm::kDatumShift, comparison.datum_alert);
  }

  // Whoever comes a moment later still gets the line.
  void Hold(const std::stop_token& stop, const std::function<void()>& on_alive) {
    const auto begin = clock_.Steady();
    const auto hold = std::chrono::duration_cast<steady_clock::duration>(
        std::chrono::duration<double>(config_.hold_s));
    health_due_ = {};
    const auto is_over = [&] {
      const auto held = clock_.Steady() - begin;
      return held >= hold || (stop.stop_requested() && held >= kFarewell);
    };
    do {
      BeatWhenDue();
      if (on_alive) on_alive();
      std::this_thread::sleep_for(kTick);
    } while (!is_over());
  }

  struct DeviceSince {
    dds::DeviceState state = dds::DeviceState::kClosed;
    Timestamp at;
  };

  const RailLineConfig& config_;
  const RailSetup& setup_;
  RunFolders& folders_;
  const Clock& clock_;
  const EvenClock even_clock_;  // of the instruments
  const std::string run_id_;
  const std::string rail_yaml_sha256_;
  const std::unique_ptr<RailSource> source_;
  RailTracker tracker_;
  RailRecorder recorder_;
  RailAlarms alarms_;
  std::vector<RailInput> inputs_;
  bool has_ended_ = false;
  bool is_asked_to_end_ = false;
  Timestamp newest_sample_;
  steady_clock::time_point heard_at_{};  // the unit, by a newer sample
  steady_clock::time_point state_due_{};
  steady_clock::time_point health_due_{};
  std::uint64_t samples_ = 0;
  std::uint64_t tilts_ = 0;
  std::uint64_t images_ = 0;
  std::uint64_t late_told_ = 0;
  std::uint64_t state_number_ = 0;
  std::uint64_t event_number_ = 0;
  std::map<std::string, DeviceSince> since_;
  std::set<std::string> answered_;
  dds::Publisher<dds::TrolleyState> states_;
  dds::Publisher<dds::RailLinePiece> lines_;
  dds::Publisher<dds::SettlementPiece> settlements_;
  dds::Publisher<dds::CalibrationStatus> calibrations_;
  dds::Publisher<dds::DeviceHealth> health_;
  dds::Publisher<dds::AlarmStatus> alarm_statuses_;
  dds::Publisher<dds::Event> events_;
  dds::Publisher<dds::CommandReply> replies_;
  std::mutex mutex_;  // guards the two below
  std::vector<dds::Command> commands_;
  std::vector<dds::Alarm> reported_;
  std::optional<dds::Subscriber<dds::Command>> commands_in_;  // last: it stops first
};

RailLineProcess::RailLineProcess(const RailLineConfig& config,
                                 const RailRun& run,
                                 const Texts& texts,
                                 RunFolders& folders,
                                 dds::Participant& participant,
                                 const Clock& clock)
    : impl_(std::make_unique<Impl>(config, run, texts, folders, participant, clock)) {}
RailLineProcess::~RailLineProcess() = default;
ExitCode RailLineProcess::Run(const std::stop_token& stop, const std::function<void()>& on_alive) {
  return impl_->Run(stop, on_alive);
}
void RailLineProcess::Report(const dds::Alarm& alarm) { impl_->Report(alarm); }

}  // namespace tbm
