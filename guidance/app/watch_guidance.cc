#include "guidance/app/watch_guidance.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "guidance/app/watch_text.h"
#include "idl/cpp/words.h"
#include "pose/base/angle.h"

namespace tbm {
namespace {

using watch::AgeText;

constexpr double kPerMille = 1e3;  // mm in m, mm/m in rad

// Right-aligned with its sign, in thousandths; dashes for what is not known.
std::string Signed(double value, int decimals = 1) {
  if (!std::isfinite(value)) return fmt::format("{:>8}", "--");
  return fmt::format("{:+8.{}f}", value * kPerMille, decimals);
}
std::string Sigma(double value, int decimals = 1) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value * kPerMille, decimals) : "--";
}
std::string Plain(double value, int decimals) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, decimals) : "--";
}
std::string RightUp(double right, double up, std::string_view unit) {
  return fmt::format("right {}  up {} {}", Signed(right), Signed(up), unit);
}
std::string Sigmas(double right, double up) { return Sigma(right) + " " + Sigma(up); }

// "2280.000"; with the section where a number may stand twice on the wall.
std::string OnTheWall(const dds::GuidedPoint& point) {
  std::string text = Plain(point.official_chainage_m, 3);
  if (point.official_section > 0) text += fmt::format("/{}", point.official_section);
  return text;
}

WatchStyle StyleOf(dds::Validity validity) {
  switch (validity) {
    case dds::Validity::kValid:
      return WatchStyle::kGood;
    case dds::Validity::kDegraded:
      return WatchStyle::kDegraded;
    case dds::Validity::kInvalid:
      return WatchStyle::kBad;
  }
  return WatchStyle::kBad;
}

WatchStyle StyleOf(dds::SourceFreshness freshness) {
  switch (freshness) {
    case dds::SourceFreshness::kFresh:
      return WatchStyle::kGood;
    case dds::SourceFreshness::kCoasting:
      return WatchStyle::kDegraded;
    case dds::SourceFreshness::kStale:
    case dds::SourceFreshness::kMissing:
      return WatchStyle::kBad;
  }
  return WatchStyle::kBad;
}

WatchRow HeadRow(const std::string& key, const dds::Guidance& guidance) {
  const dds::GuidedPoint* const steered = watch::SteeredPoint(guidance);
  const dds::GuidedPoint nothing;
  const dds::GuidedPoint& point = steered ? *steered : nothing;
  return {"guidance " + key,
          fmt::format("chainage {}, on the wall {}, ring {}, stroke {} mm",
                      Plain(point.chainage_m, 3),
                      OnTheWall(point),
                      guidance.ring_number >= 0 ? std::to_string(guidance.ring_number) : "--",
                      Plain(guidance.stroke_m * kPerMille, 1)),
          "",
          "",
          watch::StatusText(guidance.validity, guidance.reason),
          StyleOf(guidance.validity)};
}

WatchRow PointRow(const dds::GuidedPoint& point, bool is_steered) {
  return {fmt::format("{} {}", is_steered ? " >" : "  ", point.name.view()),
          fmt::format("{}  at {}",
                      RightUp(point.deviation_right_m, point.deviation_up_m, "mm"),
                      Plain(point.chainage_m, 3)),
          Sigmas(point.deviation_right_sigma_m, point.deviation_up_sigma_m),
          "",
          watch::StatusText(point.validity, point.reason),
          StyleOf(point.validity)};
}

// Where the front shield looks, how it is turned against the rear one, where it has been going.
void AddDirections(const dds::Guidance& g, std::vector<WatchRow>& rows) {
  const WatchStyle style = StyleOf(g.validity);
  rows.push_back({"   lead, look-up",
                  RightUp(g.lead_right_per_m, g.lead_up_per_m, "mm/m"),
                  Sigmas(g.lead_right_sigma_per_m, g.lead_up_sigma_per_m),
                  "",
                  "",
                  style});
  rows.push_back({"   articulation",
                  RightUp(g.articulation_right_rad, g.articulation_up_rad, "mm/m") +
                      fmt::format("  roll {} mm/m", Signed(g.articulation_roll_rad)),
                  Sigmas(g.articulation_right_sigma_rad, g.articulation_up_sigma_rad) + " " +
                      Sigma(g.articulation_roll_sigma_rad),
                  "",
                  "",
                  style});
  const dds::GuidedPoint* const steered = watch::SteeredPoint(g);
  const dds::GuidedPoint nothing;
  const dds::GuidedPoint& point = steered ? *steered : nothing;
  rows.push_back({"   trend",
                  RightUp(point.trend_right_per_m, point.trend_up_per_m, "mm/m") +
                      fmt::format("  over {} m", Plain(point.trend_length_m, 1)),
                  Sigmas(point.trend_right_sigma_per_m, point.trend_up_sigma_per_m),
                  "",
                  "",
                  style});
}

