#include "guidance/config/rail_line_file.h"

#include <chrono>
#include <cstdio>

#include <fmt/format.h>

#include "guidance/config/imu_section.h"
#include "pose/app/inclinometer_section.h"
#include "pose/rig/dds_section.h"
#include "pose/rig/rig_yaml.h"
#include "pose/rig/yaml_section.h"

namespace tbm {
namespace {

constexpr double kMmInM = 1e3;
constexpr double kMsInS = 1e3;
constexpr std::size_t kMostMachineId = 32;  // of the contract (idl/)

void ReadReplay(const YamlNode& node, const std::string& file, RailReplayConfig* replay) {
  if (!IsSection(node)) return;
  YamlSection section(node);
  const auto folder = section.Require("run", "a rail run's folder, with rail.yaml and imu.csv");
  if (const auto text = folder.Text()) replay->run_folder = BesideFile(file, *text);
  section.Number("speed", 0.1, 1000.0, "times", &replay->speed);
  section.Scaled("image_delay_ms", 0.0, 10'000.0, "ms", kMsInS, &replay->image_delay_s);
  section.RefuseOthers();
}

void ReadDevices(const YamlNode& node, const std::string& file, RailDevicesConfig* devices) {
  if (!IsSection(node)) return;
  YamlSection section(node);
  const auto folder = section.Require("setup", "a folder with rail.yaml, and targets.csv");
  if (const auto text = folder.Text()) devices->setup_folder = BesideFile(file, *text);
  ReadImuSection(section.Require("imu", "a map with model and port"), &devices->imu);
  const YamlNode inclinometer = section.Know("inclinometer");
  if (IsSection(inclinometer)) {
    devices->inclinometer.emplace().name = "trolley";
    ReadInclinometerSection(inclinometer, &*devices->inclinometer);
    const InclinometerDriver driver = devices->inclinometer->driver;
    if (driver == InclinometerDriver::kSim || driver == InclinometerDriver::kReplay) {
      inclinometer.Optional("driver").Fault("must be modbus, rion68 or bewis77 on a trolley");
    }
  }
  std::string pixels = "none";
  section.Word("target_pixels", {"none", "frame_features"}, &pixels);
  devices->has_target_pixels = pixels == "frame_features";
  section.RefuseOthers();
}

void ReadPublish(const YamlNode& node, RailLineConfig* config) {
  if (!IsSection(node)) return;
  YamlSection section(node);
  section.Number("step_m", 0.001, 100.0, "m", &config->publish_step_m);
  section.Number("hold_s", 0.0, 86'400.0, "s", &config->hold_s);
  section.RefuseOthers();
}

void ReadAlerts(const YamlNode& node, std::vector<double>* alert_m) {
  if (!node.exists()) return;
  if (!node.IsList()) {
    node.Fault("must be a list of up to three sizes, such as [1, 3, 5]");
    return;
  }
  const std::vector<YamlNode> items = node.Items();
  if (items.size() > 3) node.Fault("has more than three sizes: watch, alert, alarm");
  for (const YamlNode& item : items) {
    const auto size_mm = item.Number({0.0, 1e4, "mm", true});
    if (!size_mm) continue;
    const double size_m = *size_mm / kMmInM;
    if (!alert_m->empty() && size_m <= alert_m->back()) {
      item.Fault(fmt::format(
          "is {}, and the one before is {}: sizes grow", *size_mm, kMmInM * alert_m->back()));
    }
    alert_m->push_back(size_m);
  }
}

void ReadSettlement(const YamlNode& node, const std::string& file, RailLineConfig* config) {
  if (!IsSection(node)) return;
  YamlSection section(node);
  const auto base = section.Require("base", "line.csv of an earlier run");
  if (const auto text = base.Text()) config->base_line = BesideFile(file, *text);
  section.Number("step_m", 0.001, 100.0, "m", &config->settlement_step_m);
  section.Number("level", 0.5, 0.9999, "", &config->settlement_level);
  ReadAlerts(section.Know("alert_mm"), &config->alert_m);
  section.RefuseOthers();
}

// "2026-10-31", UTC.
std::optional<Timestamp> DayOf(const std::string& text) {
  int year = 0;
  unsigned month = 0;
  unsigned day = 0;
  int used = 0;
  const int found = std::sscanf(text.c_str(), "%4d-%2u-%2u%n", &year, &month, &day, &used);
  const std::chrono::year_month_day date{
      std::chrono::year(year), std::chrono::month(month), std::chrono::day(day)};
  if (found != 3 || static_cast<std::size_t>(used) != text.size() || !date.ok() || year < 1980) {
    return {};
  }
  const auto since = std::chrono::sys_days(date).time_since_epoch();
  return Timestamp{std::chrono::duration_cast<Duration>(since).count()};
}

void ReadCalibration(const YamlNode& node, RailLineConfig* config) {
  if (!IsSection(node)) return;
  YamlSection section(node);
  const YamlNode date = section.Know("date");
  if (date.exists()) {
    const auto text = date.Text();
    if (text) config->calibrated_at = DayOf(*text);
    if (text && !config->calibrated_at) {
      date.Fault(fmt::format("'{}' is no day; 2026-10-31 is one", *text));
    }
  }
  const YamlNode due = section.Know("due_after_days");
  if (due.exists()) config->calibration_due_days = due.Number({0.0, 36'500.0, "days", true});
  section.RefuseOthers();
}

RailLineConfig Read(const YamlNode& root, const std::string& file) {
  RailLineConfig config;
  if (!root.IsMap()) {
    root.Fault("is not a map; guidance/app/example/rail_line.yaml shows what belongs here");
    return config;
  }
  YamlSection section(root);
  const YamlNode id = section.Require("machine_id", "a short name, e.g. tbm-7");
  if (const auto text = id.Text()) {
    config.machine_id = *text;
    if (text->empty() || text->size() > kMostMachineId) {
      id.Fault(fmt::format("must have 1 to {} characters", kMostMachineId));
    }
  }
  const auto path = [&](std::string_view name, std::string_view what, std::string* to) {
    if (const auto text = section.Require(name, what).Text()) *to = BesideFile(file, *text);
  };
  path("runs", "folder for what is measured", &config.runs_folder);
  path("lines", "folder for the finished lines", &config.lines_folder);
  const YamlNode replay = section.Know("replay");
  const YamlNode devices = section.Know("devices");
  if (replay.exists() == devices.exists()) {
    root.Fault("needs either replay, a recorded run, or devices, the instruments themselves");
  }
  if (replay.exists()) ReadReplay(replay, file, &config.replay.emplace());
  if (devices.exists()) ReadDevices(devices, file, &config.devices.emplace());
  section.Scaled("lag_ms", 0.0, 10'000.0, "ms", kMsInS, &config.lag_s);
  section.Scaled("imu_silent_after_ms", 20.0, 60'000.0, "ms", kMsInS, &config.imu_silent_after_s);
  ReadPublish(section.Know("publish"), &config);
  ReadSettlement(section.Know("settlement"), file, &config);
  ReadCalibration(section.Know("calibration"), &config);
  ReadDdsSection(section.Know("dds"), &config.dds);
  section.RefuseOthers();
  return config;
}

}  // namespace

Result<RailLineConfig, RigFileFaults> ParseRailLineConfig(std::string_view yaml,
                                                          const std::string& file) {
  return ReadYaml(yaml, file, [&](const YamlNode& root) { return Read(root, file); });
}

Result<RailLineConfig, RigFileFaults> LoadRailLineConfig(const std::string& path) {
  const auto text = ReadConfigText(path, "rail_line.yaml");
  if (!text) return Failure{text.error()};
  return ParseRailLineConfig(*text, path);
}

}  // namespace tbm
