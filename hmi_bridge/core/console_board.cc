#include "hmi_bridge/core/console_board.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "idl/cpp/words.h"
#include "pose/base/angle.h"

namespace tbm::hmi {
namespace {

// A process is silent when it has missed this much; what it is waited for at the start.
constexpr std::int64_t kGuidanceSilent_ms = 800;
constexpr std::int64_t kSilent_ms = 3000;
constexpr std::int64_t kStart_ms = 10'000;
constexpr std::int64_t kClockDoubt_ms = 2000;

constexpr std::size_t kMostEvents = 60;
constexpr std::size_t kMostTargets = 64;
constexpr std::size_t kMostAxisPoints = 4000;
constexpr double kAxisStep_m = 5.0;

constexpr std::array<std::string_view, 12> kPartNames = {"bridge",
                                                         "machine",
                                                         "guidance",
                                                         "shields",
                                                         "camera",
                                                         "tilts",
                                                         "station",
                                                         "devices",
                                                         "alarms",
                                                         "events",
                                                         "commands",
                                                         "trolley"};

std::int64_t StaleMs(const SourceLimits& limits) {
  return static_cast<std::int64_t>(std::llround(limits.period_s * 2000.0));
}

Json AxisView(const DesignAxis& axis) {
  const double start_m = axis.start().m;
  const double length_m = axis.end().m - start_m;
  const double step_m = std::max(kAxisStep_m, length_m / static_cast<double>(kMostAxisPoints - 1));
  const auto steps = static_cast<std::size_t>(std::ceil(length_m / step_m));
  Json view = Json::array();
  for (std::size_t i = 0; i <= steps; ++i) {
    const double chainage_m = std::min(start_m + static_cast<double>(i) * step_m, axis.end().m);
    const auto point = axis.At(InternalChainage{chainage_m});
    if (!point) continue;
    view.push_back({{"chainage_m", Rounded(chainage_m, 3)},
                    {"bearing_deg", Rounded(RadToDeg(point->bearing_rad), 4)},
                    {"curvature_per_km", Rounded(point->curvature_right_per_m * 1e3, 4)},
                    {"gradient_percent", Rounded(point->gradient.value_or(dds::kNaN) * 1e2, 4)},
                    {"height_m", Rounded(point->up_m.value_or(dds::kNaN), 3)}});
  }
  return view;
}

std::vector<std::string> PointNames(const Machine& machine) {
  std::vector<std::string> names;
  for (const MachinePoint& point : machine.points) names.push_back(point.name);
  return names;
}

std::string KeyOf(const dds::AlarmStatus& status) {
  return std::string(status.source.view()) + "/" + std::string(status.code.view());
}

std::string Text(std::string_view text) { return std::string(text); }

Json TimeOrNull(Timestamp stamp) {
  return stamp == dds::kNever ? Json(nullptr) : Json(Milliseconds(stamp));
}

// An alarm as the page lists it, and what decides its place there.
struct ListedAlarm {
  std::string key;
  int urgency = 0;
  bool stands = false;
  std::int64_t raised_ms = 0;
  Json view;
};

ListedAlarm Listed(const dds::AlarmStatus& status, Json silent_since) {
  ListedAlarm listed;
  listed.key = KeyOf(status);
  listed.urgency = static_cast<int>(status.urgency);
  listed.stands = status.phase != dds::AlarmPhase::kNormal;
  listed.raised_ms = Milliseconds(status.raised_at);
  listed.view = {{"source", Text(status.source)},
                 {"code", Text(status.code)},
                 {"origin", "process"},
                 {"phase", Text(WordOf(status.phase))},
                 {"urgency", Text(WordOf(status.urgency))},
                 {"since_utc_ms", TimeOrNull(status.since)},
                 {"raised_at_utc_ms", TimeOrNull(status.raised_at)},
                 {"times_raised", status.times_raised},
                 {"value", Rounded(status.value, 3)},
                 {"raise_above", Rounded(status.raise_above, 3)},
                 {"clear_below", Rounded(status.clear_below, 3)},
                 {"unit", Text(status.unit)},
                 {"cause", Text(status.cause)},
                 {"response", Text(status.response)},
                 {"acknowledged_by", Text(status.acknowledged_by)},
                 {"shelved_until_utc_ms", TimeOrNull(status.shelved_until)},
                 {"shelved_by", Text(status.shelved_by)},
                 {"shelved_because", Text(status.shelved_because)},
                 {"silent_since_utc_ms", std::move(silent_since)}};
  return listed;
}

dds::AlarmUrgency UrgencyOf(AlarmPriority priority) {
  switch (priority) {
    case AlarmPriority::kLow:
      return dds::AlarmUrgency::kLow;
    case AlarmPriority::kMedium:
      return dds::AlarmUrgency::kMedium;
    case AlarmPriority::kHigh:
      return dds::AlarmUrgency::kHigh;
  }
  return dds::AlarmUrgency::kHigh;
}

ListedAlarm Listed(const std::string& key, const OwnAlarms::Entry& entry) {
  const Alarm& alarm = entry.alarm();
  const AlarmPriority priority = entry.board.rule(0).priority;
  const Timestamp raised_at = entry.is_event ? entry.raised_event_at : alarm.raised_at;
  const bool was_raised = alarm.times_raised > 0;
  ListedAlarm listed;
  listed.key = key;
  listed.urgency = static_cast<int>(UrgencyOf(priority));
  listed.stands = alarm.state != AlarmState::kNormal;
  listed.raised_ms = Milliseconds(raised_at);
  listed.view = {{"source", entry.source},
                 {"code", entry.code},
                 {"origin", entry.is_event ? "event" : "console"},
                 {"phase", Text(StateCode(alarm.state))},
                 {"urgency", Text(WordOf(UrgencyOf(priority)))},
                 {"since_utc_ms", was_raised ? Json(Milliseconds(alarm.since)) : Json(nullptr)},
                 {"raised_at_utc_ms", was_raised ? Json(Milliseconds(raised_at)) : Json(nullptr)},
                 {"times_raised", alarm.times_raised},
                 {"value", nullptr},
                 {"raise_above", nullptr},
                 {"clear_below", nullptr},
                 {"unit", ""},
                 {"cause", entry.cause},
                 {"response", entry.response},
                 {"acknowledged_by", entry.acknowledged_by},
                 {"shelved_until_utc_ms",
                  alarm.shelved_until ? Json(Milliseconds(*alarm.shelved_until)) : Json(nullptr)},
                 {"shelved_by", entry.shelved_by},
                 {"shelved_because", entry.shelved_because},
                 {"silent_since_utc_ms", nullptr}};
  return listed;
}

// The alarm of the bridge's own for one of its DDS side; empty for what it watches in another way.
std::optional<ConsoleAlarm> AlarmOf(dds::AlarmKind kind) {
  switch (kind) {
    case dds::AlarmKind::kSecondWriter:
      return ConsoleAlarm::kSecondWriter;
    case dds::AlarmKind::kInterfaceMismatch:
      return ConsoleAlarm::kInterfaceMismatch;
    case dds::AlarmKind::kIncompatibleQos:
      return ConsoleAlarm::kIncompatibleQos;
    case dds::AlarmKind::kRejected:
      return ConsoleAlarm::kSampleRejected;
    case dds::AlarmKind::kStartFailed:
      return ConsoleAlarm::kDdsStartFailed;
    case dds::AlarmKind::kNoNetwork:
    case dds::AlarmKind::kSilent:
      return {};
  }
  return {};
}

}  // namespace

ConsoleMachine ConsoleMachineOf(const Machine& machine,
                                const Rig& rig,
                                const DesignAxis& axis,
                                std::string machine_sha256,
                                std::vector<Calibration> calibrations) {
  Json leds = Json::array();
  for (const Led& led : rig.leds) leds.push_back(led.id);
  Json points = Json::array();
  for (const MachinePoint& point : machine.points) {
    points.push_back(
        {{"name", point.name}, {"shield", point.shield == ShieldName::kFront ? "front" : "rear"}});
  }
  Json due = Json::array();
  for (const Calibration& calibration : calibrations) {
    due.push_back({{"what", calibration.what},
                   {"done_at_utc_ms", Milliseconds(calibration.done_at)},
                   {"due_at_utc_ms", Milliseconds(calibration.due_at)}});
  }
  Json view = {
      {"machine_id", machine.machine_id},
      {"axis_name", axis.name()},
      {"axis_start_m", Rounded(axis.start().m, 3)},
      {"axis_end_m", Rounded(axis.end().m, 3)},
      {"steer_by", machine.points[machine.steer_by].name},
      {"deviation_limit_mm", Rounded(machine.deviation_m.raise_above * 1e3, 2)},
      {"predicted_limit_mm", Rounded(machine.predicted_deviation_m.raise_above * 1e3, 2)},
      {"sigma_limit_mm", Rounded(machine.sigma_m.raise_above * 1e3, 2)},
      {"roll_limit_deg", Rounded(RadToDeg(machine.roll_rad.raise_above), 3)},
      {"useful_sigma_mm", Rounded(machine.useful_sigma_m * 1e3, 2)},
      {"image_width_px", rig.camera.image_width_px},
      {"image_height_px", rig.camera.image_height_px},
      {"leds", std::move(leds)},
      {"points", std::move(points)},
      {"ring_length_mm", machine.rings ? Rounded(machine.rings->length_m * 1e3, 1) : Json(nullptr)},
      {"calibrations", std::move(due)},
      {"axis", AxisView(axis)}};
  return {machine,
          rig,
          std::move(machine_sha256),
          axis.file_sha256(),
          std::move(calibrations),
          std::move(view)};
}

ConsoleBoard::ConsoleBoard(ConsoleMachine machine, BridgeFacts facts, const Moment& now)
    : machine_(std::move(machine)),
      facts_(std::move(facts)),
      begun_(now),
      last_tick_(now),
      network_since_(now.utc),
      history_(PointNames(machine_.machine),
               machine_.machine.points[machine_.machine.steer_by].name) {
  static_assert(kPartNames.size() == kParts);
  for (PartText& text : texts_) text.version = ++version_;
}

template <class Message>
bool ConsoleBoard::IsOurs(const Message& message) {
  if (message.machine_id.view() == machine_.machine.machine_id) return true;
  ++of_other_machines_;
  return false;
}

void ConsoleBoard::Touch(Part part) {
  texts_[part].version = ++version_;
  texts_[part].is_old = true;
}

void ConsoleBoard::Add(const dds::Guidance& message, const Arrival& arrival, const Moment& now) {
  if (!IsOurs(message)) return;
  guidance_ = {message, arrival};
  // Which of two senders is right is not known: neither is remembered as what was.
  if (!arrival.contested) history_.Add(message);
  own_alarms_.Set(ConsoleAlarm::kOtherMachineFile,
                  message.machine_sha256.view() != machine_.machine_sha256 ||
                      message.axis_sha256.view() != machine_.axis_sha256);
  const std::int64_t by_stamp = Milliseconds(now.utc) - Milliseconds(message.valid_at);
  own_alarms_.Set(ConsoleAlarm::kClockDisagrees, std::abs(by_stamp) > kClockDoubt_ms);
  Touch(kGuidance);
}

void ConsoleBoard::Add(const dds::ShieldPose& message, const Arrival& arrival, const Moment&) {
  if (!IsOurs(message)) return;
  shields_.insert_or_assign(std::string(message.shield.view()),
                            Heard<dds::ShieldPose>{message, arrival});
  Touch(kShields);
}

void ConsoleBoard::Add(const dds::RelativePose& message, const Arrival& arrival, const Moment&) {
  if (!IsOurs(message)) return;
  pose_ = {message, arrival};
  Touch(kCamera);
}

void ConsoleBoard::Add(const dds::FrameFeatures& message, const Arrival& arrival, const Moment&) {
  if (!IsOurs(message)) return;
  frame_ = {message, arrival};
  Touch(kCamera);
}

void ConsoleBoard::Add(const dds::TiltReading& message, const Arrival& arrival, const Moment&) {
  if (!IsOurs(message)) return;
  tilts_.insert_or_assign(std::string(message.sensor.view()),
                          Heard<dds::TiltReading>{message, arrival});
  Touch(kTilts);
}

void ConsoleBoard::Add(const dds::StationSetUp& message, const Arrival& arrival, const Moment&) {
  if (!IsOurs(message)) return;
  set_ups_.insert_or_assign(std::string(message.role.view()),
                            Heard<dds::StationSetUp>{message, arrival});
  Touch(kStation);
}

void ConsoleBoard::Add(const dds::StationObservation& message, const Arrival&, const Moment&) {
  if (!IsOurs(message)) return;
  observations_.insert_or_assign(std::string(message.target.view()), message);
  if (observations_.size() > kMostTargets) {
    observations_.erase(std::min_element(
        observations_.begin(), observations_.end(), [](const auto& one, const auto& other) {
          return one.second.sensed_at < other.second.sensed_at;
        }));
  }
  Touch(kStation);
}

void ConsoleBoard::Add(const dds::DeviceHealth& message, const Arrival& arrival, const Moment&) {
  if (!IsOurs(message)) return;
  devices_.insert_or_assign(std::string(message.device_id.view()),
                            Heard<dds::DeviceHealth>{message, arrival});
  Touch(kDevices);
}

void ConsoleBoard::Add(const dds::AlarmStatus& message, const Arrival& arrival, const Moment& now) {
  if (!IsOurs(message)) return;
  own_alarms_.Forget(message.source.view(), message.code.view());
  alarms_.insert_or_assign(KeyOf(message), ToldAlarm{message, arrival, now.utc});
  Touch(kAlarms);
}

void ConsoleBoard::Add(const dds::Event& message, const Arrival&, const Moment& now) {
  if (!IsOurs(message)) return;
  // What a late reader gets of the past is not in the order of time.
  const auto place = std::find_if(events_.begin(), events_.end(), [&](const dds::Event& event) {
    return event.at <= message.at;
  });
  events_.insert(place, message);
  if (events_.size() > kMostEvents) events_.pop_back();
  Touch(kEvents);
  const std::string key =
      std::string(message.source.view()) + "/" + std::string(message.code.view());
  if (alarms_.contains(key)) return;
  own_alarms_.Add(message, now.utc);
  Touch(kAlarms);
}

void ConsoleBoard::Add(const dds::CommandReply& message, const Arrival&, const Moment&) {
  if (IsOurs(message) && commands_.Add(message)) Touch(kCommands);
}

void ConsoleBoard::Add(const dds::TrolleyState& message, const Arrival& arrival, const Moment&) {
  if (!IsOurs(message)) return;
  trolley_ = {message, arrival};
  Touch(kTrolley);
}

void ConsoleBoard::Add(const dds::SettlementPiece& message, const Arrival&, const Moment&) {
  if (!IsOurs(message)) return;
  settlement_ = message;
  Touch(kTrolley);
}

void ConsoleBoard::Add(const dds::Alarm& alarm, const Moment& now) {
  const auto own = AlarmOf(alarm.kind);
  if (!own || !alarm.ChangesKind()) return;
  own_alarms_.Set(*own, alarm.active, alarm.text);
  if (own_alarms_.Tick(now.utc)) Touch(kAlarms);
}

void ConsoleBoard::SetNetwork(bool is_running, const Moment& now) {
  own_alarms_.Set(ConsoleAlarm::kNoNetwork, !is_running);
  if (is_running == network_runs_) return;
  network_runs_ = is_running;
  network_since_ = now.utc;
  Touch(kBridge);
}

void ConsoleBoard::WatchSilence(const Moment& now) {
  const auto is_silent = [&](const std::optional<std::int64_t>& heard_steady_ms,
                             std::int64_t after_ms) -> std::optional<bool> {
    if (heard_steady_ms) return now.steady_ms - *heard_steady_ms > after_ms;
    if (now.steady_ms - begun_.steady_ms > kStart_ms) return true;
    return {};
  };
  std::optional<std::int64_t> guidance_heard;
  if (guidance_) guidance_heard = guidance_->arrival.heard_steady_ms;
  own_alarms_.Set(ConsoleAlarm::kGuidanceSilent, is_silent(guidance_heard, kGuidanceSilent_ms));
  std::optional<std::int64_t> camera_heard;
  if (pose_) camera_heard = pose_->arrival.heard_steady_ms;
  own_alarms_.Set(ConsoleAlarm::kCameraBoxSilent, is_silent(camera_heard, kSilent_ms));
  std::optional<std::int64_t> station_heard;
  for (const auto& [role, heard] : set_ups_) {
    station_heard = std::max(station_heard.value_or(heard.arrival.heard_steady_ms),
                             heard.arrival.heard_steady_ms);
  }
  own_alarms_.Set(ConsoleAlarm::kTotalStationSilent, is_silent(station_heard, kSilent_ms));
}

void ConsoleBoard::WatchCalibrations(const Moment& now) {
  std::string due;
  for (const Calibration& calibration : machine_.calibrations) {
    if (now.utc < calibration.due_at) continue;
    due += (due.empty() ? "" : ", ") + calibration.what;
  }
  own_alarms_.Set(ConsoleAlarm::kCalibrationDue, !due.empty(), due);
}

void ConsoleBoard::Tick(const Moment& now) {
  WatchSilence(now);
  WatchCalibrations(now);
  bool changed = own_alarms_.Tick(now.utc);
  for (const auto& [key, told] : alarms_) {
    const bool was_silent = last_tick_.steady_ms - told.arrival.heard_steady_ms > kSilent_ms;
    const bool is_silent = now.steady_ms - told.arrival.heard_steady_ms > kSilent_ms;
    changed = changed || was_silent != is_silent;
  }
  last_tick_ = now;
  if (changed) Touch(kAlarms);
  if (commands_.Tick(now.steady_ms)) Touch(kCommands);
}

void ConsoleBoard::Send(const dds::Command& command, const Moment& now) {
  commands_.Add(command, now.steady_ms);
  Touch(kCommands);
}

void ConsoleBoard::Withdraw(const dds::Command& command) {
  commands_.Withdraw(command.request_id.view());
  Touch(kCommands);
}

Result<std::string, std::string> ConsoleBoard::Obey(const dds::Command& command,
                                                    const Moment& now) {
  auto outcome = own_alarms_.Obey(command.verb.view(),
                                  command.argument.view(),
                                  command.by.view(),
                                  command.because.view(),
                                  now.utc);
  dds::CommandReply reply;
  reply.request_id = command.request_id;
  reply.source = kOwnAddressee;
  reply.outcome = outcome ? dds::CommandOutcome::kDone : dds::CommandOutcome::kRefused;
  reply.text = std::string_view(outcome ? outcome.value() : outcome.error());
  commands_.Add(reply);
  Touch(kCommands);
  Touch(kAlarms);
  return outcome;
}

Json ConsoleBoard::BridgeView() const {
  return {{"version", facts_.version},
          {"page_build", facts_.page_build},
          {"machine_id", machine_.machine.machine_id},
          {"started_at_utc_ms", Milliseconds(facts_.started_at)},
          {"dds",
           {{"domain", facts_.dds_domain},
            {"running", network_runs_},
            {"since_utc_ms", Milliseconds(network_since_)}}}};
}

Json ConsoleBoard::CameraView() const {
  const std::int64_t stale_ms = StaleMs(machine_.machine.camera);
  Json view = {{"pose", nullptr}, {"frame", nullptr}};
  if (pose_) {
    view["pose"] = ViewOf(
        pose_->message, machine_.rig, TimingOf(pose_->arrival, pose_->message.sensed_at, stale_ms));
  }
  if (frame_) {
    view["frame"] = ViewOf(frame_->message,
                           pose_ ? &pose_->message : nullptr,
                           machine_.rig,
                           TimingOf(frame_->arrival, frame_->message.sensed_at, stale_ms));
  }
  return view;
}

Json ConsoleBoard::StationView() const {
  Json view;
  for (const char* role : {"in_use", "proposed", "previous"}) {
    const auto found = set_ups_.find(role);
    view[role] = nullptr;
    if (found == set_ups_.end()) continue;
    const auto& [message, arrival] = found->second;
    view[role] = ViewOf(message, TimingOf(arrival, message.published_at, kHeartbeatStale_ms));
  }
  Json observations = Json::array();
  for (const auto& [target, observation] : observations_) {
    observations.push_back(ViewOf(observation));
  }
  view["observations"] = std::move(observations);
  return view;
}

Json ConsoleBoard::AlarmsView() const {
  std::vector<ListedAlarm> all;
  for (const auto& [key, told] : alarms_) {
    const bool is_silent = last_tick_.steady_ms - told.arrival.heard_steady_ms > kSilent_ms;
    all.push_back(
        Listed(told.status, is_silent ? Json(Milliseconds(told.heard_at)) : Json(nullptr)));
  }
  for (const auto& [key, entry] : own_alarms_.entries()) all.push_back(Listed(key, *entry));
  std::erase_if(all, [](const ListedAlarm& alarm) {
    return !alarm.stands && alarm.view["shelved_until_utc_ms"].is_null();
  });
  std::sort(all.begin(), all.end(), [](const ListedAlarm& a, const ListedAlarm& b) {
    if (a.urgency != b.urgency) return a.urgency > b.urgency;
    if (a.raised_ms != b.raised_ms) return a.raised_ms < b.raised_ms;
    return a.key < b.key;
  });
  const ListedAlarm* first = nullptr;
  Json list = Json::array();
  for (const ListedAlarm& alarm : all) {
    if (alarm.stands && (first == nullptr || alarm.raised_ms < first->raised_ms)) first = &alarm;
    list.push_back(alarm.view);
  }
  return {{"list", std::move(list)},
          {"first_out", first == nullptr ? Json(nullptr) : Json(first->key)}};
}

Json ConsoleBoard::ViewOfPart(Part part) const {
  const auto timing = [](const auto& heard, Timestamp stamp, std::int64_t stale_ms) {
    return TimingOf(heard.arrival, stamp, stale_ms);
  };
  Json list = Json::array();
  switch (part) {
    case kBridge:
      return BridgeView();
    case kMachine:
      return machine_.view;
    case kGuidance:
      if (!guidance_) return nullptr;
      return ViewOf(guidance_->message,
                    timing(*guidance_, guidance_->message.valid_at, kGuidanceStale_ms));
    case kShields: {
      Json shields = {{"front", nullptr}, {"rear", nullptr}};
      for (const auto& [name, heard] : shields_) {
        if (!shields.contains(name)) continue;
        shields[name] =
            ViewOf(heard.message, timing(heard, heard.message.valid_at, kGuidanceStale_ms));
      }
      return shields;
    }
    case kCamera:
      return CameraView();
    case kTilts:
      for (const auto& [sensor, heard] : tilts_) {
        list.push_back(ViewOf(
            heard.message, timing(heard, heard.message.sensed_at, StaleMs(machine_.machine.tilt))));
      }
      return list;
    case kStation:
      return StationView();
    case kDevices:
      for (const auto& [id, heard] : devices_) {
        list.push_back(
            ViewOf(heard.message, timing(heard, heard.message.published_at, kHeartbeatStale_ms)));
      }
      return list;
    case kAlarms:
      return AlarmsView();
    case kEvents:
      for (const dds::Event& event : events_) list.push_back(ViewOf(event));
      return list;
    case kCommands:
      return commands_.View();
    case kTrolley:
      return TrolleyView();
    case kParts:
      break;
  }
  return nullptr;
}

Json ConsoleBoard::TrolleyView() const {
  Json view = {{"state", nullptr}, {"settlement", nullptr}};
  if (trolley_) {
    view["state"] =
        ViewOf(trolley_->message,
               TimingOf(trolley_->arrival, trolley_->message.published_at, kTrolleyStale_ms));
  }
  if (settlement_) view["settlement"] = ViewOf(*settlement_);
  return view;
}

std::vector<Section> ConsoleBoard::Sections() {
  std::vector<Section> sections;
  for (std::size_t part = 0; part < kParts; ++part) {
    PartText& text = texts_[part];
    if (text.is_old) {
      // Text that came from outside may be no UTF-8: what is not is shown as such and harms
      // nothing.
      text.json = std::make_shared<const std::string>(
          ViewOfPart(static_cast<Part>(part)).dump(-1, ' ', false, Json::error_handler_t::replace));
      text.is_old = false;
    }
    sections.push_back({kPartNames[part], text.version, text.json});
  }
  return sections;
}

}  // namespace tbm::hmi
