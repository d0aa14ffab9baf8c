#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <signal.h>

#include "devices/app/end_signals.h"
#include "devices/app/service_run.h"
#include "guidance/app/exit_code.h"
#include "guidance/app/guidance_process.h"
#include "guidance/config/guidance_file.h"
#include "idl/cpp/dds_process.h"
#include "pose/base/clock.h"

namespace tbm {
namespace {

void Print(const std::vector<std::string>& lines) {
  for (const std::string& line : lines) fmt::print(stderr, "{}\n", line);
}

int Main(const std::string& config_file, bool check_only) {
  const auto config = LoadGuidanceConfig(config_file);
  if (!config) {
    for (const RigFileFault& fault : config.error()) fmt::print(stderr, "{}\n", fault.Text());
    return static_cast<int>(ExitCode::kBadInput);
  }
  std::error_code ignored;
  if (std::filesystem::exists(config->journal_folder, ignored) &&
      !std::filesystem::is_directory(config->journal_folder, ignored)) {
    fmt::print(stderr,
               "{}: journal.folder: {} is a file; a folder is wanted\n",
               config_file,
               config->journal_folder);
    return static_cast<int>(ExitCode::kBadInput);
  }
  MachineFaults warnings;
  const auto machine = LoadGuidedMachine(config->machine_file, &warnings);
  Print(warnings);
  if (!machine) {
    Print(machine.error());
    return static_cast<int>(ExitCode::kBadInput);
  }
  const auto participant_config =
      dds::ParticipantOf(config->dds, "guidance " + machine->machine.machine_id);
  const auto problems = dds::Problems(participant_config);
  for (const std::string& problem : problems) {
    fmt::print(stderr, "{}: dds: {}\n", config_file, problem);
  }
  if (!problems.empty()) return static_cast<int>(ExitCode::kBadInput);
  if (check_only) {
    fmt::print("{}: good; machine {} with {} prisms, axis '{}' from {:.3f} m to {:.3f} m\n",
               config_file,
               machine->machine.machine_id,
               machine->machine.prisms.size(),
               machine->axis.name(),
               machine->axis.start().m,
               machine->axis.end().m);
    return static_cast<int>(ExitCode::kDone);
  }

  HoldSignals();
  signal(SIGPIPE, SIG_IGN);
  const SystemClock clock;
  dds::AlarmRelay alarms;
  dds::Participant participant(participant_config, alarms.Handler(), dds::LogDds);
  GuidanceProcess process(*config, *machine, participant, clock);
  alarms.SendTo([&process](const dds::Alarm& alarm) { process.Report(alarm); });
  fmt::print(stderr,
             "source=guidance code=started version={} machine_id={} domain={} axis_sha256={}\n",
             TBM_VERSION,
             machine->machine.machine_id,
             config->dds.domain,
             machine->axis.file_sha256());
  RunService(clock, [&process](const std::stop_token& stop, const auto& on_alive) {
    process.Run(stop, on_alive);
  });
  alarms.SendTo({});
  fmt::print(stderr, "source=guidance code=ended\n");
  return static_cast<int>(ExitCode::kDone);
}

}  // namespace
}  // namespace tbm

int main(int argc, char** argv) {
  CLI::App app(
      "Guidance: from total station, camera box and inclinometers to the machine's deviation from "
      "the design axis, on DDS and in a journal.",
      "guidance");
  std::string config_file;
  bool check_only = false;
  app.add_option("config", config_file, "guidance.yaml")->required();
  app.add_flag("--check", check_only, "read all files, report every fault, and end");
  app.set_version_flag("--version", std::string(TBM_VERSION));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return static_cast<int>(app.exit(error) == 0 ? tbm::ExitCode::kDone : tbm::ExitCode::kBadInput);
  }
  return tbm::Main(config_file, check_only);
}
