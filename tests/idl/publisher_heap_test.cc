// How much heap the write path takes: every allocation of the writing thread is counted, ours and
// those of Fast DDS.
#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include <gtest/gtest.h>

#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "idl/cpp/topics.h"
#include "tests/idl/dds_support.h"
#include "tests/idl/samples.h"

namespace {
thread_local bool is_counting = false;
thread_local long allocations = 0;
thread_local std::size_t largest = 0;

void Count(std::size_t size) {
  if (!is_counting) return;
  ++allocations;
  largest = std::max(largest, size);
}
}  // namespace

extern "C" {
void* __libc_malloc(std::size_t size);                     // NOLINT: glibc's own name
void* __libc_calloc(std::size_t count, std::size_t size);  // NOLINT
void* __libc_realloc(void* block, std::size_t size);       // NOLINT

void* malloc(std::size_t size) noexcept {
  Count(size);
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  Count(count * size);
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) noexcept {
  Count(size);
  return __libc_realloc(block, size);
}
}

namespace tbm::dds::test {
namespace {

struct Use {
  double per_write = 0.0;
  std::size_t largest_bytes = 0;
};

template <class Message>
Use HeapUse(Publisher<Message>& publisher, const Message& message, WriteOutcome expected) {
  const auto write = [&](int count) {
    for (int i = 0; i < count; ++i) {
      EXPECT_EQ(publisher.Write(message), expected);
      std::this_thread::sleep_for(1ms);
    }
  };
  write(100);  // warm-up
  constexpr int kWrites = 200;
  allocations = 0;
  largest = 0;
  is_counting = true;
  write(kWrites);
  is_counting = false;
  return {static_cast<double>(allocations) / kWrites, largest};
}

TEST(PublisherHeap, CountsAllocations) {
  is_counting = true;
  allocations = 0;
  std::free(std::malloc(allocations == 0 ? 16 : 32));
  delete new std::string(100, 'x');
  is_counting = false;
  EXPECT_GE(allocations, 2);
}

template <class Message>
void ExpectNoHeapOfOurOwn(const Message& message) {
  ParticipantConfig config = OnLoopback(150, "waiting");
  config.interfaces = {"no_such_interface"};  // all of the path but the call of Fast DDS
  Participant waiting(config);
  Publisher<Message> publisher(waiting);
  EXPECT_EQ(HeapUse(publisher, message, WriteOutcome::kNoNetwork).per_write, 0.0);
}

TEST(PublisherHeap, OurOwnPartTakesNoneAfterWarmUp) {
  ExpectNoHeapOfOurOwn(FullFrameFeatures());
  ExpectNoHeapOfOurOwn(FullTiltReading());
  ExpectNoHeapOfOurOwn(FullRelativePose());
  ExpectNoHeapOfOurOwn(FullDeviceHealth());
  ExpectNoHeapOfOurOwn(FullEvent());
}

// What is left are closures that the reliable writer of Fast DDS 2.9.1 makes and drops within the
// call: five of them for a writer alone, ten with readers, whatever the size of the sample. Nothing
// for samples, histories or messages.
template <class Message>
void ExpectOnlyClosures(const Message& message, int domain_id) {
  Participant writing(OnLoopback(domain_id, "writing"));
  Participant reading(OnLoopback(domain_id, "reading"));
  Publisher<Message> publisher(writing);
  const Subscriber<Message> subscriber(reading, [](const Message&, const SampleFacts&) {});
  ASSERT_TRUE(Eventually([&] { return publisher.matched_readers() == 1; }));
  const Use use = HeapUse(publisher, message, WriteOutcome::kWritten);
  std::printf("%s: %.2f allocations per write, the largest of %zu bytes\n",
              std::string(TopicOf<Message>().name).c_str(),
              use.per_write,
              use.largest_bytes);
  EXPECT_LE(use.per_write, 10.0);
  EXPECT_LE(use.largest_bytes, 128u);
}

TEST(PublisherHeap, FastDdsTakesOnlySmallClosuresAfterWarmUp) {
  ExpectOnlyClosures(FullFrameFeatures(), 151);
  ExpectOnlyClosures(FullRelativePose(), 152);
  ExpectOnlyClosures(FullDeviceHealth(), 153);
}

}  // namespace
}  // namespace tbm::dds::test
