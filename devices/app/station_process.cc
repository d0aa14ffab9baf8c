#include "devices/app/station_process.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <thread>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "devices/app/station_state_file.h"

namespace tbm {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using SteadyTime = std::chrono::steady_clock::time_point;

constexpr seconds kLongAway(60);    // after which the set-up is checked before anything else
constexpr seconds kRoundWaits(30);  // for a connection that broke in the middle of a round
constexpr milliseconds kLook(200);  // how long a wait may keep a command waiting
constexpr seconds kBeatPeriod(1);
constexpr std::chrono::minutes kHangs(5);  // longer than any pointing with all its attempts
constexpr std::size_t kRemembered = 64;

bool IsActive(AlarmState state) {
  return state == AlarmState::kUnacknowledged || state == AlarmState::kAcknowledged;
}

// The same but for the moment of sending.
bool SameContent(dds::StationSetUp a, const dds::StationSetUp& b) {
  a.published_at = b.published_at;
  const auto same_numbers = [](double x, double y) { return x == y || (x != x && y != y); };
  return a.set_up_number == b.set_up_number && a.state == b.state && a.reason == b.reason &&
         a.set_up_at == b.set_up_at && a.last_good_check_at == b.last_good_check_at &&
         same_numbers(a.closure_worst_m, b.closure_worst_m) && same_numbers(a.sees_m, b.sees_m);
}

}  // namespace

StationProcess::StationProcess(const StationConfig& config,
                               const Machine& machine,
                               TotalStation& instrument,
                               const Clock& clock,
                               Sleeper& sleeper,
                               StationSink& sink)
    : config_(config),
      names_{machine.machine_id, config.station},
      instrument_(instrument),
      clock_(clock),
      sleeper_(sleeper),
      sink_(sink),
      keeper_(KeeperOptionsOf(config, machine)),
      answered_at_(clock.Steady()),
      board_(StationAlarmRules(config)) {
  health_.state_since = clock.Now();
  Restore();
  const std::lock_guard lock(mutex_);
  Conclude();
}

void StationProcess::Restore() {
  auto loaded = LoadKeptStation(config_.state_file);
  if (loaded) {
    if (*loaded) keeper_.Restore(**loaded);
    saved_revision_ = keeper_.revision();
    return;
  }
  // It is kept aside for whoever wants to know, and a new set-up is made.
  std::error_code ignored;
  std::filesystem::rename(config_.state_file, config_.state_file + ".damaged", ignored);
  const std::lock_guard lock(mutex_);
  Raise("state_damaged", dds::Severity::kWarning, false, loaded.error() + "; a new set-up is made");
}

void StationProcess::Hear(const dds::Command& command) {
  if (command.machine_id.view() != names_.machine_id ||
      command.addressee.view() != kStationSource) {
    return;
  }
  const std::lock_guard lock(inbox_mutex_);
  if (commands_.size() < kRemembered) commands_.push_back(command);
}

void StationProcess::Hear(const dds::ShieldPose& pose) {
  if (pose.machine_id.view() != names_.machine_id || pose.shield.view() != "rear") return;
  if (pose.validity == dds::Validity::kInvalid) return;
  const std::lock_guard lock(inbox_mutex_);
  pose_ = pose;
}

void StationProcess::Report(const dds::Alarm& alarm) {
  if (!alarm.ChangesKind()) return;
  const std::lock_guard lock(mutex_);
  Raise(dds::AlarmCode(alarm.kind),
        alarm.active ? dds::Severity::kAlarm : dds::Severity::kInfo,
        alarm.active,
        alarm.text);
}

bool StationProcess::TakeInbox() {
  std::vector<dds::Command> commands;
  std::optional<dds::ShieldPose> pose;
  {
    const std::lock_guard lock(inbox_mutex_);
    commands.swap(commands_);
    pose.swap(pose_);
  }
  if (pose) {
    ShieldBelief belief{pose->valid_at, pose->site_from_shield, pose->covariance, 0.0, 2e-3};
    if (std::isfinite(pose->speed_m_per_s)) belief.speed_m_per_s = pose->speed_m_per_s;
    if (std::isfinite(pose->speed_sigma_m_per_s)) {
      belief.speed_sigma_m_per_s = pose->speed_sigma_m_per_s;
    }
    keeper_.Believe(belief);
  }
  for (const dds::Command& command : commands) Obey(command);
  return !commands.empty();
}

