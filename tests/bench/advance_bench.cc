// What one step of the guidance takes, frame by frame along the example drive: poses and tilts at
// 10 Hz, a prism of the rear shield every fourth second, as the instruments give them. The rival is
// one cv::solvePnP of the five LEDs, the least that any camera-based guidance must do per frame.
//
//   advance_bench [steps]
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "guidance/core/guidance_core.h"
#include "tests/support/drive.h"
#include "tests/support/no_alloc.h"
#include "tests/support/scene.h"

namespace tbm::test {
namespace {

using Clock = std::chrono::steady_clock;

double Since_us(Clock::time_point began) {
  return std::chrono::duration<double, std::micro>(Clock::now() - began).count();
}
double Percentile(std::vector<double> values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

// The inputs of one frame: what came since the last one.
struct FrameInputs {
  std::vector<GuidanceInput> inputs;
  Timestamp now;
};

// The rounds of a drive, their readings spread over frames as they come in the tunnel.
std::vector<FrameInputs> Frames(const GuidedMachine& machine, int rounds) {
  std::vector<FrameInputs> frames;
  Drive drive(machine, {}, "advance bench");
  for (int round = 0; round < rounds; ++round) {
    drive.Measure(2060.0 + 300.0 * round / rounds);
    std::vector<GuidanceInput> prisms;
    std::vector<GuidanceInput> tilts;
    RelativeSeen pose;
    for (const GuidanceInput& input : drive.inputs()) {
      if (const auto* seen = std::get_if<RelativeSeen>(&input)) pose = *seen;
      if (std::holds_alternative<PrismSeen>(input)) prisms.push_back(input);
      if (std::holds_alternative<TiltSeen>(input)) tilts.push_back(input);
    }
    FrameInputs first{{}, drive.now()};
    for (const GuidanceInput& input : drive.inputs()) {
      if (std::holds_alternative<SetUpKnown>(input)) first.inputs.push_back(input);
    }
    frames.push_back(first);
    for (int frame = 0; frame < 40 * static_cast<int>(prisms.size()); ++frame) {
      const Timestamp now = drive.now() + std::chrono::milliseconds(100 * (frame + 1));
      FrameInputs next{{}, now};
      for (int i = 0; i < 2; ++i) {
        TiltSeen tilt =
            std::get<TiltSeen>(tilts[tilts.size() - 1 - static_cast<std::size_t>(10 * i)]);
        tilt.sensed_at = now;
        next.inputs.push_back(tilt);
      }
      if (frame % 40 == 39) next.inputs.push_back(prisms[static_cast<std::size_t>(frame / 40)]);
      pose.sensed_at = now;
      next.inputs.push_back(pose);
      frames.push_back(next);
    }
  }
  return frames;
}

double SolvePnP_us(const GuidedMachine& machine) {
  Random random("advance bench, rival");
  const Rig& rig = machine.rig;
  const Truth truth = DrawTruth(random, {});
  const PoseProblem problem = NoisyProblem(rig, truth, 0.1, 1e-4, random);
  std::vector<cv::Point3d> places;
  std::vector<cv::Point2d> pixels;
  for (const LedObservation& led : problem.leds) {
    const Eigen::Vector3d& p = rig.leds[static_cast<std::size_t>(led.led_index)].p_led_in_target;
    places.emplace_back(p.x(), p.y(), p.z());
    pixels.emplace_back(led.pixel_px.x(), led.pixel_px.y());
  }
  const CameraModel& camera = rig.camera;
  const cv::Matx33d matrix(camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1);
  const cv::Vec<double, 5> lens(camera.k1, camera.k2, camera.p1, camera.p2, camera.k3);
  std::vector<double> times;
  cv::Vec3d turn;
  cv::Vec3d shift;
  cv::solvePnP(places, pixels, matrix, lens, turn, shift, false, cv::SOLVEPNP_EPNP);
  for (int i = 0; i < 2000; ++i) {
    const auto began = Clock::now();
    cv::solvePnP(places, pixels, matrix, lens, turn, shift, true, cv::SOLVEPNP_ITERATIVE);
    times.push_back(Since_us(began));
  }
  return Percentile(times, 0.5);
}

int Main(int rounds) {
  const GuidedMachine machine = ExampleMachine();
  const std::vector<FrameInputs> frames = Frames(machine, rounds);
  cv::setNumThreads(1);
  const double rival_us = SolvePnP_us(machine);
  GuidanceCore core(machine.machine, machine.rig, machine.axis);
  std::vector<double> all;
  std::vector<double> with_prism;
  all.reserve(frames.size());
  with_prism.reserve(frames.size());
  long heap = 0;
  int valid = 0;
  for (const FrameInputs& frame : frames) {
    const HeapCounter counter;
    const auto began = Clock::now();
    const Snapshot& snapshot = core.Advance(frame.inputs, frame.now);
    const double took = Since_us(began);
    heap += counter.Count();
    all.push_back(took);
    const auto is_prism = [](const GuidanceInput& input) {
      return std::holds_alternative<PrismSeen>(input);
    };
    if (std::any_of(frame.inputs.begin(), frame.inputs.end(), is_prism)) with_prism.push_back(took);
    valid += snapshot.points[machine.machine.steer_by].worth == Worth::kValid;
  }
  std::printf(
      "%zu steps, %d with a valid position, %ld requests for heap\n", all.size(), valid, heap);
  std::printf("one step          p50 %6.1f us  p99 %6.1f us  (wanted below 100)\n",
              Percentile(all, 0.5),
              Percentile(all, 0.99));
  std::printf("with a new prism  p50 %6.1f us  p99 %6.1f us\n",
              Percentile(with_prism, 0.5),
              Percentile(with_prism, 0.99));
  std::printf("bench advance: %.2fx of one cv::solvePnP (%.1f us), p50\n",
              Percentile(all, 0.5) / rival_us,
              rival_us);
  return heap == 0 && valid > 0 ? 0 : 1;
}

}  // namespace
}  // namespace tbm::test

int main(int argc, char** argv) {
  return tbm::test::Main(argc > 1 ? std::max(2, std::atoi(argv[1]) / 160) : 60);
}
