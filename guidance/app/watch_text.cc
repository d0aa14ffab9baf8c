#include "guidance/app/watch_text.h"

#include <bit>
#include <chrono>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "guidance/app/watch_board.h"
#include "idl/cpp/qos.h"
#include "pose/base/angle.h"

namespace tbm {
namespace watch {

namespace {

double DeadlineS(dds::QosClass qos_class) {
  return std::chrono::duration<double>(dds::RuleOf(qos_class).deadline).count();
}

}  // namespace

const double kStalePoseS = DeadlineS(dds::QosClass::kMeasurement);
const double kStaleHealthS = DeadlineS(dds::QosClass::kHealth);

std::string AgeText(double age_s) {
  if (age_s < 10.0) return fmt::format("{:.2f} s", age_s);
  if (age_s < 120.0) return fmt::format("{:.0f} s", age_s);
  if (age_s < 7200.0) return fmt::format("{:.0f} min", age_s / 60.0);
  return fmt::format("{:.0f} h", age_s / 3600.0);
}

std::string ClockText(Timestamp at) {
  const std::int64_t minutes = at.ns / 60'000'000'000;
  return fmt::format("{:02}:{:02} UTC", minutes / 60 % 24, minutes % 60);
}

std::string Mm(double value_m) { return fmt::format("{:10.2f}", value_m * 1e3); }

std::string StatusText(PoseStatus status, PoseReason reason) {
  std::string text(StatusCode(status));
  if (reason != PoseReason::kNone) text += " " + std::string(ReasonCode(reason));
  return text;
}

std::string Harmless(std::string_view text) {
  std::string harmless(text);
  for (char& c : harmless) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f) c = '?';
  }
  return harmless;
}

std::string Number(std::string_view name, double value, int decimals) {
  return std::isfinite(value) ? fmt::format(" {}={:.{}f}", name, value, decimals) : "";
}

std::string LineHead(std::string_view topic,
                     std::string_view machine,
                     Timestamp at,
                     double age_s,
                     bool is_stale,
                     const std::string& status) {
  return fmt::format("{} machine={} stamp_ns={} age_s={:.3f} status={}",
                     topic,
                     Harmless(machine),
                     at.ns,
                     age_s,
                     is_stale ? "stale was=" + status : status);
}

std::string QuotedText(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : Harmless(text)) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace watch

namespace {

using watch::LineHead;
using watch::Number;
using watch::QuotedText;

std::string_view ColourOf(WatchStyle style) {
  switch (style) {
    case WatchStyle::kHeading:
      return "\x1b[1m";
    case WatchStyle::kGood:
      return "\x1b[32m";
    case WatchStyle::kDegraded:
      return "\x1b[33m";
    case WatchStyle::kBad:
      return "\x1b[1;31m";
    case WatchStyle::kStale:
      return "\x1b[2;9;35m";  // faint, struck through
    case WatchStyle::kPlain:
      return "";
  }
  return "";
}

std::string Padded(const std::string& text, std::size_t width) {
  return text.size() > width ? text : text + std::string(width - text.size(), ' ');
}

std::string Cut(const std::string& text, std::size_t width) {
  return Padded(text.substr(0, width), width);
}

}  // namespace

// Status and age stand right behind the name: on a narrow terminal the numbers are cut, never the
// word that says what they are worth.
std::string WatchScreen(const std::vector<WatchRow>& rows, int width_chars, bool with_colours) {
  constexpr std::size_t kLongestStatus = 34;
  constexpr std::size_t kValueColumn =
      62;  // a sentence may be longer; a number's sigma stands near
  const auto width = static_cast<std::size_t>(std::max(width_chars, 20));
  std::size_t what_width = 0;
  std::size_t status_width = 0;
  std::size_t value_width = 0;
  for (const WatchRow& row : rows) {
    what_width = std::max(what_width, row.what.size());
    status_width = std::max(status_width, std::min(row.status.size(), kLongestStatus));
    value_width = std::max(value_width, std::min(row.value.size(), kValueColumn));
  }
  std::string screen;
  for (const WatchRow& row : rows) {
    const std::string text = watch::Harmless(fmt::format("{}  {} {:>8}  {}  {}",
                                                         Cut(row.what, what_width),
                                                         Cut(row.status, status_width),
                                                         row.age,
                                                         Padded(row.value, value_width),
                                                         row.sigma));
    const std::string_view colour = with_colours ? ColourOf(row.style) : "";
    screen += colour;
    screen += text.substr(0, width);
    if (!colour.empty()) screen += "\x1b[0m";
    screen += "\n";
  }
  return screen;
}