bool StationProcess::StayConnected() {
  if (instrument_.IsConnected()) {
    answered_at_ = clock_.Steady();
    return true;
  }
  const auto connected = instrument_.Connect(clock_.Steady() + seconds(1));
  if (!connected) {
    if (clock_.Steady() - answered_at_ > kRoundWaits) keeper_.AbandonRound();
    return false;
  }
  MeetInstrument(*connected);
  if (clock_.Steady() - answered_at_ > kLongAway)
    keeper_.DistrustUntilChecked("instrument_was_away");
  answered_at_ = clock_.Steady();
  return true;
}

void StationProcess::MeetInstrument(const StationIdentity& identity) {
  if (serial_number_ && *serial_number_ != identity.serial_number) {
    const std::lock_guard lock(mutex_);
    Raise("other_instrument",
          dds::Severity::kAlarm,
          false,
          fmt::format(
              "another instrument answers: {} number {}", identity.model, identity.serial_number));
  }
  serial_number_ = identity.serial_number;
  keeper_.SetInstrument(identity.serial_number);
  is_constant_set_ = is_air_set_ = false;
  (void)instrument_.ReadPower();
}

// So that the instrument's own display is right. What it has really applied comes with each
// observation, and the rest is added here: whatever the instrument refuses may stay as it is, but
// what got lost on the line is told again, because what it then applies nobody knows.
void StationProcess::ApplySettings() {
  const auto is_settled = [](const Result<Done, StationFault>& result) {
    return result || result.error().why == StationFailure::kSettingNotTaken ||
           result.error().why == StationFailure::kNotSupported ||
           result.error().why == StationFailure::kBadParameter;
  };
  if (!is_constant_set_) {
    is_constant_set_ = is_settled(instrument_.SetPrismConstant(config_.prism_constant_m));
  }
  if (!is_air_set_) {
    is_air_set_ = is_settled(
        instrument_.SetAtmosphere(AirCorrection_ppm(config_.distance.air, config_.distance.meter)));
  }
}

void StationProcess::Step(const std::function<bool()>& is_ending) {
  step_at_ = clock_.Steady().time_since_epoch().count();
  TakeInbox();
  if (StayConnected() && !is_ending()) {
    if (const auto pointing = keeper_.Next(clock_.Now())) {
      Measure(*pointing, is_ending);
    } else {
      Idle();
    }
  }
  AfterWork();
}

// A question now and then shows whether the instrument is still there.
void StationProcess::Idle() {
  const SteadyTime now = clock_.Steady();
  if (now - power_read_at_ >= config_.silent_after / 2) {
    power_read_at_ = now;
    (void)instrument_.ReadPower();
  }
  const Duration wait =
      std::clamp<Duration>(keeper_.wait_until() - clock_.Now(), milliseconds(10), kLook);
  sleeper_.SleepUntil(clock_.Steady() + wait);
}

void StationProcess::Measure(const Pointing& pointing, const std::function<bool()>& is_ending) {
  ApplySettings();
  StationPointer pointer(config_, instrument_, clock_, is_ending);
  const StationPointer::Outcome outcome = pointer.Carry(pointing);
  if (is_ending()) return;
  if (outcome.pointed.doubt == "setting_unknown") is_constant_set_ = is_air_set_ = false;
  Judged judged;
  if (outcome.is_gone) {
    // Told again when it is back.
    judged.target = pointing.target;
    judged.face = pointing.face;
    judged.cycle_number = pointing.cycle_number;
    judged.reason = outcome.pointed.failure;
  } else {
    judged = keeper_.Take(outcome.pointed);
  }
  Tell(judged, outcome);
}

void StationProcess::Tell(const Judged& judged, const StationPointer::Outcome& outcome) {
  auto message =
      ObservationOf(names_, keeper_.options(), judged, outcome.pointed, outcome.observation);
  const std::lock_guard lock(mutex_);
  message.sample_number = ++observations_;
  message.published_at = clock_.Now();
  if (message.status == dds::ObservationStatus::kNone) {
    ++observations_lost_;
  } else {
    ++observations_good_;
  }
  sink_.Publish(message);
  auto& tilted = watched_[static_cast<std::size_t>(StationAlarm::kStationTilted)];
  if (outcome.fault && outcome.fault->why == StationFailure::kTilted) {
    tilted = 1.0;
  } else if (outcome.observation) {
    tilted = 0.0;
  }
}

void StationProcess::AfterWork() {
  Save();
  const std::lock_guard lock(mutex_);
  TellNews();
  Conclude();
  SendSetUps(false);
  SendAlarms(false);
}

