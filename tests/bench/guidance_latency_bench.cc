// How long it takes from a camera frame in the grabber's hand to the deviation in the handler of
// another process: copy, find, assign, solve, bound, DDS, the guidance process (a step and its
// journal), DDS. All of it is the product's own code; the guidance runs in a process of its own
// with its journal on the disk. The rival is the same frame's relative pose, received over DDS by
// the same listener: what guidance adds.
//
//   guidance_latency_bench [frames]
#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include <sys/wait.h>
#include <unistd.h>

#include "devices/sim/camera_view.h"
#include "devices/sim/world.h"
#include "guidance/app/guidance_process.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "pose/app/box_messages.h"
#include "pose/app/frame_mailbox.h"
#include "pose/app/queued_sink.h"
#include "pose/frame/frame_solver.h"
#include "tests/guidance/drive_messages.h"
#include "tests/idl/dds_support.h"
#include "tests/support/temp_folder.h"

namespace tbm::test {
namespace {

using namespace std::chrono_literals;
using dds::test::Eventually;
using dds::test::OnLoopback;

constexpr int kDomain = 191;
constexpr double kWanted_ms = 20.0;

// Where the time of each frame ends up. Keyed by the exposure's stamp.
class Latencies {
 public:
  explicit Latencies(const Clock& clock) : clock_(clock) {}

  void Begin(Timestamp stamp) {
    const std::lock_guard lock(mutex_);
    began_[stamp.ns] = clock_.Steady();
  }
  void Pose(Timestamp stamp) { End(stamp, &poses_ms_); }
  void Deviation(Timestamp stamp) { End(stamp, &deviations_ms_); }

  std::vector<double> poses_ms() const {
    const std::lock_guard lock(mutex_);
    return poses_ms_;
  }
  std::vector<double> deviations_ms() const {
    const std::lock_guard lock(mutex_);
    return deviations_ms_;
  }

 private:
  void End(Timestamp stamp, std::vector<double>* to) {
    const auto now = clock_.Steady();
    const std::lock_guard lock(mutex_);
    const auto found = began_.find(stamp.ns);
    if (found == began_.end()) return;
    to->push_back(std::chrono::duration<double, std::milli>(now - found->second).count());
  }

  const Clock& clock_;
  mutable std::mutex mutex_;
  std::map<std::int64_t, std::chrono::steady_clock::time_point> began_;
  std::vector<double> poses_ms_;
  std::vector<double> deviations_ms_;
};

// The camera box's frame path with one rendered frame over and over, stamped now.
class FramePath final : public MessageSink {
 public:
  FramePath(const Rig& rig,
            const std::string& machine_id,
            dds::Participant& participant,
            const Clock& clock,
            Latencies& latencies)
      : rig_(rig),
        machine_id_(machine_id),
        clock_(clock),
        latencies_(latencies),
        poses_(participant),
        tilts_(participant),
        solver_(rig_),
        queue_(*this) {
    const Timestamp begin = clock.Now();
    const auto world =
        std::make_shared<const sim::World>(rig_, sim::Motion{}, sim::Faults{}, begin);
    sim::CameraView view(world, {});
    pixels_.resize(view.size_bytes());
    view.Render(begin, 5000.0, pixels_.data());
    frame_.image = {pixels_.data(), view.width_px(), view.height_px(), view.width_px(), 1, 255};
    readings_[0] = world->TiltReading(sim::TiltSensor::kTarget, begin);
    readings_[1] = world->TiltReading(sim::TiltSensor::kCamera, begin);
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        if (const OwnedFrame* frame = mailbox_.Take(100ms)) Solve(frame->frame);
      }
    });
  }

  void FrameIn() {
    ++frame_.frame_number;
    frame_.sensed_at = clock_.Now();
    latencies_.Begin(frame_.sensed_at);
    mailbox_.Put(frame_);
  }

  void Publish(const dds::RelativePose& message) override { poses_.Write(message); }
  void Publish(const dds::TiltReading&) override {}
  void Publish(const dds::FrameFeatures&) override {}
  void Publish(const dds::DeviceHealth&) override {}
  void Publish(const dds::Event&) override {}
  bool IsHeard() const { return poses_.matched_readers() >= 2; }

 private:
  void Solve(const Frame& frame) {
    solver_.AddTilt({frame.sensed_at, TiltSensor::kTarget, readings_[0]});
    solver_.AddTilt({frame.sensed_at, TiltSensor::kCamera, readings_[1]});
    const FrameResult& result = solver_.Solve({frame.sensed_at, frame.image, PoseReason::kNone});
    dds::RelativePose pose;
    FillRelativePose(machine_id_, "hash", rig_, result, &pose);
    pose.sample_number = frame.frame_number;
    pose.published_at = clock_.Now();
    queue_.Publish(pose);
  }

  Rig rig_;
  std::string machine_id_;
  const Clock& clock_;
  Latencies& latencies_;
  dds::Publisher<dds::RelativePose> poses_;
  dds::Publisher<dds::TiltReading> tilts_;
  std::vector<std::uint8_t> pixels_;
  Frame frame_;
  std::array<Inclination, 2> readings_;
  FrameSolver solver_;
  FrameMailbox mailbox_;
  QueuedSink queue_;
  std::jthread thread_;
};

