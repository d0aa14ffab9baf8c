#include "guidance/app/rail_line_process.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <future>
#include <mutex>
#include <optional>
#include <set>
#include <sstream>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "guidance/app/line_command.h"
#include "guidance/app/line_file.h"
#include "guidance/app/rail_alarms.h"
#include "guidance/app/rail_devices.h"
#include "guidance/app/rail_recorder.h"
#include "guidance/app/rail_replay.h"
#include "guidance/app/rail_words.h"
#include "guidance/config/sha256.h"
#include "guidance/core/alarm_command.h"
#include "guidance/rail/rail_tracker.h"
#include "guidance/rail/settlement.h"
#include "idl/cpp/dds_process.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;
using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kTick{10};
constexpr std::chrono::milliseconds kStatePeriod{100};
constexpr std::chrono::seconds kHealthPeriod{1};
constexpr std::size_t kMostReports = 256;
constexpr std::size_t kMostCommands = 64;
constexpr std::size_t kMostAnswered = 64;

// "rail_20261123_114500", by its beginning; another number behind it where there is one already.
std::string RunIdAt(Timestamp now, const RailLineConfig& config) {
  const auto seconds = static_cast<std::time_t>(now.ns / 1'000'000'000);
  const std::string id = fmt::format("rail_{:%Y%m%d_%H%M%S}", fmt::gmtime(seconds));
  const auto is_taken = [&](const std::string& name) {
    std::error_code ignored;
    for (const std::string& folder : {config.runs_folder, config.lines_folder}) {
      const std::string path = folder + "/" + name;
      if (fs::exists(path, ignored) || fs::exists(path + std::string(kUnfinished), ignored)) {
        return true;
      }
    }
    return false;
  };
  std::string name = id;
  for (int number = 2; is_taken(name); ++number) name = fmt::format("{}_{}", id, number);
  return name;
}

std::vector<std::string> UnfinishedIn(const std::string& folder) {
  std::vector<std::string> found;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.starts_with("rail_") && name.ends_with(kUnfinished)) found.push_back(it->path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<std::string> NamesOf(const std::vector<SurveyedTarget>& targets) {
  std::vector<std::string> names;
  for (const SurveyedTarget& target : targets) names.push_back(target.name);
  return names;
}

// What became of a run: a line, or why there is none; and what it was compared with.
struct Outcome {
  std::optional<FinishedLine> line;
  std::string trouble;  // why there is no line
  std::string remarks;  // of the one who made it
  std::vector<dds::SettlementPiece> settlement;
  std::string no_settlement;  // why there is none, where a base is given
};

// line.csv and its digest.
Result<FinishedLine, std::string> ReadFinished(const std::string& path, std::string run_id) {
  auto text = ReadTextFile(path);
  if (!text) return Failure{text.error().Text()};
  auto line = ReadLineFile(path);
  if (!line) return Failure{line.error().front().Text()};
  return FinishedLine{std::move(run_id), Sha256(*text), std::move(line->points)};
}

// The base's run is named by its folder.
std::string RunOfLine(const std::string& path) {
  std::error_code ignored;
  const fs::path whole = fs::absolute(path, ignored);
  std::string name = whole.parent_path().filename().string();
  return name.empty() ? "base" : name;
}

void Compare(const RailLineConfig& config, Outcome* outcome) {
  if (config.base_line.empty()) return;
  const auto base = ReadFinished(config.base_line, RunOfLine(config.base_line));
  if (!base) {
    outcome->no_settlement = base.error();
    return;
  }
  SettlementOptions options;
  options.step_m = config.settlement_step_m;
  options.level = config.settlement_level;
  options.alert_m = config.alert_m;
  const std::vector<RailPoint> epochs[] = {base->points, outcome->line->points};
  const auto settlement = CompareEpochs(epochs, options);
  if (!settlement) {
    outcome->no_settlement =
        fmt::format("{} and this line cannot be compared; tbm settle says why", config.base_line);
    return;
  }
  outcome->settlement = PiecesOf(*settlement, *base, *outcome->line, config.settlement_level);
}

// Both files of the line at once, by the way of `tbm line`.
Outcome MakeLine(const RailLineConfig& config, const std::string& run, const std::string& run_id) {
  Outcome outcome;
  const std::string folder = config.lines_folder + "/" + run_id;
  const std::string unborn = folder + std::string(kUnfinished);
  std::error_code error;
  fs::create_directories(unborn, error);
  if (error) {
    outcome.trouble = fmt::format("{}: {}", unborn, error.message());
    return outcome;
  }
  std::ostringstream said;
  std::ostringstream complaints;
  const Console console{said, complaints};
  const ExitCode code = RunLine({.run = run, .out = unborn + "/line.csv"}, console);
  outcome.remarks = complaints.str();
  if (code != ExitCode::kDone) {
    outcome.trouble = complaints.str();
    fs::remove_all(unborn, error);
    return outcome;
  }
  SyncFolder(unborn);
  fs::rename(unborn, folder, error);
  if (error) {
    outcome.trouble = fmt::format("{}: {}", folder, error.message());
    return outcome;
  }
  SyncFolder(config.lines_folder);
  auto line = ReadFinished(folder + "/line.csv", run_id);
  if (!line) {
    outcome.trouble = line.error();
    return outcome;
  }
  outcome.line = std::move(line).value();
  Compare(config, &outcome);
  return outcome;
}

std::unique_ptr<RailSource> SourceOf(const RailLineConfig& config,
                                     const RailRun& run,
                                     dds::Participant& participant,
                                     const Clock& clock) {
  if (config.replay) return std::make_unique<RailReplay>(run.recording, *config.replay);
  return std::make_unique<RailDevices>(config, run.recording.targets.size(), participant, clock);
}

std::string FirstLine(const std::string& text) { return text.substr(0, text.find('\n')); }

}  // namespace

class RailLineProcess::Impl {
 public:
  Impl(const RailLineConfig& config,
       const RailRun& run,
       const Texts& texts,
       dds::Participant& participant,
       const Clock& clock)
      : config_(config),
        setup_(run.setup),
        clock_(clock),
        started_at_(clock.Now()),
        run_id_(RunIdAt(started_at_, config)),
        rail_yaml_sha256_(Sha256(texts.rail_yaml)),
        source_(SourceOf(config, run, participant, clock)),
        tracker_(run.setup, run.recording.targets, {.lag_s = config.lag_s}),
        recorder_(config.runs_folder + "/" + run_id_,
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
    CleanUp();
    if (const auto failed = recorder_.Begin()) {
      Watch(RailAlarm::kRunNotWritten, true, *failed);
      Beat(clock_.Now());
      return ExitCode::kBadInput;
    }
    Tell("run_begun", dds::Severity::kInfo, false, fmt::format("run {}", run_id_));
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
    Hold(on_alive);
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

  // After a power cut: a line that was being made is nobody's; what was measured is told.
  void CleanUp() {
    std::error_code ignored;
    for (const std::string& path : UnfinishedIn(config_.lines_folder)) {
      fs::remove_all(path, ignored);
    }
    for (const std::string& path : UnfinishedIn(config_.runs_folder)) {
      Tell("unfinished_run",
           dds::Severity::kWarning,
           false,
           fmt::format("{} was left by a process that died; tbm line may still make its line",
                       path));
    }
  }

  void TakeInputs() {
    source_->Take(clock_.Steady(), &inputs_);
    for (const RailInput& input : inputs_) {
      recorder_.Add(input);
      std::visit([this](const auto& one) { Count(one); }, input);
    }
  }

  void Count(const ImuSample& sample) {
    ++samples_;
    heard_at_ = clock_.Steady();
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
    return !has_ended_ && silent.count() > config_.imu_silent_after_s;
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
    Watch(RailAlarm::kStartFailed, tracker_.phase() == RailTrackerPhase::kStartFailed);
    Watch(RailAlarm::kComesTooLate, tracker_.came_too_late() > late_told_);
    late_told_ = tracker_.came_too_late();
  }

  void Watch(RailAlarm alarm, bool holds, const std::string& what = "") {
    alarms_.Watch(alarm, holds ? 1.0 : 0.0, clock_.Now(), what);
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
    TellHealth(now);
    TellAlarms(true, now);
  }

  void TellHealth(Timestamp now) {
    const bool is_silent = IsImuSilent();
    const auto state = [&](std::uint64_t heard, bool silent) {
      if (has_ended_) return dds::DeviceState::kClosed;
      if (heard == 0) return dds::DeviceState::kOpening;
      return silent ? dds::DeviceState::kSilent : dds::DeviceState::kStreaming;
    };
    WriteHealth("rail_line", dds::DeviceState::kStreaming, states_.counters().written, 0, now);
    WriteHealth("imu", state(samples_, is_silent), samples_, tracker_.gaps(), now);
    if (setup_.tilt) WriteHealth("inclinometer", state(tilts_, false), tilts_, 0, now);
    if (setup_.camera) WriteHealth("targets", state(images_, false), images_, 0, now);
  }

  void WriteHealth(std::string_view device,
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
    Tell("run_ended",
         dds::Severity::kInfo,
         false,
         fmt::format("{}: {} samples", recorder_.folder(), recorder_.samples()));
    std::future<Outcome> making = std::async(
        std::launch::async, [this] { return MakeLine(config_, recorder_.folder(), run_id_); });
    while (making.wait_for(kTick) != std::future_status::ready) {
      BeatWhenDue();
      if (on_alive) on_alive();
    }
    const Outcome outcome = making.get();
    if (!outcome.line) {
      fmt::print(stderr, "{}", outcome.trouble);
      Watch(RailAlarm::kLineNotWritten, true, FirstLine(outcome.trouble));
      return ExitCode::kBadInput;
    }
    TellLine(outcome);
    return ExitCode::kDone;
  }

  void TellLine(const Outcome& outcome) {
    const Timestamp now = clock_.Now();
    for (dds::RailLinePiece& piece : PiecesOf(*outcome.line, config_.publish_step_m)) {
      piece.machine_id = std::string_view(config_.machine_id);
      piece.published_at = now;
      lines_.Write(piece);
    }
    Tell("line_made",
         dds::Severity::kInfo,
         false,
         fmt::format("{}/{}: {:.3f} m",
                     config_.lines_folder,
                     run_id_,
                     outcome.line->points.back().distance_m));
    if (!outcome.no_settlement.empty()) {
      Tell("not_compared", dds::Severity::kWarning, false, outcome.no_settlement);
    }
    int highest = 0;
    for (dds::SettlementPiece piece : outcome.settlement) {
      highest = piece.highest_alert;
      piece.machine_id = std::string_view(config_.machine_id);
      piece.published_at = now;
      settlements_.Write(piece);
    }
    alarms_.Watch(
        RailAlarm::kSettlementFound,
        highest,
        now,
        highest > 0 ? fmt::format("alert {} against {}", highest, config_.base_line) : "");
  }

  // Whoever comes a moment later still gets the line.
  void Hold(const std::function<void()>& on_alive) {
    const auto until = clock_.Steady() + std::chrono::duration_cast<steady_clock::duration>(
                                             std::chrono::duration<double>(config_.hold_s));
    health_due_ = {};
    do {
      BeatWhenDue();
      if (on_alive) on_alive();
      std::this_thread::sleep_for(kTick);
    } while (clock_.Steady() < until);
  }

  struct DeviceSince {
    dds::DeviceState state = dds::DeviceState::kClosed;
    Timestamp at;
  };

  const RailLineConfig& config_;
  const RailSetup& setup_;
  const Clock& clock_;
  const Timestamp started_at_;
  const std::string run_id_;
  const std::string rail_yaml_sha256_;
  const std::unique_ptr<RailSource> source_;
  RailTracker tracker_;
  RailRecorder recorder_;
  RailAlarms alarms_;
  std::vector<RailInput> inputs_;
  bool has_ended_ = false;
  bool is_asked_to_end_ = false;
  steady_clock::time_point heard_at_{};  // the unit
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
                                 dds::Participant& participant,
                                 const Clock& clock)
    : impl_(std::make_unique<Impl>(config, run, texts, participant, clock)) {}
RailLineProcess::~RailLineProcess() = default;
ExitCode RailLineProcess::Run(const std::stop_token& stop, const std::function<void()>& on_alive) {
  return impl_->Run(stop, on_alive);
}
void RailLineProcess::Report(const dds::Alarm& alarm) { impl_->Report(alarm); }

}  // namespace tbm
