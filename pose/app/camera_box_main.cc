#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <signal.h>

#include "devices/bus/sleeper.h"
#include "idl/cpp/dds_process.h"
#include "pose/app/box_config.h"
#include "pose/app/box_parts.h"
#include "pose/app/camera_box.h"
#include "pose/app/dds_sink.h"
#include "pose/app/log_sink.h"
#include "pose/app/queued_sink.h"
#include "pose/app/self_test_run.h"
#include "pose/app/service_manager.h"
#include "pose/rig/rig_file.h"

namespace tbm {
namespace {

// Exit codes of all our programs (FORMATS §6).
enum ExitCode { kDone = 0, kConfiguration = 2, kDevice = 3, kInternal = 70 };

std::string ReadText(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

int PrintFaults(const RigFileFaults& faults) {
  for (const RigFileFault& fault : faults) fmt::print(stderr, "{}\n", fault.Text());
  return kConfiguration;
}

enum class Job { kRun, kCheck, kSelfTest };

int Main(const std::string& config_file, Job job, double self_test_s) {
  const auto config = LoadBoxConfig(config_file);
  if (!config) return PrintFaults(config.error());
  const auto loaded = LoadRigFile(config->rig_file);
  if (!loaded) return PrintFaults(loaded.error());
  PrintFaults(loaded->warnings);
  const dds::ParticipantConfig participant_config =
      dds::ParticipantOf(config->dds, "camera_box " + config->machine_id);
  const auto problems = dds::Problems(participant_config);
  for (const std::string& problem : problems) {
    fmt::print(stderr, "{}: dds: {}\n", config_file, problem);
  }
  if (!problems.empty()) return kConfiguration;
  if (job == Job::kCheck) {
    fmt::print(
        "{}: good; rig {} with {} LEDs\n", config_file, config->rig_file, loaded->rig.leds.size());
    return kDone;
  }

  // Held back before any thread is made, so that only the thread below sees them.
  sigset_t ending;
  sigemptyset(&ending);
  sigaddset(&ending, SIGINT);
  sigaddset(&ending, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ending, nullptr);
  signal(SIGPIPE, SIG_IGN);

  const SystemClock clock;
  SystemSleeper sleeper;
  const std::string rig_yaml = ReadText(config->rig_file);
  if (job == Job::kSelfTest) {
    return RunSelfTest(*config, loaded->rig, self_test_s, clock, sleeper) ? kDone : kDevice;
  }
  dds::AlarmRelay alarms;
  dds::Participant participant(participant_config, alarms.Handler(), dds::LogDds);
  DdsSink dds_sink(participant);
  LogSink log_sink(dds_sink);
  QueuedSink sink(log_sink);
  CameraBox box(*config,
                loaded->rig,
                HashOf(rig_yaml),
                MakeParts(*config, loaded->rig, rig_yaml, clock, sleeper),
                clock,
                sink);
  alarms.SendTo([&box](const dds::Alarm& alarm) { box.Report(alarm); });

  std::stop_source stop;
  std::jthread signals([&](const std::stop_token& done) {
    const timespec look{0, 100'000'000};
    while (!done.stop_requested()) {
      if (sigtimedwait(&ending, nullptr, &look) > 0) stop.request_stop();
    }
  });
  fmt::print(stderr,
             "source=camera_box code=started version={} machine_id={} domain={}\n",
             TBM_VERSION,
             config->machine_id,
             config->dds.domain);
  ServiceManager manager(clock);
  box.Run(stop.get_token(), [&manager] { manager.TellAlive(); });
  manager.TellStopping();
  alarms.SendTo({});
  fmt::print(stderr, "source=camera_box code=ended\n");
  return kDone;
}

}  // namespace
}  // namespace tbm

int main(int argc, char** argv) {
  CLI::App app{
      "The camera box: grabs frames, reads both inclinometers, and publishes the front shield's "
      "pose "
      "relative to the rear shield on DDS."};
  std::string config_file;
  bool check_only = false;
  bool self_test = false;
  double self_test_s = 5.0;
  app.add_option("config", config_file, "camera_box.yaml: devices, DDS, recording")->required();
  app.add_flag("--check", check_only, "read the configuration and the rig file, report, and end");
  app.add_flag(
      "--self-test",
      self_test,
      "for the installer: try camera, LEDs, inclinometers, clock, disk and DDS, say what is "
      "wrong and what to do, and end");
  app.add_option("--seconds", self_test_s, "how long --self-test measures")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 600.0));
  app.set_version_flag("--version", std::string(TBM_VERSION));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : tbm::kConfiguration;
  }
  try {
    const tbm::Job job = check_only  ? tbm::Job::kCheck
                         : self_test ? tbm::Job::kSelfTest
                                     : tbm::Job::kRun;
    return tbm::Main(config_file, job, self_test_s);
  } catch (const std::exception& error) {
    fmt::print(stderr, "camera_box: {}\n", error.what());
    return tbm::kInternal;
  }
}
