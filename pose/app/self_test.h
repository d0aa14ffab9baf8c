#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "devices/camera/camera.h"
#include "devices/inclinometer/inclinometer.h"
#include "pose/app/box_config.h"
#include "pose/app/box_messages.h"
#include "pose/app/host_facts.h"
#include "pose/rig/rig.h"

namespace tbm {

// `camera_box --self-test`: tells the installer on the ladder in plain words what is wrong. The box
// runs for some seconds as it always does, its messages are collected, and what they show is judged
// here. Judging is pure.

enum class Verdict {
  kGood,
  kDoubtful,  // the box works, but not as well or not as long as it should
  kBad,       // there will be no pose, or none worth trusting
};

struct Finding {
  Verdict verdict = Verdict::kGood;
  std::string part;    // "camera", "LED 3", "clock"
  std::string text;    // what was seen, with the figure
  std::string remedy;  // what to do; empty when all is well
};

// Collects what a running box says.
class SelfTestCollector final : public MessageSink {
 public:
  struct Led {
    int frames = 0;          // in which it was named
    int frames_clipped = 0;  // of these
    double sum_level_dn = 0.0;
    double sum_spread_px = 0.0;
    double sum_elongation = 0.0;
  };
  struct Tilt {
    int readings = 0;
    std::array<double, 2> sum_rad{};
    std::array<double, 2> sum_steps_rad2{};  // of the squared differences of neighbours
    std::array<double, 2> last_rad{};
  };
  struct Seen {
    int frames = 0;
    std::array<int, 64> frames_with_reason{};  // index: PoseReason of the frame's image
    std::array<Led, kMaxLeds> leds;
    std::array<Tilt, 2> tilts;  // target, camera
    int poses_ok = 0;
    int poses_degraded = 0;
    int poses_none = 0;
    std::array<int, 64> poses_with_reason{};
    double exposure_s = dds::kNaN;  // of the last frame
    std::optional<dds::RelativePose> last_pose;
  };

  void Publish(const dds::FrameFeatures& message) override;
  void Publish(const dds::TiltReading& message) override;
  void Publish(const dds::RelativePose& message) override;
  void Publish(const dds::DeviceHealth&) override {}
  void Publish(const dds::Event&) override {}

  Seen seen() const;
  // Forgets what has come so far: the exposure has settled, measuring begins.
  void Restart();

 private:
  mutable std::mutex mutex_;  // guards all below
  Seen seen_;
};

// How long was measured, and what the devices counted meanwhile.
struct MeasuredSpan {
  double seconds = 0.0;
  CameraHealth camera_before;
  CameraHealth camera;
  std::array<InclinometerHealth, 2> tilt_before;  // target, camera
  std::array<InclinometerHealth, 2> tilt;
};

std::vector<Finding> JudgeHost(const HostFacts& host, const BoxConfig& config, const Rig& rig);
std::vector<Finding> JudgeCamera(const MeasuredSpan& span,
                                 const SelfTestCollector::Seen& seen,
                                 const BoxConfig& config);
std::vector<Finding> JudgeLeds(const SelfTestCollector::Seen& seen,
                               const BoxConfig& config,
                               const Rig& rig);
std::vector<Finding> JudgeTilts(const MeasuredSpan& span,
                                const SelfTestCollector::Seen& seen,
                                const BoxConfig& config,
                                const Rig& rig);
std::vector<Finding> JudgePose(const SelfTestCollector::Seen& seen);

// One line a finding, remedies indented below, and a closing line that counts.
std::string ReportText(const std::vector<Finding>& findings);

}  // namespace tbm