void StationProcess::Save() {
  if (keeper_.revision() == saved_revision_) return;
  const int error = SaveKeptStation(config_.state_file, keeper_.state());
  if (error == 0) {
    saved_revision_ = keeper_.revision();
    was_told_unsaved_ = false;
    return;
  }
  if (was_told_unsaved_) return;
  was_told_unsaved_ = true;
  const std::lock_guard lock(mutex_);
  Raise("state_not_saved",
        dds::Severity::kWarning,
        false,
        fmt::format("{}: {}; after a restart the station has an older set-up or none",
                    config_.state_file,
                    std::generic_category().message(error)));
}

void StationProcess::TellNews() {
  using Kind = KeeperNews::Kind;
  for (const KeeperNews& news : keeper_.TakeNews()) {
    const bool is_bad = news.kind == Kind::kSetUpFailed || news.kind == Kind::kCheckBad ||
                        news.kind == Kind::kMoveFailed;
    std::string_view code = "station_move";
    if (news.kind == Kind::kSetUpDone || news.kind == Kind::kSetUpFailed) code = "set_up";
    if (news.kind == Kind::kCheckGood || news.kind == Kind::kCheckBad) code = "reference_check";
    if (news.kind == Kind::kPaused) code = "paused";
    Raise(code, is_bad ? dds::Severity::kWarning : dds::Severity::kInfo, false, news.text);
    std::erase_if(pending_, [&](const Pending& pending) {
      const bool done = std::ranges::find(pending.done, news.kind) != pending.done.end();
      const bool failed = std::ranges::find(pending.failed, news.kind) != pending.failed.end();
      if (!done && !failed) return false;
      Reply(pending.command,
            done ? dds::CommandOutcome::kDone : dds::CommandOutcome::kFailed,
            news.text);
      return true;
    });
  }
}

// What the keeper and the instrument say now, in the words of the topics.
void StationProcess::Conclude() {
  const auto set = [this](StationAlarm alarm, double value, std::string detail = {}) {
    const auto i = static_cast<std::size_t>(alarm);
    watched_[i] = value;
    if (value > 0.0) details_[i] = std::move(detail);
  };
  set_ups_["in_use"] = InUseOf(names_, keeper_);
  const auto only_if_ever = [this](const dds::StationSetUp& message) {
    const std::string role(message.role.view());
    if (message.state != dds::SetUpState::kNone || set_ups_.count(role) != 0) {
      set_ups_[role] = message;
    }
  };
  only_if_ever(ProposedOf(names_, keeper_));
  only_if_ever(PreviousOf(names_, keeper_));

  const std::string& reason = keeper_.reason();
  const bool is_suspect = keeper_.health() == SetUpHealth::kSuspect;
  const bool moved = is_suspect && reason == "station_moved";
  std::string shift;
  if (moved && keeper_.station_shift()) {
    const Eigen::Vector4d& by = *keeper_.station_shift();
    shift = fmt::format("E {:+.1f} N {:+.1f} U {:+.1f} mm", 1e3 * by[0], 1e3 * by[1], 1e3 * by[2]);
  }
  set(StationAlarm::kStationMoved, moved ? 1.0 : 0.0, shift);
  set(StationAlarm::kSetUpMissing, keeper_.health() == SetUpHealth::kNone ? 1.0 : 0.0, reason);
  const bool vouched = !(reason == "check_unclear" || reason == "references_not_seen" ||
                         reason == "check_overdue" || reason == "check_weak");
  set(StationAlarm::kSetUpSuspect, is_suspect && !vouched ? 1.0 : 0.0, reason);
  const auto names = keeper_.moved_references();
  set(StationAlarm::kReferenceDisagrees,
      !names.empty() || (is_suspect && reason == "reference_disagrees") ? 1.0 : 0.0,
      fmt::format("{}", fmt::join(names, ", ")));
  int missed = 0;
  std::string missing;
  std::string wrong;
  std::string swapped;
  const auto list = [](std::string& all, const std::string& name) {
    all += (all.empty() ? "" : ", ") + name;
  };
  for (int i = 0; i < static_cast<int>(keeper_.options().prisms.size()); ++i) {
    const std::string& name = keeper_.options().prisms[static_cast<std::size_t>(i)].name;
    missed = std::max(missed, keeper_.times_missed(i));
    if (keeper_.times_missed(i) >= config_.missed_rounds) {
      list(missing, fmt::format("{} ({})", name, keeper_.missed_because(i)));
    }
    const auto& judged = keeper_.judged(i);
    if (!judged) continue;
    std::string what = name;
    if (judged->rather) {
      what += " is " + keeper_.options().prisms[static_cast<std::size_t>(*judged->rather)].name;
    }
    if (judged->verdict == PrismVerdict::kWrong) {
      list(wrong, fmt::format("{}, {:.0f} mm off", what, 1e3 * judged->off_m));
    }
    if (judged->verdict == PrismVerdict::kSwapped) list(swapped, what);
  }
  set(StationAlarm::kPrismNotFound, missed, missing);
  set(StationAlarm::kWrongPrism, wrong.empty() ? 0.0 : 1.0, wrong);
  set(StationAlarm::kSwappedPrism, swapped.empty() ? 0.0 : 1.0, swapped);
}

