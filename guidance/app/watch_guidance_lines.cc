#include <string>

#include <fmt/format.h>

#include "guidance/app/watch_board.h"
#include "guidance/app/watch_guidance.h"
#include "guidance/app/watch_text.h"
#include "idl/cpp/words.h"
#include "pose/base/angle.h"

namespace tbm {
namespace {

using watch::LineHead;
using watch::Number;
using watch::QuotedText;

constexpr double kPerMille = 1e3;

std::string Word(dds::Validity validity) { return watch::StatusText(validity, ""); }

std::string Reason(std::string_view reason) {
  return reason.empty() ? "" : fmt::format(" reason={}", watch::Harmless(reason));
}

std::string PointText(const dds::GuidedPoint& point) {
  const std::string name = watch::Harmless(point.name);
  std::string text = fmt::format(" {}={}", name, Word(point.validity));
  text += Number(name + "_right_mm", point.deviation_right_m * kPerMille, 2);
  text += Number(name + "_up_mm", point.deviation_up_m * kPerMille, 2);
  text += Number(name + "_right_sigma_mm", point.deviation_right_sigma_m * kPerMille, 2);
  text += Number(name + "_up_sigma_mm", point.deviation_up_sigma_m * kPerMille, 2);
  text += Number(name + "_chainage_m", point.chainage_m, 4);
  return text + Number(name + "_official_chainage_m", point.official_chainage_m, 4);
}

}  // namespace

std::string WatchLine(const dds::Guidance& g, double age_s) {
  const bool is_stale = age_s > watch::kStalePoseS;
  std::string line =
      LineHead("guidance", g.machine_id, g.valid_at, age_s, is_stale, Word(g.validity)) +
      Reason(g.reason);
  if (is_stale) return line;
  line += " steer_by=" + watch::Harmless(g.steer_by);
  if (g.ring_number >= 0) line += fmt::format(" ring={}", g.ring_number);
  line += Number("stroke_mm", g.stroke_m * kPerMille, 2);
  line += Number("lead_right_mm_per_m", g.lead_right_per_m * kPerMille, 3);
  line += Number("lead_up_mm_per_m", g.lead_up_per_m * kPerMille, 3);
  line += Number("articulation_right_mm_per_m", g.articulation_right_rad * kPerMille, 3);
  line += Number("articulation_up_mm_per_m", g.articulation_up_rad * kPerMille, 3);
  line += Number("articulation_roll_mm_per_m", g.articulation_roll_rad * kPerMille, 3);
  for (const dds::GuidedPoint& point : g.points) line += PointText(point);
  for (const dds::GuidanceSource& source : g.sources) {
    const std::string name = watch::Harmless(source.name);
    line += fmt::format(" {}={}", name, dds::WordOf(source.freshness));
    line += Number(name + "_age_s", source.age_s, 1);
  }
  return line;
}

std::string WatchLine(const dds::ShieldPose& pose, double age_s) {
  const bool is_stale = age_s > watch::kStalePoseS;
  std::string line =
      LineHead(
          "shield_pose", pose.machine_id, pose.valid_at, age_s, is_stale, Word(pose.validity)) +
      " shield=" + watch::Harmless(pose.shield) + Reason(pose.reason);
  if (is_stale || pose.validity == dds::Validity::kInvalid) return line;
  const Eigen::Vector3d& t = pose.site_from_shield.translation;
  line += Number("east_m", t.x(), 5) + Number("north_m", t.y(), 5) + Number("up_m", t.z(), 5);
  line += Number("heading_deg", RadToDeg(pose.heading_rad), 5);
  line += Number("pitch_mm_per_m", pose.pitch_rad * kPerMille, 3);
  line += Number("roll_mm_per_m", pose.roll_rad * kPerMille, 3);
  return line + Number("rests_on_s", pose.age_s, 2);
}

std::string WatchLine(const dds::StationSetUp& set_up, double age_s) {
  const bool is_stale = age_s > watch::kStaleHealthS;
  std::string line = LineHead("station_set_up",
                              set_up.machine_id,
                              set_up.published_at,
                              age_s,
                              is_stale,
                              std::string(dds::WordOf(set_up.state))) +
                     " role=" + watch::Harmless(set_up.role) + Reason(set_up.reason);
  if (is_stale) return line;
  line += fmt::format(" set_up={}", set_up.set_up_number);
  const Eigen::Vector3d& p = set_up.position_in_site_m;
  line += Number("east_m", p.x(), 5) + Number("north_m", p.y(), 5) + Number("up_m", p.z(), 5);
  line += Number("circle_zero_deg", RadToDeg(set_up.circle_zero_bearing_rad), 5);
  return line + Number("closure_worst_mm", set_up.closure_worst_m * kPerMille, 2);
}

std::string WatchLine(const dds::AlarmStatus& alarm, double age_s) {
  std::string line =
      fmt::format("alarm machine={} stamp_ns={} age_s={:.3f} source={} code={} phase={} urgency={}",
                  watch::Harmless(alarm.machine_id),
                  alarm.published_at.ns,
                  age_s,
                  watch::Harmless(alarm.source),
                  watch::Harmless(alarm.code),
                  dds::WordOf(alarm.phase),
                  dds::WordOf(alarm.urgency));
  if (!alarm.unit.empty()) line += Number("value", alarm.value, 3);
  if (!alarm.acknowledged_by.empty()) line += " by=" + QuotedText(alarm.acknowledged_by);
  if (alarm.shelved_until != dds::kNever) {
    line += fmt::format(
        " shelved_until_ns={} shelved_by={}", alarm.shelved_until.ns, QuotedText(alarm.shelved_by));
  }
  if (alarm.phase != dds::AlarmPhase::kNormal) line += " cause=" + QuotedText(alarm.cause);
  return line;
}

}  // namespace tbm
