// What it costs the camera box to make a frame's two messages and to hand them to DDS, with a
// reader in another process. Runs on the emulated Cortex-A8 under the counter of
// tests/arm/count_instructions.c; publish_cost_test.py reads the line it prints.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

#include <sys/prctl.h>

#include "idl/cpp/publisher.h"
#include "pose/app/box_messages.h"
#include "pose/frame/frame_solver.h"
#include "tests/arm/cost_scene.h"

namespace tbm::test {
namespace {

using namespace std::chrono_literals;

constexpr unsigned long kMark = 0x54424D;
constexpr unsigned long kPublish = 20;
constexpr int kFrames = 40;

int Main(int domain_id) {
  const Rig rig = CostRig();
  const std::vector<CostFrame> frames = DarkFrames(rig, 2);
  const CostFrame& frame = frames[1];  // the first one is of 1970
  FrameSolver solver(rig);
  solver.AddTilt({frame.sensed_at, TiltSensor::kTarget, frame.target_tilt.inclination});
  solver.AddTilt({frame.sensed_at, TiltSensor::kCamera, frame.camera_tilt.inclination});
  const FrameResult& result = solver.Solve({frame.sensed_at, frame.image.view});

  dds::ParticipantConfig config;
  config.domain_id = domain_id;
  config.peers = {"127.0.0.1"};  // no multicast
  dds::Participant participant(config);
  dds::Publisher<dds::RelativePose> poses(participant);
  dds::Publisher<dds::FrameFeatures> features(participant);
  for (int i = 0; i < 200 && poses.matched_readers() * features.matched_readers() == 0; ++i) {
    std::this_thread::sleep_for(100ms);
  }
  if (poses.matched_readers() * features.matched_readers() == 0) {
    std::printf("nobody reads\n");
    return 1;
  }
  std::this_thread::sleep_for(500ms);
  for (int i = 0; i < kFrames; ++i) {
    std::this_thread::sleep_for(
        20ms);  // what Fast DDS does on its own between frames is not counted
    prctl(kMark, kPublish, 1ul, 0ul, 0ul);
    dds::RelativePose pose;
    FillRelativePose("TBM-1", "hash", rig, result, &pose);
    pose.sample_number = static_cast<std::uint64_t>(i + 1);
    pose.published_at = frame.sensed_at;
    dds::FrameFeatures seen = FeaturesOf("TBM-1", result, 1, 5000.0, {});
    seen.published_at = frame.sensed_at;
    const auto pose_outcome = poses.Write(pose);
    const auto seen_outcome = features.Write(seen);
    prctl(kMark, kPublish, 0ul, 0ul, 0ul);
    if (pose_outcome != dds::WriteOutcome::kWritten ||
        seen_outcome != dds::WriteOutcome::kWritten) {
      std::printf("not written: pose %d for %d (status %d), features %d\n",
                  static_cast<int>(pose_outcome),
                  static_cast<int>(poses.counters().refused_because),
                  static_cast<int>(result.status),
                  static_cast<int>(seen_outcome));
      return 1;
    }
  }
  std::printf("region %lu publish: %zu spots\n", kPublish, result.centres.size());
  return 0;
}

}  // namespace
}  // namespace tbm::test

int main(int argc, char** argv) { return tbm::test::Main(argc > 1 ? std::atoi(argv[1]) : 162); }