void StationProcess::SendSetUps(bool all) {
  const Timestamp now = clock_.Now();
  for (auto& [role, message] : set_ups_) {
    const auto told = told_set_ups_.find(role);
    if (!all && told != told_set_ups_.end() && SameContent(message, told->second)) continue;
    message.published_at = now;
    sink_.Publish(message);
    told_set_ups_[role] = message;
  }
}

void StationProcess::SendAlarms(bool all) {
  const Timestamp now = clock_.Now();
  for (std::size_t i = 0; i < kStationAlarmCount; ++i) {
    board_.Update(i, watched_[i], now);
    const Alarm& alarm = board_.alarm(i);
    const bool has_changed = alarm.state != told_[i] || alarm.shelved_until != told_shelf_[i];
    if (!has_changed && !all) continue;
    if (alarm.state == AlarmState::kUnacknowledged) acknowledged_by_[i] = {};
    dds::AlarmStatus message = AlarmOf(names_, board_.rule(i), alarm, details_[i]);
    message.published_at = now;
    message.acknowledged_by = acknowledged_by_[i];
    if (alarm.shelved_until) {
      message.shelved_until = *alarm.shelved_until;
      message.shelved_by = shelved_by_[i].by;
      message.shelved_because = shelved_by_[i].because;
    }
    sink_.Publish(message);
    const bool was_active = IsActive(told_[i]);
    told_[i] = alarm.state;
    told_shelf_[i] = alarm.shelved_until;
    if (IsActive(alarm.state) == was_active) continue;
    Raise(board_.rule(i).code,
          board_.rule(i).priority == AlarmPriority::kLow ? dds::Severity::kWarning
                                                         : dds::Severity::kAlarm,
          IsActive(alarm.state),
          message.cause.view());
  }
}

void StationProcess::Raise(std::string_view code,
                           dds::Severity severity,
                           bool active,
                           std::string_view text) {
  dds::Event event;
  event.machine_id = std::string_view(names_.machine_id);
  event.source = kStationSource;
  event.code = code;
  event.at = clock_.Now();
  event.sample_number = ++events_;
  event.severity = severity;
  event.active = active;
  event.text = text;
  sink_.Publish(event);
}

void StationProcess::Beat() {
  const StationHealth health = instrument_.Health();
  const std::lock_guard lock(mutex_);
  dds::DeviceHealth message = HealthOf(names_, health);
  message.samples_good = observations_good_;
  message.samples_lost = observations_lost_;
  const bool has_changed = message.state != health_.state || !health_.published_at.ns;
  message.state_since = has_changed ? clock_.Now() : health_.state_since;
  watched_[static_cast<std::size_t>(StationAlarm::kStationSilent)] =
      health.state == StationState::kReady ? 0.0 : 1.0;
  if (health.power) {
    watched_[static_cast<std::size_t>(StationAlarm::kLowPower)] =
        health.power->is_external ? 0.0 : 100.0 - health.power->capacity_percent;
  }
  const SteadyTime now = clock_.Steady();
  const bool is_due = now - beaten_at_ >= kBeatPeriod || beaten_at_ == SteadyTime{};
  if (is_due || has_changed) {
    message.published_at = clock_.Now();
    sink_.Publish(message);
    health_ = message;
  }
  if (is_due) {
    beaten_at_ = now;
    SendSetUps(true);
  }
  SendAlarms(is_due);
}

void StationProcess::Run(const std::stop_token& stop, const std::function<void()>& on_alive) {
  const std::stop_callback on_stop(stop, [this] { instrument_.RequestAbort(); });
  step_at_ = clock_.Steady().time_since_epoch().count();
  std::jthread worker([&] {
    while (!stop.stop_requested()) Step([&] { return stop.stop_requested(); });
  });
  while (!stop.stop_requested()) {
    Beat();
    const SteadyTime step_at{SteadyTime::duration(step_at_.load())};
    if (on_alive && clock_.Steady() - step_at < kHangs) on_alive();
    std::this_thread::sleep_for(milliseconds(100));
  }
  worker.join();
}

}  // namespace tbm
