#include <cstdio>
#include <filesystem>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <signal.h>

#include "devices/app/end_signals.h"
#include "devices/app/service_run.h"
#include "devices/replay/csv.h"
#include "guidance/app/exit_code.h"
#include "guidance/app/rail_line_process.h"
#include "guidance/app/rail_outcome.h"
#include "guidance/app/run_folders.h"
#include "guidance/config/rail_line_file.h"
#include "idl/cpp/dds_process.h"
#include "pose/base/clock.h"

namespace tbm {
namespace {

int BadInput() { return static_cast<int>(ExitCode::kBadInput); }

// Empty where there is no such file.
std::string TextOf(const std::string& path) {
  auto text = ReadTextFile(path);
  return text ? std::move(text).value() : "";
}

// A file where a folder belongs would be noticed when the run is over.
bool AreFolders(const RailLineConfig& config, const std::string& config_file) {
  bool are = true;
  for (const auto& [key, path] :
       {std::pair("runs", config.runs_folder), std::pair("lines", config.lines_folder)}) {
    std::error_code ignored;
    if (!std::filesystem::exists(path, ignored) || std::filesystem::is_directory(path, ignored)) {
      continue;
    }
    fmt::print(stderr, "{}: {}: {} is a file; a folder is wanted\n", config_file, key, path);
    are = false;
  }
  return are;
}

// Half a day of time zones, for a calibration of today.
constexpr Duration kOfToday = std::chrono::hours(14);

std::optional<std::string> CalibrationFault(const RailLineConfig& config, Timestamp now) {
  if (!config.calibrated_at || *config.calibrated_at <= now + kOfToday) return {};
  return "calibration.date: lies in the future; it, or this computer's clock, is wrong";
}

int Main(const std::string& config_file, bool check_only) {
  const auto config = LoadRailLineConfig(config_file);
  if (!config) {
    for (const RigFileFault& fault : config.error()) fmt::print(stderr, "{}\n", fault.Text());
    return BadInput();
  }
  if (!AreFolders(*config, config_file)) return BadInput();
  const SystemClock clock;
  if (const auto fault = CalibrationFault(*config, clock.Now())) {
    fmt::print(stderr, "{}: {}\n", config_file, *fault);
    return BadInput();
  }
  if (const auto fault = BaseFault(*config)) {
    fmt::print(stderr, "{}: settlement.base: {}\n", config_file, *fault);
    return BadInput();
  }
  const std::string folder =
      config->replay ? config->replay->run_folder : config->devices->setup_folder;
  const auto run = config->replay ? ReadRailRun(folder) : ReadRailSetup(folder);
  if (!run) {
    for (const FileFault& fault : run.error()) fmt::print(stderr, "{}\n", fault.Text());
    return BadInput();
  }
  for (const std::string& warning : run->warnings) fmt::print(stderr, "warning: {}\n", warning);
  if (!run->recording.grounds.empty()) {
    fmt::print(stderr, "warning: {}/displacement.csv is not played\n", folder);
  }
  if (config->devices && run->setup.imu.rate_hz != config->devices->imu.scales.sample_rate_hz) {
    fmt::print(stderr,
               "{}: devices.imu.sample_rate_hz: is {}, and {}/rail.yaml says imu.rate_hz: {}\n",
               config_file,
               config->devices->imu.scales.sample_rate_hz,
               folder,
               run->setup.imu.rate_hz);
    return BadInput();
  }
  const auto participant_config =
      dds::ParticipantOf(config->dds, "rail_line " + config->machine_id);
  const auto problems = dds::Problems(participant_config);
  for (const std::string& problem : problems) {
    fmt::print(stderr, "{}: dds: {}\n", config_file, problem);
  }
  if (!problems.empty()) return BadInput();
  if (check_only) {
    fmt::print("{}: good; machine {}, {}\n",
               config_file,
               config->machine_id,
               config->replay ? fmt::format("{} samples of {} are played at {:g} times their speed",
                                            run->recording.imu.size(),
                                            folder,
                                            config->replay->speed)
                              : fmt::format("a unit at {}", config->devices->imu.port.path));
    return static_cast<int>(ExitCode::kDone);
  }

  RunFolders folders(config->runs_folder, config->lines_folder);
  if (const auto fault = folders.Take()) {
    fmt::print(stderr, "{}: {}\n", config_file, *fault);
    return BadInput();
  }
  HoldSignals();
  signal(SIGPIPE, SIG_IGN);
  dds::AlarmRelay alarms;
  dds::Participant participant(participant_config, alarms.Handler(), dds::LogDds);
  const RailLineProcess::Texts texts{TextOf(folder + "/rail.yaml"),
                                     TextOf(folder + "/targets.csv")};
  RailLineProcess process(*config, *run, texts, folders, participant, clock);
  alarms.SendTo([&process](const dds::Alarm& alarm) { process.Report(alarm); });
  fmt::print(stderr,
             "source=rail_line code=started version={} machine_id={} domain={}\n",
             TBM_VERSION,
             config->machine_id,
             config->dds.domain);
  ExitCode code = ExitCode::kDone;
  RunService(clock, [&](const std::stop_token& stop, const auto& on_alive) {
    code = process.Run(stop, on_alive);
  });
  alarms.SendTo({});
  fmt::print(stderr, "source=rail_line code=ended\n");
  return static_cast<int>(code);
}

}  // namespace
}  // namespace tbm

int main(int argc, char** argv) {
  CLI::App app(
      "Rail line: follows a trolley live by its inertial unit, inclinometer and targets, and makes "
      "the line of the rail when the run ends.",
      "rail_line");
  std::string config_file;
  bool check_only = false;
  app.add_option("config", config_file, "rail_line.yaml")->required();
  app.add_flag("--check", check_only, "read all files, report every fault, and end");
  app.set_version_flag("--version", std::string(TBM_VERSION));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return static_cast<int>(app.exit(error) == 0 ? tbm::ExitCode::kDone : tbm::ExitCode::kBadInput);
  }
  return tbm::Main(config_file, check_only);
}
