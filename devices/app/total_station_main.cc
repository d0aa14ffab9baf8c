#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <signal.h>

#include "devices/app/end_signals.h"
#include "devices/app/service_run.h"
#include "devices/app/station_process.h"
#include "devices/total_station/make_total_station.h"
#include "guidance/config/machine_file.h"
#include "idl/cpp/dds_process.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"

namespace tbm {
namespace {

// Exit codes of all our programs (FORMATS §6).
enum ExitCode { kDone = 0, kConfiguration = 2, kInternal = 70 };

// The process' topics on DDS, and one log line to standard error for each event. The participant
// outlives it.
class DdsStationSink final : public StationSink {
 public:
  explicit DdsStationSink(dds::Participant& participant)
      : observations_(participant),
        set_ups_(participant),
        health_(participant),
        events_(participant),
        alarms_(participant),
        replies_(participant) {}

  void Publish(const dds::StationObservation& message) override { observations_.Write(message); }
  void Publish(const dds::StationSetUp& message) override { set_ups_.Write(message); }
  void Publish(const dds::DeviceHealth& message) override { health_.Write(message); }
  void Publish(const dds::AlarmStatus& message) override { alarms_.Write(message); }
  void Publish(const dds::CommandReply& message) override { replies_.Write(message); }
  void Publish(const dds::Event& event) override {
    dds::LogEvent(event);
    events_.Write(event);
  }

 private:
  dds::Publisher<dds::StationObservation> observations_;
  dds::Publisher<dds::StationSetUp> set_ups_;
  dds::Publisher<dds::DeviceHealth> health_;
  dds::Publisher<dds::Event> events_;
  dds::Publisher<dds::AlarmStatus> alarms_;
  dds::Publisher<dds::CommandReply> replies_;
};

int PrintFaults(const RigFileFaults& faults) {
  for (const RigFileFault& fault : faults) fmt::print(stderr, "{}\n", fault.Text());
  return kConfiguration;
}

// Before anything is measured: a set-up that cannot be kept would be lost at the first restart.
std::optional<std::string> StateFileProblem(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return "is a folder; a file's name is wanted";
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder, ignored)) {
    return "its folder is not there";
  }
  return {};
}

int Run(const StationConfig& config,
        const Machine& machine,
        const dds::ParticipantConfig& participant_config) {
  HoldSignals();
  signal(SIGPIPE, SIG_IGN);
  const SystemClock clock;
  SystemSleeper sleeper;
  dds::AlarmRelay alarms;
  dds::Participant participant(participant_config, alarms.Handler(), dds::LogDds);
  DdsStationSink sink(participant);
  const std::unique_ptr<TotalStation> instrument =
      MakeTotalStation(config.instrument, clock, sleeper);
  StationProcess process(config, machine, *instrument, clock, sleeper, sink);
  alarms.SendTo([&process](const dds::Alarm& alarm) { process.Report(alarm); });
  {
    const dds::Subscriber<dds::ShieldPose> poses(
        participant,
        [&process](const dds::ShieldPose& pose, const dds::SampleFacts&) { process.Hear(pose); });
    const dds::Subscriber<dds::Command> commands(
        participant, [&process](const dds::Command& command, const dds::SampleFacts&) {
          process.Hear(command);
        });
    fmt::print(stderr,
               "source=total_station code=started version={} machine_id={} domain={}\n",
               TBM_VERSION,
               machine.machine_id,
               config.dds.domain);
    RunService(clock, [&process](const std::stop_token& stop, const auto& on_alive) {
      process.Run(stop, on_alive);
    });
  }
  alarms.SendTo({});
  fmt::print(stderr, "source=total_station code=ended\n");
  return kDone;
}

int Main(const std::string& config_file, bool check_only) {
  const auto config = LoadStationConfig(config_file);
  if (!config) return PrintFaults(config.error());
  if (const auto problem = StateFileProblem(config->state_file)) {
    fmt::print(stderr, "{}: state_file: {}: {}\n", config_file, config->state_file, *problem);
    return kConfiguration;
  }
  const auto machine = LoadMachineFile(config->machine_file);
  if (!machine) return PrintFaults(machine.error());
  const auto participant_config =
      dds::ParticipantOf(config->dds, "total_station " + machine->machine.machine_id);
  const auto problems = dds::Problems(participant_config);
  for (const std::string& problem : problems) {
    fmt::print(stderr, "{}: dds: {}\n", config_file, problem);
  }
  if (!problems.empty()) return kConfiguration;
  if (check_only) {
    fmt::print("{}: good; machine {} with {} prisms, {} references\n",
               config_file,
               machine->machine.machine_id,
               machine->machine.prisms.size(),
               config->keeper.references.size());
    return kDone;
  }
  return Run(*config, machine->machine, participant_config);
}

}  // namespace
}  // namespace tbm

int main(int argc, char** argv) {
  CLI::App app(
      "The total station's process: keeps the instrument's set-up by its references, measures the "
      "rear shield's prisms, and publishes both on DDS.",
      "total_station");
  std::string config_file;
  bool check_only = false;
  app.add_option("config", config_file, "total_station.yaml")->required();
  app.add_flag("--check", check_only, "read all files, report every fault, and end");
  app.set_version_flag("--version", std::string(TBM_VERSION));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? tbm::kDone : tbm::kConfiguration;
  }
  try {
    return tbm::Main(config_file, check_only);
  } catch (const std::exception& error) {
    fmt::print(stderr, "total_station: {}\n", error.what());
    return tbm::kInternal;
  }
}
