#include <array>
#include <cstdio>
#include <fstream>
#include <mutex>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <signal.h>

#include "devices/bus/sleeper.h"
#include "devices/inclinometer/make_inclinometers.h"
#include "devices/sim/world.h"
#include "idl/cpp/participant.h"
#include "pose/app/box_config.h"
#include "pose/app/camera_box.h"
#include "pose/app/dds_sink.h"
#include "pose/app/queued_sink.h"
#include "pose/rig/rig_file.h"

namespace tbm {
namespace {

// Exit codes of all our programs (FORMATS §6).
enum ExitCode { kDone = 0, kConfiguration = 2, kDds = 4, kInternal = 70 };

std::string ReadText(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

// SHA-256 in hexadecimal: what `sha256sum rig.yaml` prints.
std::string HashOf(const std::string& text) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  TBM_CHECK(EVP_Digest(text.data(), text.size(), digest.data(), &size, EVP_sha256(), nullptr) == 1);
  std::string hexadecimal;
  for (unsigned int i = 0; i < size; ++i) hexadecimal += fmt::format("{:02x}", digest[i]);
  return hexadecimal;
}

int PrintFaults(const RigFileFaults& faults) {
  for (const RigFileFault& fault : faults) fmt::print(stderr, "{}\n", fault.Text());
  return kConfiguration;
}

dds::ParticipantConfig ParticipantConfigOf(const BoxConfig& config) {
  dds::ParticipantConfig participant;
  participant.domain_id = config.dds.domain;
  participant.name = "camera_box " + config.machine_id;
  participant.interfaces = config.dds.interfaces;
  participant.peers = config.dds.initial_peers;
  return participant;
}

RecorderOptions RecorderOptionsOf(const BoxConfig& config, std::string rig_yaml) {
  RecorderOptions options;
  options.folder = config.recording.folder;
  options.rig_yaml = std::move(rig_yaml);
  options.run_max_duration = config.recording.run_length;
  options.total_max_bytes = config.recording.limit_bytes;
  return options;
}

BoxParts MakeParts(const BoxConfig& config,
                   const Rig& rig,
                   const std::string& rig_yaml,
                   const Clock& clock,
                   Sleeper& sleeper) {
  BoxParts parts;
  if (!config.recording.folder.empty()) {
    parts.recorder = std::make_unique<Recorder>(RecorderOptionsOf(config, rig_yaml));
  }
  if (config.camera.driver == CameraDriver::kReplay) return parts;

  sim::Motion motion;
  motion.tilt_noise_factor = 0.0;  // the simulated inclinometers add their own
  const auto world = std::make_shared<const sim::World>(rig, motion, sim::Faults{}, clock.Now());
  parts.camera = MakeCamera(config.camera, clock, world);
  InclinometerSources sources;
  sources.truths["target"] = [world](Timestamp at) {
    return world->TiltReading(sim::TiltSensor::kTarget, at);
  };
  sources.truths["camera"] = [world](Timestamp at) {
    return world->TiltReading(sim::TiltSensor::kCamera, at);
  };
  const std::array configs = {config.target_inclinometer, config.camera_inclinometer};
  auto inclinometers = MakeInclinometers(configs, sources, clock, sleeper);
  parts.target_inclinometer = std::move(inclinometers[0]);
  parts.camera_inclinometer = std::move(inclinometers[1]);
  return parts;
}

int Main(const std::string& config_file, bool check_only) {
  const auto config = LoadBoxConfig(config_file);
  if (!config) return PrintFaults(config.error());
  const auto loaded = LoadRigFile(config->rig_file);
  if (!loaded) return PrintFaults(loaded.error());
  PrintFaults(loaded->warnings);
  const dds::ParticipantConfig participant_config = ParticipantConfigOf(*config);
  const auto problems = dds::Problems(participant_config);
  for (const std::string& problem : problems) {
    fmt::print(stderr, "{}: dds: {}\n", config_file, problem);
  }
  if (!problems.empty()) return kConfiguration;
  if (check_only) {
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
  std::mutex alarm_mutex;  // guards the two below
  CameraBox* box_for_alarms = nullptr;
  std::vector<dds::Alarm> early_alarms;  // raised before there is a box, such as "no network"
  dds::Participant participant(
      participant_config,
      [&](const dds::Alarm& alarm) {
        const std::lock_guard lock(alarm_mutex);
        if (box_for_alarms != nullptr) {
          box_for_alarms->Report(alarm);
        } else {
          early_alarms.push_back(alarm);
        }
      },
      [](dds::LogLevel level, std::string_view category, std::string_view text) {
        fmt::print(stderr,
                   "source=fastdds severity={} category={} text=\"{}\"\n",
                   level == dds::LogLevel::kError ? "error" : "warning",
                   category,
                   text);
      });
  DdsSink dds_sink(participant);
  QueuedSink sink(dds_sink);
  CameraBox box(*config,
                loaded->rig,
                HashOf(rig_yaml),
                MakeParts(*config, loaded->rig, rig_yaml, clock, sleeper),
                clock,
                sink);
  const auto send_alarms_to = [&](CameraBox* receiver) {
    const std::lock_guard lock(alarm_mutex);
    box_for_alarms = receiver;
    if (receiver == nullptr) return;
    for (const dds::Alarm& alarm : early_alarms) receiver->Report(alarm);
    early_alarms.clear();
  };
  send_alarms_to(&box);

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
  box.Run(stop.get_token());
  send_alarms_to(nullptr);
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
  app.add_option("config", config_file, "camera_box.yaml: devices, DDS, recording")->required();
  app.add_flag("--check", check_only, "read the configuration and the rig file, report, and end");
  app.set_version_flag("--version", std::string(TBM_VERSION));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : tbm::kConfiguration;
  }
  try {
    return tbm::Main(config_file, check_only);
  } catch (const std::exception& error) {
    fmt::print(stderr, "camera_box: {}\n", error.what());
    return tbm::kInternal;
  }
}
