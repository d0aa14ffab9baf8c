#include "pose/app/box_parts.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>
#include <openssl/evp.h>

#include "devices/inclinometer/make_inclinometers.h"
#include "devices/sim/world.h"
#include "pose/base/check.h"

namespace tbm {
namespace {

RecorderOptions RecorderOptionsOf(const BoxConfig& config, std::string rig_yaml) {
  RecorderOptions options;
  options.folder = config.recording.folder;
  options.rig_yaml = std::move(rig_yaml);
  options.run_max_duration = config.recording.run_length;
  options.total_max_bytes = config.recording.limit_bytes;
  // A power cut costs a second at the most.
  options.sync_every_frames = std::max(1, static_cast<int>(config.camera.frame_rate_hz));
  return options;
}

}  // namespace

std::string HashOf(const std::string& text) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  TBM_CHECK(EVP_Digest(text.data(), text.size(), digest.data(), &size, EVP_sha256(), nullptr) == 1);
  std::string hexadecimal;
  for (unsigned int i = 0; i < size; ++i) hexadecimal += fmt::format("{:02x}", digest[i]);
  return hexadecimal;
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

}  // namespace tbm
