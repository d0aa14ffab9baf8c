#include <cstdlib>

#include <gtest/gtest.h>

#include "tests/devices/camera/gige_bench.h"
#include "tests/support/sanitized.h"

namespace {

thread_local bool is_counting = false;
thread_local int allocations = 0;

void Count() {
  if (is_counting) ++allocations;
}

}  // namespace

#if defined(TBM_SANITIZED)
#define TBM_OWN_MALLOC 0
#else
#define TBM_OWN_MALLOC 1

// Stands before the C library's, so that GLib's allocations count as well as ours.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* malloc(std::size_t size) {
  Count();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  Count();
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) {
  Count();
  return __libc_realloc(block, size);
}
}
#endif

namespace tbm::test {
namespace {

int AllocationsInFrames(Camera& camera, int frames) {
  for (int i = 0; i < 20; ++i) NextFrame(camera);
  allocations = 0;
  for (int i = 0; i < frames; ++i) {
    is_counting = true;
    const auto frame = camera.WaitFrame(std::chrono::seconds(2));
    is_counting = false;
    EXPECT_TRUE(frame);
  }
  return allocations;
}

TEST(NoHeap, TheCounterCounts) {
  if (!TBM_OWN_MALLOC) GTEST_SKIP() << "the sanitizer has the allocator";
  allocations = 0;
  is_counting = true;
  volatile auto* const block = static_cast<char*>(std::malloc(10));
  is_counting = false;
  std::free(const_cast<char*>(block));
  EXPECT_EQ(allocations, 1);
}

TEST(NoHeap, TheGrabberThreadAllocatesNothingPerFrame) {
  if (!TBM_OWN_MALLOC) GTEST_SKIP() << "the sanitizer has the allocator";
  const SystemClock clock;
  const auto simulator = StartSimulator();
  const auto gige = MakeCamera(GigeConfig(50.0), clock);
  EXPECT_EQ(AllocationsInFrames(*gige, 50), 0);
  CameraConfig config;
  config.frame_rate_hz = 50.0;
  const auto sim = MakeCamera(config, clock, SmallWorld());
  EXPECT_EQ(AllocationsInFrames(*sim, 50), 0);
}

}  // namespace
}  // namespace tbm::test
