#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "hmi_bridge/core/console_board.h"
#include "idl/cpp/words.h"
#include "pose/base/check.h"

namespace tbm::hmi {
namespace {

// Prometheus' text format, version 0.0.4: all lines of a metric stand together, whatever the order
// in which they are told. A number that is not known is not exported: a scrape without it says so,
// a zero would lie.
class MetricsText {
 public:
  void Describe(std::string_view name, std::string_view type, std::string_view help) {
    metrics_.push_back(
        {std::string(name), fmt::format("# HELP {} {}\n# TYPE {} {}\n", name, help, name, type)});
  }
  // Of a metric that was described.
  void Value(std::string_view name, std::string_view labels, double value) {
    if (!std::isfinite(value)) return;
    const auto metric = std::find_if(
        metrics_.begin(), metrics_.end(), [&](const Metric& one) { return one.name == name; });
    TBM_CHECK(metric != metrics_.end());
    fmt::format_to(std::back_inserter(metric->text), "{}{{{}}} {}\n", name, labels, value);
  }
  std::string Take() const {
    std::string text;
    for (const Metric& metric : metrics_) text += metric.text;
    return text;
  }

 private:
  struct Metric {
    std::string name;
    std::string text;
  };
  std::vector<Metric> metrics_;
};

// Backslash, quote and line end are escaped, as the format wants it.
std::string Label(std::string_view name, std::string_view value) {
  std::string label(name);
  label += "=\"";
  for (const char c : value) {
    if (c == '\\' || c == '"') label += '\\';
    if (c == '\n') {
      label += "\\n";
    } else {
      label += c;
    }
  }
  return label + "\"";
}

std::string Labels(std::string_view name, std::string_view value, const std::string& more) {
  return Label(name, value) + "," + more;
}

}  // namespace

std::string ConsoleBoard::Metrics(const Moment& now) const {
  MetricsText text;
  const std::string machine = Label("machine", machine_.machine.machine_id);
  text.Describe("tbm_deviation_millimetres",
                "gauge",
                "of a point against the design axis; absent: not known");
  text.Describe("tbm_deviation_sigma_millimetres", "gauge", "one standard deviation of it");
  text.Describe("tbm_chainage_metres", "gauge", "internal chainage of a point; absent: not known");
  text.Describe("tbm_guidance_validity", "gauge", "0 invalid or two senders, 1 degraded, 2 valid");
  text.Describe("tbm_age_seconds", "gauge", "worse of stamp and arrival; absent: never heard");
  if (guidance_) {
    const dds::Guidance& guidance = guidance_->message;
    const std::int64_t age_ms = AgeMs(guidance_->arrival, guidance.valid_at, now);
    text.Value("tbm_age_seconds",
               Labels("topic", "guidance", machine),
               1e-3 * static_cast<double>(age_ms));
    // A stale deviation is none, and of two senders neither is to be trusted.
    const bool is_contested = guidance_->arrival.contested;
    const bool is_told = age_ms <= kGuidanceStale_ms && !is_contested;
    text.Value("tbm_guidance_validity",
               machine,
               is_contested ? 0.0 : static_cast<double>(guidance.validity));
    for (const dds::GuidedPoint& point : guidance.points) {
      if (!is_told) break;
      const std::string labels = Labels("point", point.name.view(), machine);
      text.Value("tbm_deviation_millimetres",
                 Labels("direction", "right", labels),
                 point.deviation_right_m * 1e3);
      text.Value("tbm_deviation_millimetres",
                 Labels("direction", "up", labels),
                 point.deviation_up_m * 1e3);
      text.Value("tbm_deviation_sigma_millimetres",
                 Labels("direction", "right", labels),
                 point.deviation_right_sigma_m * 1e3);
      text.Value("tbm_deviation_sigma_millimetres",
                 Labels("direction", "up", labels),
                 point.deviation_up_sigma_m * 1e3);
      text.Value("tbm_chainage_metres", labels, point.chainage_m);
    }
  }
  if (pose_) {
    text.Value("tbm_age_seconds",
               Labels("topic", "relative_pose", machine),
               1e-3 * static_cast<double>(AgeMs(pose_->arrival, pose_->message.sensed_at, now)));
  }
  text.Describe("tbm_device_streaming", "gauge", "1 while the device delivers");
  text.Describe("tbm_device_samples_lost_total", "counter", "since the device's process began");
  for (const auto& [id, heard] : devices_) {
    const std::string labels = Labels("device", id, machine);
    const bool is_heard = now.steady_ms - heard.arrival.heard_steady_ms <= kHeartbeatStale_ms;
    text.Value("tbm_device_streaming",
               labels,
               is_heard && heard.message.state == dds::DeviceState::kStreaming ? 1.0 : 0.0);
    text.Value(
        "tbm_device_samples_lost_total", labels, static_cast<double>(heard.message.samples_lost));
  }
  std::array<int, 3> standing{};
  for (const auto& [key, told] : alarms_) {
    if (told.status.phase != dds::AlarmPhase::kNormal) {
      ++standing[static_cast<std::size_t>(told.status.urgency)];
    }
  }
  for (const auto& [key, entry] : own_alarms_.entries()) {
    if (entry->alarm().state != AlarmState::kNormal) {
      ++standing[static_cast<std::size_t>(entry->board.rule(0).priority)];
    }
  }
  text.Describe("tbm_alarms_standing", "gauge", "alarms that are not normal, shelved ones too");
  for (std::size_t urgency = 0; urgency < standing.size(); ++urgency) {
    text.Value("tbm_alarms_standing",
               Labels("urgency", dds::WordOf(static_cast<dds::AlarmUrgency>(urgency)), machine),
               standing[urgency]);
  }
  text.Describe("tbm_messages_of_other_machines_total", "counter", "heard and not shown");
  text.Value(
      "tbm_messages_of_other_machines_total", machine, static_cast<double>(of_other_machines_));
  return text.Take();
}

}  // namespace tbm::hmi
