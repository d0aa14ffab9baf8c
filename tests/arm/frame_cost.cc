// What one 1280 x 1024 frame costs the camera box, step by step. Runs on the emulated Cortex-A8
// under the counter of count_instructions.c. Prints for each step a line that says what it worked
// on; frame_cost_test.py reads it.
#include <cstdio>
#include <optional>
#include <vector>

#include "pose/frame/frame_solver.h"
#include "tests/arm/cost_scene.h"
#include "tests/arm/counted.h"

namespace tbm::test {
namespace {

// Known to frame_cost_test.py.
enum Region : unsigned long {
  kFindDark = 1,
  kFindGlare = 2,
  kAssign = 3,
  kSolve = 4,
  kBound = 5,
  kAfterFind = 6,
  kWhole = 7,
  kFindCrowd = 8,
  kAssignCold = 9,
};

void CountFind(const std::vector<CostFrame>& frames, Region region, const char* what) {
  CentreFinder finder({});
  (void)finder.Find(frames[0].image.view);  // takes its memory
  std::size_t centres = 0;
  int rejected = 0;
  int dropped = 0;
  for (const CostFrame& frame : frames) {
    const FoundCentres* found = nullptr;
    {
      const Counted counted(region);
      const auto result = finder.Find(frame.image.view);
      if (result) found = *result;
    }
    if (found == nullptr) continue;
    centres += found->centres.size();
    rejected += found->levels.rejected_spots;
    dropped += found->levels.dropped_spots;
  }
  const double count = static_cast<double>(frames.size());
  std::printf("region %lu %s: %.1f centres, %.1f rejected, %.1f dropped\n",
              static_cast<unsigned long>(region),
              what,
              static_cast<double>(centres) / count,
              rejected / count,
              dropped / count);
}

// What FrameSolver does after Find, each step in a region of its own: with the pose of 0.2 s
// before, as in a run, and once more without for the assignment.
void CountSteps(const Rig& rig, const std::vector<CostFrame>& frames) {
  CentreFinder finder({});
  int solved = 0;
  int bounded = 0;
  for (const CostFrame& frame : frames) {
    const auto found = finder.Find(frame.image.view);
    if (!found) continue;
    const Centres centres = (*found)->centres;
    {
      const Counted counted(kAssignCold);
      (void)AssignLeds(rig, centres, frame.target_tilt, frame.camera_tilt, std::nullopt);
    }
    PoseProblem problem;
    problem.rig = &rig;
    problem.target_tilt = frame.target_tilt;
    problem.camera_tilt = frame.camera_tilt;
    const Counted all(kAfterFind);
    std::optional<Result<Assignment, AssignFailure>> assigned;
    {
      const Counted counted(kAssign);
      assigned = AssignLeds(rig, centres, frame.target_tilt, frame.camera_tilt, frame.prior);
    }
    if (!*assigned) continue;
    const PosePriorInfo prior{frame.prior.camera_from_target, frame.prior.covariance};
    problem.leds = (*assigned)->leds;
    std::optional<Result<CheckedPose, PoseReason>> checked;
    {
      const Counted counted(kSolve);
      checked = CheckPose(problem, (*assigned)->camera_from_target, prior);
    }
    if (!*checked) continue;
    solved += (*checked)->status == PoseStatus::kOk;
    const Counted counted(kBound);
    for (const PointResult& point : CheckPoints(problem, **checked, prior)) {
      bounded += point.bound_m.has_value();
    }
  }
  std::printf("region %lu assign, solve, bound: %d of %zu solved, %d bounds\n",
              static_cast<unsigned long>(kAfterFind),
              solved,
              frames.size(),
              bounded);
}

void CountWhole(const Rig& rig, const std::vector<CostFrame>& frames) {
  FrameSolver solver(rig);
  std::size_t solved = 0;
  for (const CostFrame& frame : frames) {
    for (const auto before : {std::chrono::milliseconds(50), std::chrono::milliseconds(0)}) {
      const Timestamp at = frame.sensed_at - before;
      solver.AddTilt({at, TiltSensor::kTarget, frame.target_tilt.inclination});
      solver.AddTilt({at, TiltSensor::kCamera, frame.camera_tilt.inclination});
    }
    const FrameInput input{frame.sensed_at, frame.image.view};
    if (&frame == &frames.front()) {
      (void)solver.Solve(input);  // takes its memory
      continue;
    }
    const Counted counted(kWhole);
    solved += solver.Solve(input).status == PoseStatus::kOk;
  }
  std::printf("region %lu whole frame: %zu of %zu solved\n",
              static_cast<unsigned long>(kWhole),
              solved,
              frames.size() - 1);
}

int Main() {
  const Rig rig = CostRig();
  const std::vector<CostFrame> dark = DarkFrames(rig, 4);
  CountFind(dark, kFindDark, "find, dark");
  CountSteps(rig, dark);
  CountWhole(rig, dark);
  CountFind(GlareFrames(rig, 2), kFindGlare, "find, glare and 300 false spots");
  CountFind(CrowdFrames(rig, 1), kFindCrowd, "find, 300 spots like LEDs");
  return 0;
}

}  // namespace
}  // namespace tbm::test

int main() { return tbm::test::Main(); }
