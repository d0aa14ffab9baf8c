#include "guidance/app/watch_board.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <fmt/format.h>

#include "guidance/app/watch_text.h"
#include "idl/cpp/topics.h"
#include "pose/base/angle.h"

namespace tbm {
namespace {

using watch::AgeText;
using watch::Mm;

WatchStyle StyleOf(PoseStatus status) {
  switch (status) {
    case PoseStatus::kOk:
      return WatchStyle::kGood;
    case PoseStatus::kDegraded:
      return WatchStyle::kDegraded;
    case PoseStatus::kNone:
      return WatchStyle::kBad;
  }
  return WatchStyle::kBad;
}

WatchStyle StyleOf(dds::DeviceState state) {
  switch (state) {
    case dds::DeviceState::kStreaming:
      return WatchStyle::kGood;
    case dds::DeviceState::kOpening:
      return WatchStyle::kDegraded;
    default:
      return WatchStyle::kBad;
  }
}

}  // namespace

void WatchBoard::Add(const dds::RelativePose& pose, Instant received_at) {
  poses_[std::string(pose.machine_id)] = {pose, received_at};
}
void WatchBoard::Add(const dds::TiltReading& tilt, Instant received_at) {
  tilts_[fmt::format("{} {}", tilt.machine_id.view(), tilt.sensor.view())] = {tilt, received_at};
}
void WatchBoard::Add(const dds::FrameFeatures& features, Instant received_at) {
  features_[std::string(features.machine_id)] = {features, received_at};
}
void WatchBoard::Add(const dds::DeviceHealth& health, Instant received_at) {
  health_[fmt::format("{} {}", health.machine_id.view(), health.device_id.view())] = {health,
                                                                                      received_at};
}
void WatchBoard::Add(const dds::Event& event, Instant received_at) {
  const std::string key =
      fmt::format("{} {} {}", event.machine_id.view(), event.source.view(), event.code.view());
  events_[key] = {event, received_at};
  // A sender that makes up ever new codes must not fill the memory of the watcher.
  constexpr std::size_t kMostEvents = 256;
  if (events_.size() > kMostEvents) {
    events_.erase(
        std::min_element(events_.begin(), events_.end(), [](const auto& a, const auto& b) {
          return a.second.received_at < b.second.received_at;
        }));
  }
}
void WatchBoard::Add(const dds::Alarm& alarm) {
  const std::string key =
      fmt::format("{} {} {}", dds::AlarmCode(alarm.kind), alarm.topic, alarm.subject);
  if (alarm.active) {
    alarms_[key] = alarm;
  } else {
    alarms_.erase(key);
  }
}

void WatchBoard::Add(const dds::Guidance& guidance, Instant received_at) {
  guidance_.Add(guidance, received_at);
}
void WatchBoard::Add(const dds::ShieldPose& pose, Instant received_at) {
  guidance_.Add(pose, received_at);
}
void WatchBoard::Add(const dds::StationSetUp& set_up, Instant received_at) {
  guidance_.Add(set_up, received_at);
}
void WatchBoard::Add(const dds::AlarmStatus& alarm, Instant received_at) {
  guidance_.Add(alarm, received_at);
}
void WatchBoard::Add(const dds::TrolleyState& state, Instant received_at) {
  rail_.Add(state, received_at);
}
void WatchBoard::Add(const dds::RailLinePiece& piece, Instant received_at) {
  rail_.Add(piece, received_at);
}
void WatchBoard::Add(const dds::SettlementPiece& piece, Instant received_at) {
  rail_.Add(piece, received_at);
}
void WatchBoard::Add(const dds::CalibrationStatus& status, Instant received_at) {
  rail_.Add(status, received_at);
}

bool WatchBoard::is_empty() const {
  return guidance_.is_empty() && rail_.is_empty() && poses_.empty() && tilts_.empty() &&
         features_.empty() && health_.empty() && events_.empty();
}

void WatchBoard::AppendPoses(const WatchNow& now, std::vector<WatchRow>& rows) const {
  for (const auto& [key, heard] : poses_) {
    const dds::RelativePose& pose = heard.message;
    const watch::RowAge fresh =
        watch::AgeOf(heard.received_at, pose.sensed_at, now, watch::kStalePoseS);
    const std::string status = watch::StatusText(pose.status, pose.reason);
    const bool has_pose = pose.status != PoseStatus::kNone;
    WatchRow row{"pose " + key, "", "", "", status, StyleOf(pose.status)};
    if (has_pose) {
      const Eigen::Vector3d& t = pose.camera_from_target.translation;
      row.value = fmt::format("{} {} {} mm, {} LEDs, rms {:.3f} px",
                              Mm(t.x()),
                              Mm(t.y()),
                              Mm(t.z()),
                              std::popcount(pose.leds_used),
                              pose.rms_px);
      row.sigma = fmt::format("{:.3f} {:.3f} {:.3f}",
                              std::sqrt(pose.covariance(3, 3)) * 1e3,
                              std::sqrt(pose.covariance(4, 4)) * 1e3,
                              std::sqrt(pose.covariance(5, 5)) * 1e3);
    }
    rows.push_back(fresh.Dress(row));
    for (const dds::PosePoint& point : pose.points) {
      WatchRow line{"  " + std::string(point.name), "", "", "", status, StyleOf(pose.status)};
      line.value =
          fmt::format("{} {} {} mm, bound {}",
                      Mm(point.p_in_camera.x()),
                      Mm(point.p_in_camera.y()),
                      Mm(point.p_in_camera.z()),
                      point.bound_m ? fmt::format("{:.2f}", *point.bound_m * 1e3) : "none");
      line.sigma = fmt::format("{:.3f}", point.sigma_m * 1e3);
      rows.push_back(fresh.Dress(line));
    }
  }
}

void WatchBoard::AppendTilts(const WatchNow& now, std::vector<WatchRow>& rows) const {
  for (const auto& [key, heard] : tilts_) {
    const dds::TiltReading& tilt = heard.message;
    const bool is_valid = tilt.validity == dds::Validity::kValid;
    WatchRow row{"tilt " + key,
                 "",
                 "",
                 "",
                 is_valid ? "ok" : std::string(tilt.reason),
                 is_valid                                    ? WatchStyle::kGood
                 : tilt.validity == dds::Validity::kDegraded ? WatchStyle::kDegraded
                                                             : WatchStyle::kBad};
    if (tilt.validity != dds::Validity::kInvalid) {
      row.value = fmt::format("{:9.4f} {:9.4f} deg",
                              RadToDeg(tilt.inclination.beta_rad),
                              RadToDeg(tilt.inclination.gamma_rad));
      row.sigma = fmt::format("{:.4f}", RadToDeg(tilt.sigma_rad));
    }
    rows.push_back(
        watch::AgeOf(heard.received_at, tilt.sensed_at, now, watch::kStalePoseS).Dress(row));
  }
}

void WatchBoard::AppendFeatures(const WatchNow& now, std::vector<WatchRow>& rows) const {
  for (const auto& [key, heard] : features_) {
    const dds::FrameFeatures& f = heard.message;
    const bool is_good = f.reason == PoseReason::kNone;
    WatchRow row{"camera " + key,
                 fmt::format("{} spots, background {:.1f} DN, lost {} of {}",
                             f.spots.size(),
                             f.background_dn,
                             f.frames_lost,
                             f.frames_received + f.frames_lost),
                 "",
                 "",
                 is_good ? "ok" : std::string(ReasonCode(f.reason)),
                 is_good ? WatchStyle::kGood : WatchStyle::kBad};
    rows.push_back(
        watch::AgeOf(heard.received_at, f.sensed_at, now, watch::kStalePoseS).Dress(row));
  }
}

void WatchBoard::AppendHealth(const WatchNow& now, std::vector<WatchRow>& rows) const {
  for (const auto& [key, heard] : health_) {
    const dds::DeviceHealth& health = heard.message;
    WatchRow row{"device " + key,
                 fmt::format("{} good, {} lost, {} errors, {} reconnects",
                             health.samples_good,
                             health.samples_lost,
                             health.errors,
                             health.reconnects),
                 "",
                 "",
                 std::string(dds::StateCode(health.state)),
                 StyleOf(health.state)};
    if (!health.detail.empty()) row.status += ": " + std::string(health.detail);
    rows.push_back(
        watch::AgeOf(heard.received_at, health.published_at, now, watch::kStaleHealthS).Dress(row));
  }
}

void WatchBoard::AppendEvents(const WatchNow& now, std::vector<WatchRow>& rows) const {
  for (const auto& [key, alarm] : alarms_) {
    rows.push_back({"alarm " + std::string(dds::AlarmCode(alarm.kind)),
                    alarm.topic.empty() ? alarm.text : alarm.topic + ": " + alarm.text,
                    "",
                    "",
                    "ALARM",
                    WatchStyle::kBad});
  }
  std::vector<const Heard<dds::Event>*> shown;
  for (const auto& [key, heard] : events_) shown.push_back(&heard);
  // What stands comes first, then the newest.
  std::stable_sort(shown.begin(), shown.end(), [](const auto* a, const auto* b) {
    if (a->message.active != b->message.active) return a->message.active;
    return a->message.at > b->message.at;
  });
  constexpr std::size_t kMostShown = 8;
  if (shown.size() > kMostShown) shown.resize(kMostShown);
  for (const auto* heard : shown) {
    const dds::Event& event = heard->message;
    const bool is_bad = event.active && event.severity == dds::Severity::kAlarm;
    const bool is_doubtful = event.active && event.severity == dds::Severity::kWarning;
    rows.push_back(
        {"event " + std::string(event.source),
         fmt::format("{}: {}", event.code.view(), event.text.view()),
         "",
         AgeText(WatchAgeS(heard->received_at, event.at, now)),
         std::string(dds::SeverityCode(event.severity)) + (event.active ? ", stands" : ""),
         is_bad        ? WatchStyle::kBad
         : is_doubtful ? WatchStyle::kDegraded
                       : WatchStyle::kPlain});
  }
}

std::vector<WatchRow> WatchBoard::Rows(const WatchNow& now) const {
  std::vector<WatchRow> rows = {{"what", "value", "sigma", "age", "status", WatchStyle::kHeading}};
  guidance_.Append(now, rows);
  AppendPoses(now, rows);
  AppendTilts(now, rows);
  AppendFeatures(now, rows);
  rail_.Append(now, rows);
  AppendHealth(now, rows);
  AppendEvents(now, rows);
  return rows;
}

}  // namespace tbm