void AddAhead(const dds::Guidance& guidance, std::vector<WatchRow>& rows) {
  constexpr std::array kShown_m = {2.0, 5.0, 10.0, 20.0};
  const WatchStyle style = StyleOf(guidance.validity);
  bool has_any = false;
  for (const dds::PredictedDeviation& ahead : guidance.ahead) {
    const auto is_it = [&](double m) { return std::abs(ahead.ahead_m - m) < 0.01; };
    if (std::none_of(kShown_m.begin(), kShown_m.end(), is_it)) continue;
    has_any = true;
    rows.push_back({fmt::format("   {:.0f} m ahead", ahead.ahead_m),
                    RightUp(ahead.deviation_right_m, ahead.deviation_up_m, "mm"),
                    Sigmas(ahead.deviation_right_sigma_m, ahead.deviation_up_sigma_m),
                    "",
                    "",
                    style});
  }
  if (!has_any) rows.push_back({"   ahead", RightUp(NAN, NAN, "mm"), "-- --", "", "", style});
}

// "coasting 4 min, +-9 mm": how long without news, and what that has made of the deviation.
WatchRow SourceRow(const dds::GuidanceSource& source, const dds::Guidance& guidance) {
  std::string status(dds::WordOf(source.freshness));
  if (std::isfinite(source.age_s)) status += " " + AgeText(source.age_s);
  const dds::GuidedPoint* const steered = watch::SteeredPoint(guidance);
  if (source.freshness == dds::SourceFreshness::kCoasting && steered) {
    const double sigma_m =
        std::max(steered->deviation_right_sigma_m, steered->deviation_up_sigma_m);
    if (std::isfinite(sigma_m)) status += fmt::format(", +-{:.0f} mm", sigma_m * kPerMille);
  }
  std::string value;
  if (source.name == "station") {
    value = fmt::format("set-up {}, prisms {}, rms {} mm",
                        guidance.set_up_number > 0 ? std::to_string(guidance.set_up_number) : "--",
                        guidance.prisms_dof >= 0 ? std::to_string(guidance.prisms_used) : "--",
                        Plain(guidance.prisms_rms_m * kPerMille, 1));
    if (!guidance.prisms_remark.empty()) value += ", " + std::string(guidance.prisms_remark);
  }
  if (!source.reason.empty()) value += (value.empty() ? "" : "; ") + std::string(source.reason);
  return {
      "   source " + std::string(source.name), value, "", "", status, StyleOf(source.freshness)};
}

std::string Metres(const Eigen::Vector3d& p) {
  return fmt::format("{} {} {} m", Plain(p.x(), 4), Plain(p.y(), 4), Plain(p.z(), 4));
}

}  // namespace

namespace watch {

std::string StatusText(dds::Validity validity, std::string_view reason) {
  std::string text = validity == dds::Validity::kValid      ? "valid"
                     : validity == dds::Validity::kDegraded ? "degraded"
                                                            : "none";
  if (!reason.empty()) text += " " + std::string(reason);
  return text;
}

const dds::GuidedPoint* SteeredPoint(const dds::Guidance& guidance) {
  for (const dds::GuidedPoint& point : guidance.points) {
    if (point.name == guidance.steer_by) return &point;
  }
  return nullptr;
}

}  // namespace watch

