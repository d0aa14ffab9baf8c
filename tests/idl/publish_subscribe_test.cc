// Two participants of one process on loopback. Every sample goes over UDP: participant.h.
#include <gtest/gtest.h>

#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "tests/idl/dds_support.h"
#include "tests/idl/samples.h"

namespace tbm::dds::test {
namespace {

constexpr int kDomain = 101;

template <class Message>
void ExpectToArriveWhole(const Message& sent) {
  Participant writing(OnLoopback(kDomain, "writing"));
  Participant reading(OnLoopback(kDomain, "reading"));
  Subscriber<Message> subscriber(reading);
  Publisher<Message> publisher(writing);
  ASSERT_TRUE(Eventually([&] { return publisher.matched_readers() == 1; }));
  ASSERT_TRUE(Eventually([&] { return subscriber.matched_writers() == 1; }));
  ASSERT_EQ(publisher.Write(sent), WriteOutcome::kWritten)
      << FaultText(publisher.counters().refused_because);
  Message received;
  SampleFacts facts;
  ASSERT_TRUE(subscriber.Take(received, facts, 5s));
  EXPECT_TRUE(Same(sent, received));
  EXPECT_FALSE(facts.contested);
  EXPECT_EQ(subscriber.counters().delivered, 1u);
  EXPECT_EQ(subscriber.counters().rejected, 0u);
}

TEST(OverTheWire, EveryFieldOfFrameFeaturesArrives) { ExpectToArriveWhole(FullFrameFeatures()); }
TEST(OverTheWire, EveryFieldOfInclinationArrives) { ExpectToArriveWhole(FullTiltReading()); }
TEST(OverTheWire, EveryFieldOfRelativePoseArrives) { ExpectToArriveWhole(FullRelativePose()); }
TEST(OverTheWire, EveryFieldOfDeviceHealthArrives) { ExpectToArriveWhole(FullDeviceHealth()); }
TEST(OverTheWire, EveryFieldOfEventArrives) { ExpectToArriveWhole(FullEvent()); }

}  // namespace
}  // namespace tbm::dds::test