int Guide(const GuidedMachine& machine, const std::string& journal) {
  sigset_t ending;
  sigemptyset(&ending);
  sigaddset(&ending, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ending, nullptr);
  const SystemClock clock;
  GuidanceConfig config;
  config.journal_folder = journal;
  dds::Participant participant(OnLoopback(kDomain, "guidance"));
  GuidanceProcess process(config, machine, participant, clock);
  std::jthread thread([&](std::stop_token stop) { process.Run(stop); });
  int signal = 0;
  sigwait(&ending, &signal);
  return 0;
}

double Percentile(std::vector<double> values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

void PrintHistogram(const std::vector<double>& values_ms) {
  const std::array limits_ms = {0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0, 10.0, 20.0, 1e9};
  double low = 0.0;
  for (const double high : limits_ms) {
    const auto count = std::count_if(values_ms.begin(), values_ms.end(), [&](double value) {
      return value >= low && value < high;
    });
    const double share = static_cast<double>(count) / static_cast<double>(values_ms.size());
    std::printf("  %5.1f ms .. %s %5.1f %% %s\n",
                low,
                high > 1e6 ? "          " : (std::to_string(high).substr(0, 4) + " ms").c_str(),
                100.0 * share,
                std::string(static_cast<std::size_t>(60.0 * share + 0.5), '#').c_str());
    low = high;
  }
}

int Main(int frames) {
  const GuidedMachine machine = ExampleMachine();
  const TempFolder folder;
  const pid_t guidance = fork();  // before anything of DDS exists
  if (guidance == 0) std::_Exit(Guide(machine, folder / "journal"));

  const SystemClock clock;
  Latencies latencies(clock);
  dds::Participant participant(OnLoopback(kDomain, "camera"));
  dds::Participant listener(OnLoopback(kDomain, "listener"));
  const dds::Subscriber<dds::RelativePose> poses(
      listener,
      [&](const dds::RelativePose& m, const dds::SampleFacts&) { latencies.Pose(m.sensed_at); });
  const dds::Subscriber<dds::Guidance> guidances(
      listener,
      [&](const dds::Guidance& m, const dds::SampleFacts&) { latencies.Deviation(m.valid_at); });
  dds::Publisher<dds::StationObservation> observations(participant);
  dds::Publisher<dds::StationSetUp> set_ups(participant);
  FramePath path(machine.rig, machine.machine.machine_id, participant, clock, latencies);
  int status = 1;
  if (Eventually([&] { return path.IsHeard() && observations.matched_readers() > 0; }, 10s)) {
    // A round of prisms, as if it had just ended: without it there is no deviation to compute.
    Drive drive(machine, {}, "guidance latency");
    drive.Measure(2100.0);
    const Duration later = clock.Now() - drive.now();
    for (GuidanceMessage message : DriveMessages(machine.machine).From(drive.inputs())) {
      if (auto* seen = std::get_if<dds::StationObservation>(&message)) {
        seen->sensed_at = seen->sensed_at + later;
        observations.Write(*seen);
      } else if (const auto* set_up = std::get_if<dds::StationSetUp>(&message)) {
        set_ups.Write(*set_up);
      }
    }
    for (int i = 0; i < frames; ++i) {
      path.FrameIn();
      std::this_thread::sleep_for(10ms);
    }
    std::this_thread::sleep_for(300ms);
    status = 0;
  }
  kill(guidance, SIGTERM);
  waitpid(guidance, nullptr, 0);
  const std::vector<double> deviations = latencies.deviations_ms();
  const std::vector<double> relative = latencies.poses_ms();
  if (status != 0 || deviations.size() < 50 || relative.size() < 50) {
    std::printf("guidance_latency: too little arrived (%zu poses, %zu deviations)\n",
                relative.size(),
                deviations.size());
    return 1;
  }
  std::printf("from a frame to the deviation in another process, %zu of %d frames\n",
              deviations.size(),
              frames);
  PrintHistogram(deviations);
  std::printf("frame to relative pose  p50 %6.2f ms  p99 %6.2f ms\n",
              Percentile(relative, 0.5),
              Percentile(relative, 0.99));
  std::printf("frame to deviation      p50 %6.2f ms  p99 %6.2f ms (wanted below %.0f)\n",
              Percentile(deviations, 0.5),
              Percentile(deviations, 0.99),
              kWanted_ms);
  std::printf("bench guidance_latency: %.2fx p99 of the frame's relative pose\n",
              Percentile(deviations, 0.99) / Percentile(relative, 0.99));
  return 0;
}

}  // namespace
}  // namespace tbm::test

int main(int argc, char** argv) {
  return tbm::test::Main(argc > 1 ? std::max(100, std::atoi(argv[1])) : 1500);
}