void GuidanceBoard::Add(const dds::Guidance& guidance, WatchInstant received_at) {
  guidance_[std::string(guidance.machine_id)] = {guidance, received_at};
}
void GuidanceBoard::Add(const dds::ShieldPose& pose, WatchInstant received_at) {
  shields_[fmt::format("{} {}", pose.machine_id.view(), pose.shield.view())] = {pose, received_at};
}
void GuidanceBoard::Add(const dds::StationSetUp& set_up, WatchInstant received_at) {
  set_ups_[fmt::format("{} {}", set_up.machine_id.view(), set_up.role.view())] = {set_up,
                                                                                  received_at};
}
void GuidanceBoard::Add(const dds::AlarmStatus& alarm, WatchInstant received_at) {
  const std::string key =
      fmt::format("{} {} {}", alarm.machine_id.view(), alarm.source.view(), alarm.code.view());
  // A sender that makes up ever new codes must not fill the memory of the watcher.
  constexpr std::size_t kMostAlarms = 256;
  if (alarms_.size() >= kMostAlarms && alarms_.count(key) == 0) return;
  alarms_[key] = {alarm, received_at};
}

bool GuidanceBoard::is_empty() const {
  return guidance_.empty() && shields_.empty() && set_ups_.empty() && alarms_.empty();
}

void GuidanceBoard::Append(const WatchNow& now, std::vector<WatchRow>& rows) const {
  AppendAlarms(now, rows);
  for (const auto& [key, heard] : guidance_) {
    const dds::Guidance& guidance = heard.message;
    std::vector<WatchRow> own = {HeadRow(key, guidance)};
    for (const dds::GuidedPoint& point : guidance.points) {
      own.push_back(PointRow(point, point.name == guidance.steer_by));
    }
    AddDirections(guidance, own);
    AddAhead(guidance, own);
    for (const dds::GuidanceSource& source : guidance.sources) {
      own.push_back(SourceRow(source, guidance));
    }
    const watch::RowAge age =
        watch::AgeOf(heard.received_at, guidance.valid_at, now, watch::kStalePoseS);
    for (WatchRow& row : own) rows.push_back(age.Dress(std::move(row)));
  }
  AppendShields(now, rows);
  AppendSetUps(now, rows);
}

// What stands unacknowledged first, then by the order in which they came; last what is shelved,
// also while it is normal, so that nobody forgets it. Silence of the sender takes no alarm away and
// puts it in no other dress, and keeps none on its shelf for longer than was said.
void GuidanceBoard::AppendAlarms(const WatchNow& now, std::vector<WatchRow>& rows) const {
  std::vector<const WatchHeard<dds::AlarmStatus>*> standing;
  const auto is_shelved = [&now](const dds::AlarmStatus& alarm) {
    return now.utc < alarm.shelved_until;
  };
  for (const auto& [key, heard] : alarms_) {
    if (heard.message.phase != dds::AlarmPhase::kNormal || is_shelved(heard.message)) {
      standing.push_back(&heard);
    }
  }
  std::stable_sort(standing.begin(), standing.end(), [&](const auto* a, const auto* b) {
    const bool a_is_shelved = is_shelved(a->message);
    const bool b_is_shelved = is_shelved(b->message);
    if (a_is_shelved != b_is_shelved) return b_is_shelved;
    const bool a_waits = a->message.phase == dds::AlarmPhase::kUnacknowledged;
    const bool b_waits = b->message.phase == dds::AlarmPhase::kUnacknowledged;
    if (a_waits != b_waits) return a_waits;
    return a->message.raise_number < b->message.raise_number;
  });
  for (const auto* heard : standing) {
    const dds::AlarmStatus& alarm = heard->message;
    const bool stands = alarm.phase == dds::AlarmPhase::kUnacknowledged ||
                        alarm.phase == dds::AlarmPhase::kAcknowledged;
    std::string status(dds::WordOf(alarm.phase));
    if (!alarm.acknowledged_by.empty()) status += " by " + std::string(alarm.acknowledged_by);
    if (is_shelved(alarm)) {
      status += fmt::format(", shelved until {} by {}",
                            watch::ClockText(alarm.shelved_until),
                            alarm.shelved_by.view());
    }
    if (WatchAgeS(heard->received_at, alarm.published_at, now) > watch::kStaleHealthS) {
      status += ", source silent";
    }
    std::string value(alarm.cause);
    if (!alarm.unit.empty()) {
      value += fmt::format(
          " ({} {}, limit {:g})", Plain(alarm.value, 1), alarm.unit.view(), alarm.raise_above);
    }
    if (stands && !alarm.response.empty()) value += "; " + std::string(alarm.response);
    const bool has_begun = alarm.raised_at.ns >= 0;
    WatchStyle style = WatchStyle::kDegraded;
    if (stands && alarm.urgency != dds::AlarmUrgency::kLow) style = WatchStyle::kBad;
    if (is_shelved(alarm)) style = WatchStyle::kPlain;
    rows.push_back(
        {fmt::format("ALARM {} {}", alarm.source.view(), alarm.code.view()),
         value,
         "",
         has_begun ? AgeText(std::max(0.0, SecondsBetween(alarm.raised_at, now.utc))) : "",
         fmt::format("{} {}", dds::WordOf(alarm.urgency), status),
         style});
  }
}

