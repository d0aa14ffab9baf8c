#include <gtest/gtest.h>

#include "pose/solve/solve_pose.h"
#include "pose/solve/start_pose.h"
#include "tests/pose/solve/as_built.h"
#include "tests/pose/solve/placements.h"
#include "tests/support/no_alloc.h"
#include "tests/support/sanitized.h"

// Eigen asks malloc, not operator new. Sanitizers bring a malloc of their own.
#if !defined(TBM_SANITIZED)
extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) {
  ++tbm::test::heap_requests;
  return __libc_malloc(size);
}
#endif

namespace tbm::test {
namespace {

TEST(NoHeap, TheCounterSeesEigen) {
#if defined(TBM_SANITIZED)
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  const HeapCounter counter;
  const Eigen::MatrixXd matrix = Eigen::MatrixXd::Random(7, 9);
  EXPECT_GT(counter.Count(), 0) << matrix(0, 0);
}

TEST(NoHeap, SolversAndStartsTouchNone) {
  for (const int leds : {2, 3, 5, 32}) {
    Rig rig = RigWithLeds(std::max(leds, 3), "no heap leds");
    DeclareFieldSigmas(rig);
    Random random("no heap", static_cast<std::uint64_t>(leds));
    for (int i = 0; i < 20; ++i) {
      const Truth truth = DrawTruth(random, {2.5, 6.0});
      PoseProblem problem = NoisyProblem(rig, truth, 0.2, DegToRad(0.01), random);
      problem.leds.resize(static_cast<std::size_t>(leds));
      PoseProblem without = problem;
      without.target_tilt.reset();
      const HeapCounter counter;
      const PoseResult cold = SolveFused(problem);
      const PoseResult warm = SolveFused(problem, truth.camera_from_target);
      const PoseResult vision = SolveVision(problem);
      const PoseResult alone = SolveVision(without);
      const auto start = StartPose(problem);
      EXPECT_EQ(counter.Count(), 0) << leds;
      if (leds >= 5) {
        EXPECT_TRUE(cold && warm && vision && alone && start);
      }
    }
  }
}

}  // namespace
}  // namespace tbm::test
