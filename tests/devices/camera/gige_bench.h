#pragma once

#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "devices/app/gige_simulator.h"
#include "devices/camera/camera.h"
#include "tests/devices/camera/own_network.h"
#include "tests/devices/camera/small_machine.h"

namespace tbm::test {

inline constexpr const char* kCameraAddress = "127.0.0.1";
inline constexpr const char* kProxyAddress = "127.0.0.2";

inline std::unique_ptr<GigeSimulator> StartSimulator(
    std::shared_ptr<const sim::World> world = SmallWorld(),
    std::function<void(const Shown&)> on_shown = {}) {
  GigeSimulatorOptions options;
  options.address = kCameraAddress;
  options.stamp_sequence = true;
  auto simulator =
      GigeSimulator::Start(options, std::move(world), PlainView(), std::move(on_shown));
  if (!simulator) {
    ADD_FAILURE() << simulator.error();
    return nullptr;
  }
  return std::move(simulator).value();
}

// Jumbo packets: few of them, so that a busy computer loses none.
inline CameraConfig GigeConfig(double frame_rate_hz, const char* address = kCameraAddress) {
  CameraConfig config;
  config.driver = CameraDriver::kGige;
  config.address = address;
  config.packet_size_bytes = 8192;
  config.frame_rate_hz = frame_rate_hz;
  return config;
}

// The simulator's count of frames sent, from the frame's first bytes.
inline std::optional<std::uint32_t> SequenceOf(const Frame& frame) {
  const auto* const bytes = static_cast<const std::uint8_t*>(frame.image.pixels);
  if (bytes == nullptr || std::memcmp(bytes, "TBM#", 4) != 0) return std::nullopt;
  return bytes[4] | bytes[5] << 8 | bytes[6] << 16 | static_cast<std::uint32_t>(bytes[7]) << 24;
}

// The next frame, whatever failures come before it; nothing when none comes in `patience`.
inline std::optional<Frame> NextFrame(Camera& camera,
                                      Duration patience = std::chrono::seconds(10)) {
  const auto until = std::chrono::steady_clock::now() + patience;
  while (std::chrono::steady_clock::now() < until) {
    const auto frame = camera.WaitFrame(std::chrono::milliseconds(100));
    if (frame) return *frame;
  }
  return std::nullopt;
}

// Frames for so long; how many came.
inline int FramesFor(Camera& camera, Duration span) {
  int frames = 0;
  const auto until = std::chrono::steady_clock::now() + span;
  while (std::chrono::steady_clock::now() < until) {
    if (camera.WaitFrame(std::chrono::milliseconds(50))) ++frames;
  }
  return frames;
}

inline int MaxPixel(const Frame& frame) {
  const auto* const bytes = static_cast<const std::uint8_t*>(frame.image.pixels);
  int brightest = 0;
  for (int i = 8; i < frame.image.width_px * frame.image.height_px; ++i) {
    brightest = std::max<int>(brightest, bytes[i]);
  }
  return brightest;
}

class OwnNetwork : public ::testing::Environment {
 public:
  void SetUp() override {
    const std::string why_not = EnterOwnNetwork();
    if (!why_not.empty())
      std::printf("no network namespace (%s): using this computer's\n", why_not.c_str());
  }
};
inline ::testing::Environment* const own_network =
    ::testing::AddGlobalTestEnvironment(new OwnNetwork);

}  // namespace tbm::test