void GuidanceBoard::AppendShields(const WatchNow& now, std::vector<WatchRow>& rows) const {
  for (const auto& [key, heard] : shields_) {
    const dds::ShieldPose& pose = heard.message;
    WatchRow row{
        "shield " + key,
        fmt::format("roll {}  pitch {} mm/m, heading {} deg, at {}, rests on {}",
                    Signed(pose.roll_rad),
                    Signed(pose.pitch_rad),
                    Plain(RadToDeg(pose.heading_rad), 4),
                    Metres(pose.site_from_shield.translation),
                    std::isfinite(pose.age_s) ? AgeText(pose.age_s) + " ago" : "--"),
        fmt::format("{} {}", Sigma(pose.roll_sigma_rad, 2), Sigma(pose.pitch_sigma_rad, 2)),
        "",
        watch::StatusText(pose.validity, pose.reason),
        StyleOf(pose.validity)};
    rows.push_back(watch::AgeOf(heard.received_at, pose.valid_at, now, watch::kStalePoseS)
                       .Dress(std::move(row)));
  }
}

void GuidanceBoard::AppendSetUps(const WatchNow& now, std::vector<WatchRow>& rows) const {
  for (const auto& [key, heard] : set_ups_) {
    const dds::StationSetUp& set_up = heard.message;
    const auto used = std::count_if(set_up.references.begin(),
                                    set_up.references.end(),
                                    [](const dds::ReferenceState& one) { return one.used; });
    std::string value = fmt::format(
        "set-up {} at {}, references {}, checked {}",
        set_up.set_up_number > 0 ? std::to_string(set_up.set_up_number) : "--",
        Metres(set_up.position_in_site_m),
        set_up.references.empty() ? "--" : fmt::format("{} of {}", used, set_up.references.size()),
        set_up.last_good_check_at.ns >= 0
            ? AgeText(std::max(0.0, SecondsBetween(set_up.last_good_check_at, now.utc))) + " ago"
            : "--");
    if (std::isfinite(set_up.closure_worst_m)) {
      value += fmt::format(", closure {} of {} mm at {} points",
                           Plain(set_up.closure_worst_m * kPerMille, 1),
                           Plain(set_up.closure_tolerance_m * kPerMille, 1),
                           set_up.closure_points);
    }
    std::string status(dds::WordOf(set_up.state));
    if (!set_up.reason.empty()) status += " " + std::string(set_up.reason);
    WatchRow row{"station " + key,
                 value,
                 fmt::format("{} {} {}",
                             Sigma(std::sqrt(set_up.covariance(0, 0))),
                             Sigma(std::sqrt(set_up.covariance(1, 1))),
                             Sigma(std::sqrt(set_up.covariance(2, 2)))),
                 "",
                 status,
                 set_up.state == dds::SetUpState::kGood      ? WatchStyle::kGood
                 : set_up.state == dds::SetUpState::kSuspect ? WatchStyle::kDegraded
                                                             : WatchStyle::kBad};
    rows.push_back(watch::AgeOf(heard.received_at, set_up.published_at, now, watch::kStaleHealthS)
                       .Dress(std::move(row)));
  }
}

}  // namespace tbm
