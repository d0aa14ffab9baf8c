// What one 1280 x 1024 frame costs the camera box, step by step. Runs on the emulated Cortex-A8
// under the counter of tests/arm/count_instructions.c: each step is a region that prctl marks.
// Prints one line per step that names its region and says what it worked on; frame_cost_test.py
// reads it.
#include <array>
#include <cstdio>
#include <optional>
#include <vector>

#include <sys/prctl.h>

#include "pose/frame/frame_solver.h"
#include "tests/arm/cost_scene.h"

namespace tbm::test {
namespace {

enum Region : unsigned long {
  kFindDark = 1,
  kFindGlare = 2,
  kAssign = 3,
  kSolve = 4,
  kBound = 5,
  kAfterFind = 6,
  kWhole = 7,
  kFindWide = 8,
  kAssignCold = 9,
  kReadOnce = 10,
};

constexpr unsigned long kMark = 0x54424D;

class Counted {
 public:
  explicit Counted(Region region) : region_(region) { prctl(kMark, region_, 1ul, 0ul, 0ul); }
  ~Counted() { prctl(kMark, region_, 0ul, 0ul, 0ul); }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;

 private:
  Region region_;
};

void CountFind(const std::vector<CostFrame>& frames, Region region, const char* what) {
  CentreFinder finder({});
  (void)finder.Find(frames[0].image.view);  // takes its memory
  std::size_t centres = 0;
  int rejected = 0;
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
  }
  const double count = static_cast<double>(frames.size());
  std::printf("region %d %s: %.1f centres, %.1f rejected\n",
              static_cast<int>(region),
              what,
              static_cast<double>(centres) / count,
              rejected / count);
}

// What FrameSolver does after Find, each step in a region of its own. As in a run: with the pose of
// 0.2 s ago, and without it as `cold`.
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
    solved += (*checked)->pose.dof == 6;
    const Counted counted(kBound);
    for (const PointResult& point : CheckPoints(problem, **checked, prior)) {
      bounded += point.bound_m.has_value();
    }
  }
  std::printf("region %d assign, solve, bound: %d of %zu frames solved, %d bounds\n",
              static_cast<int>(kAfterFind),
              solved,
              frames.size(),
              bounded);
}

void CountWhole(const Rig& rig, const std::vector<CostFrame>& frames) {
  FrameSolver solver(rig);
  int solved = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const CostFrame& frame = frames[i];
    const Timestamp sensed_at = frame.sensed_at;
    for (const Duration offset : {Duration(-std::chrono::milliseconds(50)), Duration::zero()}) {
      solver.AddTilt({sensed_at + offset, TiltSensor::kTarget, frame.target_tilt.inclination});
      solver.AddTilt({sensed_at + offset, TiltSensor::kCamera, frame.camera_tilt.inclination});
    }
    if (i == 0) {
      (void)solver.Solve({sensed_at, frame.image.view});  // takes its memory
      continue;
    }
    const FrameResult* result = nullptr;
    {
      const Counted counted(kWhole);
      result = &solver.Solve({sensed_at, frame.image.view});
    }
    solved += result->status == PoseStatus::kOk;
  }
  std::printf(
      "region %d whole frame: %d of %zu ok\n", static_cast<int>(kWhole), solved, frames.size() - 1);
}

int Main() {
  const Rig rig = CostRig();
  const std::vector<CostFrame> dark = DarkFrames(rig, 4);
  CountFind(dark, kFindDark, "find, dark");
  CountSteps(rig, dark);
  CountWhole(rig, dark);
  const std::vector<CostFrame> glare = GlareFrames(rig, 2);
  CountFind(glare, kFindGlare, "find, glare");
  return 0;
}

}  // namespace
}  // namespace tbm::test

int main() { return tbm::test::Main(); }
