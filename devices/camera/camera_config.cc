#include <algorithm>
#include <cmath>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>

#include "devices/camera/camera.h"

namespace tbm {
namespace {

constexpr double kMaxFrameRateHz = 200.0;
constexpr Duration kShortestSilence = std::chrono::milliseconds(200);

class Faults {
 public:
  template <class T>
  void Range(const char* key, T value, T low, T high) {
    // Written so that NaN is a fault.
    if (value >= low && value <= high) return;
    lines_.push_back(fmt::format("camera.{}: {}: wanted {} .. {}", key, value, low, high));
  }
  void Add(std::string line) { lines_.push_back(std::move(line)); }
  std::vector<std::string> Take() { return std::move(lines_); }

 private:
  std::vector<std::string> lines_;
};

}  // namespace

std::vector<std::string> CheckCameraConfig(const CameraConfig& config) {
  Faults faults;
  if (config.driver == CameraDriver::kReplay) {
    if (config.run_folder.empty()) {
      faults.Add("camera.run_folder: empty: wanted the folder of a recorded run");
    }
    return faults.Take();
  }
  if (config.driver == CameraDriver::kGige) {
    in_addr parsed{};
    if (inet_pton(AF_INET, config.address.c_str(), &parsed) != 1) {
      faults.Add(fmt::format("camera.address: \"{}\": wanted an IPv4 address such as 192.168.1.10",
                             config.address));
    }
    if (config.packet_size_bytes != 0) {
      faults.Range("packet_size_bytes", config.packet_size_bytes, 576, 16000);
    }
    faults.Range("socket_buffer_bytes", config.socket_buffer_bytes, 65'536, 1 << 30);
    faults.Range("readout_latency_us", config.readout_latency_us, 0.0, 1e6);
  }
  faults.Range("frame_rate_hz", config.frame_rate_hz, 0.1, kMaxFrameRateHz);
  faults.Range("exposure_min_us", config.exposure_min_us, 1.0, 1e6);
  faults.Range(
      "exposure_max_us", config.exposure_max_us, std::max(config.exposure_min_us, 1.0), 1e6);
  faults.Range("exposure_us", config.exposure_us, config.exposure_min_us, config.exposure_max_us);
  if (config.silent_after_ms != 0) {
    faults.Range("silent_after_ms", config.silent_after_ms, 100, 60'000);
  }
  return faults.Take();
}

Duration SilentAfter(const CameraConfig& config) {
  if (config.silent_after_ms != 0) return std::chrono::milliseconds(config.silent_after_ms);
  return std::max<Duration>(Duration(std::llround(3e9 / config.frame_rate_hz)), kShortestSilence);
}

std::string_view StateCode(CameraState state) {
  switch (state) {
    case CameraState::kClosed:
      return "closed";
    case CameraState::kOpening:
      return "opening";
    case CameraState::kStreaming:
      return "streaming";
    case CameraState::kSilent:
      return "silent";
  }
  return "";
}

std::string_view FailureCode(CameraFailure failure) {
  switch (failure) {
    case CameraFailure::kNoFrameInTime:
      return "no_frame_in_time";
    case CameraFailure::kUnreachable:
      return "unreachable";
    case CameraFailure::kInUse:
      return "in_use";
    case CameraFailure::kRefused:
      return "refused";
    case CameraFailure::kSilent:
      return "silent";
    case CameraFailure::kLost:
      return "lost";
    case CameraFailure::kEndOfRun:
      return "end_of_run";
    case CameraFailure::kBadRun:
      return "bad_run";
  }
  return "";
}

}  // namespace tbm
