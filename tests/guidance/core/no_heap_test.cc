// A step of the guidance takes no heap: a program of its own, because it replaces what the
// sanitizers replace as well.
#include <gtest/gtest.h>

#include "tests/support/drive.h"
#include "tests/support/no_alloc.h"

namespace tbm::test {
namespace {

TEST(GuidanceCore, AStepTakesNoHeap) {
  const GuidedMachine machine = ExampleMachine();
  GuidanceCore core(machine.machine, machine.rig, machine.axis);
  Drive drive(machine, {}, "no heap");
  drive.Measure(2060.0);
  core.Advance(drive.inputs(), drive.now());
  for (int i = 1; i < 20; ++i) {
    drive.Measure(2060.0 + 5.0 * i);
    const HeapCounter heap;
    const Snapshot& snapshot = core.Advance(drive.inputs(), drive.now());
    EXPECT_EQ(heap.Count(), 0);
    EXPECT_EQ(snapshot.front.worth, Worth::kValid);
  }
}

}  // namespace
}  // namespace tbm::test