std::string WatchLine(const dds::RelativePose& pose, double age_s) {
  const bool is_stale = age_s > watch::kStalePoseS;
  std::string line = LineHead("relative_pose",
                              pose.machine_id,
                              pose.sensed_at,
                              age_s,
                              is_stale,
                              std::string(StatusCode(pose.status)));
  if (pose.reason != PoseReason::kNone) line += fmt::format(" reason={}", ReasonCode(pose.reason));
  if (is_stale || pose.status == PoseStatus::kNone) return line;
  const auto& [rotation, t] = pose.camera_from_target;
  line += fmt::format(" leds_used={} qw={:.9f} qx={:.9f} qy={:.9f} qz={:.9f}",
                      std::popcount(pose.leds_used),
                      rotation.w(),
                      rotation.x(),
                      rotation.y(),
                      rotation.z());
  for (int axis = 0; axis < 3; ++axis) {
    line += fmt::format(" t{}_mm={:.4f} sigma_t{}_mm={:.4f}",
                        "xyz"[axis],
                        t(axis) * 1e3,
                        "xyz"[axis],
                        std::sqrt(pose.covariance(3 + axis, 3 + axis)) * 1e3);
  }
  line += Number("rms_px", pose.rms_px, 4);
  for (const dds::PosePoint& point : pose.points) {
    const std::string name = watch::Harmless(point.name);
    for (int axis = 0; axis < 3; ++axis) {
      line += fmt::format(" {}_{}_mm={:.4f}", name, "xyz"[axis], point.p_in_camera(axis) * 1e3);
    }
    line += Number(name + "_sigma_mm", point.sigma_m * 1e3, 4);
    if (point.bound_m) line += Number(name + "_bound_mm", *point.bound_m * 1e3, 4);
  }
  return line;
}

std::string WatchLine(const dds::TiltReading& tilt, double age_s) {
  const bool is_stale = age_s > watch::kStalePoseS;
  const char* status = tilt.validity == dds::Validity::kValid      ? "ok"
                       : tilt.validity == dds::Validity::kDegraded ? "degraded"
                                                                   : "none";
  std::string line =
      LineHead("inclination", tilt.machine_id, tilt.sensed_at, age_s, is_stale, status) +
      " sensor=" + watch::Harmless(tilt.sensor);
  if (!tilt.reason.empty()) line += " reason=" + watch::Harmless(tilt.reason);
  if (is_stale || tilt.validity == dds::Validity::kInvalid) return line;
  return line + Number("beta_deg", RadToDeg(tilt.inclination.beta_rad), 5) +
         Number("gamma_deg", RadToDeg(tilt.inclination.gamma_rad), 5) +
         Number("sigma_deg", RadToDeg(tilt.sigma_rad), 5);
}

std::string WatchLine(const dds::FrameFeatures& features, double age_s) {
  const bool is_stale = age_s > watch::kStalePoseS;
  const bool is_good = features.reason == PoseReason::kNone;
  std::string line = LineHead("frame_features",
                              features.machine_id,
                              features.sensed_at,
                              age_s,
                              is_stale,
                              is_good ? "ok" : "none");
  if (!is_good) line += fmt::format(" reason={}", ReasonCode(features.reason));
  if (is_stale) return line;
  return line +
         fmt::format(" frame={} spots={} frames_lost={}",
                     features.frame_number,
                     features.spots.size(),
                     features.frames_lost) +
         Number("background_dn", features.background_dn, 2);
}

std::string WatchLine(const dds::DeviceHealth& health, double age_s) {
  const bool is_stale = age_s > watch::kStaleHealthS;
  std::string line = LineHead("device_health",
                              health.machine_id,
                              health.published_at,
                              age_s,
                              is_stale,
                              std::string(dds::StateCode(health.state))) +
                     " device=" + watch::Harmless(health.device_id);
  line += fmt::format(" good={} lost={} errors={} reconnects={}",
                      health.samples_good,
                      health.samples_lost,
                      health.errors,
                      health.reconnects);
  return health.detail.empty() ? line : line + " detail=" + QuotedText(health.detail);
}

std::string WatchLine(const dds::Event& event, double age_s) {
  return fmt::format(
      "event machine={} stamp_ns={} age_s={:.3f} source={} code={} severity={} active={} text={}",
      watch::Harmless(event.machine_id),
      event.at.ns,
      age_s,
      watch::Harmless(event.source),
      watch::Harmless(event.code),
      dds::SeverityCode(event.severity),
      event.active ? "yes" : "no",
      QuotedText(event.text));
}

std::string WatchLine(const dds::Alarm& alarm) {
  return fmt::format("alarm code={} active={} topic={} text={}",
                     dds::AlarmCode(alarm.kind),
                     alarm.active ? "yes" : "no",
                     alarm.topic.empty() ? "-" : alarm.topic,
                     QuotedText(alarm.text));
}

}  // namespace tbm
