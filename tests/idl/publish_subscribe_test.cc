// Two participants of one process on loopback. Every sample goes over UDP: participant.h.
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "tests/idl/dds_support.h"
#include "tests/idl/guidance_samples.h"
#include "tests/idl/rail_samples.h"
#include "tests/idl/raw_endpoints.h"
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
TEST(OverTheWire, EveryFieldOfTheTopicsOfGuidanceArrives) {
  ExpectToArriveWhole(FullStationObservation());
  ExpectToArriveWhole(FullStationSetUp());
  ExpectToArriveWhole(FullShieldPose());
  ExpectToArriveWhole(FullGuidance());
  ExpectToArriveWhole(FullAlarmStatus());
  ExpectToArriveWhole(FullCommand());
  ExpectToArriveWhole(FullCommandReply());
}
TEST(OverTheWire, EveryFieldOfTheTopicsOfTheRailLineArrives) {
  ExpectToArriveWhole(FullTrolleyState());
  ExpectToArriveWhole(FullRailLinePiece());
  ExpectToArriveWhole(FullSettlementPiece());
  ExpectToArriveWhole(FullCalibrationStatus());
}

TEST(OverTheWire, APoseThatIsMissingArrivesAsNaNWithItsReason) {
  RelativePose none = FullRelativePose();
  none.status = PoseStatus::kNone;
  none.reason = PoseReason::kAmbiguous;
  Participant writing(OnLoopback(102, "writing"));
  Participant reading(OnLoopback(102, "reading"));
  Subscriber<RelativePose> subscriber(reading);
  Publisher<RelativePose> publisher(writing);
  ASSERT_TRUE(Eventually([&] { return publisher.matched_readers() == 1; }));
  ASSERT_EQ(publisher.Write(none), WriteOutcome::kWritten);
  RelativePose received;
  SampleFacts facts;
  ASSERT_TRUE(subscriber.Take(received, facts, 5s));
  EXPECT_EQ(received.reason, PoseReason::kAmbiguous);
  EXPECT_TRUE(received.camera_from_target.translation.array().isNaN().all());
  EXPECT_TRUE(received.covariance.array().isNaN().all());
}

TEST(LateJoiner, GetsTheStandingHealthOfEachDeviceAndTheLastEvents) {
  Participant writing(OnLoopback(103, "writing"));
  Publisher<DeviceHealth> health(writing);
  Publisher<Event> events(writing);
  DeviceHealth state = FullDeviceHealth();
  for (int i = 1; i <= 3; ++i) {
    for (const char* device : {"camera", "inclinometer_target"}) {
      state.device_id = device;
      state.samples_good = static_cast<std::uint64_t>(i);
      ASSERT_EQ(health.Write(state), WriteOutcome::kWritten);
    }
  }
  Event event = FullEvent();
  for (int i = 1; i <= 10; ++i) {
    event.sample_number = static_cast<std::uint64_t>(i);
    ASSERT_EQ(events.Write(event), WriteOutcome::kWritten);
  }

  Participant late(OnLoopback(103, "late"));
  Subscriber<DeviceHealth> late_health(late);
  Subscriber<Event> late_events(late);
  SampleFacts facts;
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(late_health.Take(state, facts, 5s));
    EXPECT_EQ(state.samples_good, 3u);  // only the present state of each
  }
  for (std::uint64_t number = 3; number <= 10; ++number) {  // the last eight
    ASSERT_TRUE(late_events.Take(event, facts, 5s));
    EXPECT_EQ(event.sample_number, number);
  }
  EXPECT_FALSE(late_health.Take(state, facts, 100ms));
}

TEST(LateJoiner, NeverGetsAnOldPose) {
  Participant writing(OnLoopback(104, "writing"));
  Publisher<RelativePose> publisher(writing);
  RelativePose pose = FullRelativePose();
  publisher.Write(pose);
  Participant late(OnLoopback(104, "late"));
  Subscriber<RelativePose> subscriber(late);
  ASSERT_TRUE(Eventually([&] { return publisher.matched_readers() == 1; }));
  ASSERT_TRUE(Eventually([&] { return subscriber.matched_writers() == 1; }));
  pose.sample_number = 77;
  publisher.Write(pose);
  SampleFacts facts;
  ASSERT_TRUE(subscriber.Take(pose, facts, 5s));
  EXPECT_EQ(pose.sample_number, 77u);
}

// What a reader sees of two writers for one machine: the samples of both, each marked as soon as it
// is sure that both are alive, and one alarm.
TEST(SecondPublisher, IsSeenMarkedAndReported) {
  AlarmLog alarms;
  Participant one(OnLoopback(105, "one"));
  Participant two(OnLoopback(105, "two"));
  Participant reading(OnLoopback(105, "reading"), alarms.Handler());
  Subscriber<RelativePose> subscriber(reading);
  Publisher<RelativePose> first(one);
  Publisher<RelativePose> second(two);
  ASSERT_TRUE(Eventually([&] { return subscriber.matched_writers() == 2; }));
  ASSERT_TRUE(
      Eventually([&] { return first.matched_readers() == 1 && second.matched_readers() == 1; }));
  RelativePose pose = FullRelativePose();
  SampleFacts facts;
  std::vector<bool> contested;
  for (std::uint64_t i = 0; i < 6; ++i) {
    pose.sample_number = i;
    (i % 2 == 0 ? first : second).Write(pose);
    ASSERT_TRUE(subscriber.Take(pose, facts, 5s));
    EXPECT_EQ(pose.sample_number, i);
    contested.push_back(facts.contested);
  }
  EXPECT_EQ(contested, (std::vector<bool>{false, false, true, true, true, true}));
  EXPECT_EQ(alarms.Count(AlarmKind::kSecondWriter), 1) << alarms.All();
}

TEST(SecondPublisher, OfAnotherMachineIsNoRival) {
  AlarmLog alarms;
  Participant one(OnLoopback(106, "one"));
  Participant two(OnLoopback(106, "two"));
  Participant reading(OnLoopback(106, "reading"), alarms.Handler());
  Subscriber<RelativePose> subscriber(reading);
  Publisher<RelativePose> first(one);
  Publisher<RelativePose> second(two);
  ASSERT_TRUE(
      Eventually([&] { return first.matched_readers() == 1 && second.matched_readers() == 1; }));
  RelativePose pose = FullRelativePose();
  SampleFacts facts;
  for (int i = 0; i < 6; ++i) {
    pose.machine_id = i % 2 == 0 ? "machine-1" : "machine-2";
    (i % 2 == 0 ? first : second).Write(pose);
    ASSERT_TRUE(subscriber.Take(pose, facts, 5s));
    EXPECT_FALSE(facts.contested);
  }
  EXPECT_EQ(alarms.Count(AlarmKind::kSecondWriter), 0);
}

// Consoles and tools ask one and the same process, and that is no fault.
TEST(Contested, RequestsMayComeFromSeveralWriters) {
  AlarmLog alarms;
  Participant one(OnLoopback(kDomain, "one"));
  Participant two(OnLoopback(kDomain, "two"));
  Participant reading(OnLoopback(kDomain, "reading"), alarms.Handler());
  Subscriber<Command> subscriber(reading);
  Publisher<Command> from_one(one);
  Publisher<Command> from_two(two);
  ASSERT_TRUE(Eventually([&] { return subscriber.matched_writers() == 2; }));
  for (int i = 0; i < 3; ++i) {
    for (Publisher<Command>* publisher : {&from_one, &from_two}) {
      ASSERT_TRUE(Eventually([&] { return publisher->matched_readers() == 1; }));
      publisher->Write(FullCommand());
      Command received;
      SampleFacts facts;
      ASSERT_TRUE(subscriber.Take(received, facts, 5s));
      EXPECT_FALSE(facts.contested);
    }
  }
  EXPECT_EQ(alarms.Count(AlarmKind::kSecondWriter), 0) << alarms.All();
}

TEST(Silence, IsFoundByTheReaderAndEndsWithTheNextSample) {
  AlarmLog alarms;
  Participant writing(OnLoopback(107, "writing"));
  Participant reading(OnLoopback(107, "reading"), alarms.Handler());
  Subscriber<TiltReading> subscriber(reading);
  Publisher<TiltReading> publisher(writing);
  ASSERT_TRUE(Eventually([&] { return publisher.matched_readers() == 1; }));
  TiltReading tilt = FullTiltReading();
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 10; ++i) {  // "camera" falls silent, "target" goes on
    for (const char* sensor : {"camera", "target"}) {
      tilt.sensor = sensor;
      publisher.Write(tilt);
    }
    std::this_thread::sleep_for(10ms);
  }
  // On a machine that stood still for so long there was silence indeed.
  const bool kept_up = std::chrono::steady_clock::now() - begin < 300ms;
  EXPECT_TRUE(!kept_up || alarms.Count(AlarmKind::kSilent) == 0) << alarms.All();
  ASSERT_TRUE(Eventually([&] {
    publisher.Write(tilt);
    std::this_thread::sleep_for(20ms);
    return alarms.All().find("camera") != std::string::npos;
  })) << alarms.All();
  tilt.sensor = "camera";
  publisher.Write(tilt);
  EXPECT_TRUE(Eventually([&] { return alarms.Count(AlarmKind::kSilent, false) == 1; }))
      << alarms.All();
}

TEST(Silence, OfAWriterThatLeftInGoodOrderIsFoundToo) {
  AlarmLog alarms;
  Participant reading(OnLoopback(108, "reading"), alarms.Handler());
  Subscriber<RelativePose> subscriber(reading);
  {
    Participant writing(OnLoopback(108, "writing"));
    Publisher<RelativePose> publisher(writing);
    ASSERT_TRUE(Eventually([&] { return publisher.matched_readers() == 1; }));
    publisher.Write(FullRelativePose());
    ASSERT_TRUE(Eventually([&] { return subscriber.counters().delivered == 1; }));
  }
  EXPECT_TRUE(Eventually([&] { return alarms.Count(AlarmKind::kSilent) == 1; })) << alarms.All();
}

TEST(Silence, OfAWriterThatNeverSaysAnythingIsFound) {
  AlarmLog alarms;
  Participant writing(OnLoopback(109, "writing"));
  Participant reading(OnLoopback(109, "reading"), alarms.Handler());
  Subscriber<RelativePose> subscriber(reading);
  Publisher<RelativePose> publisher(writing);
  EXPECT_TRUE(Eventually([&] { return alarms.Count(AlarmKind::kSilent) == 1; })) << alarms.All();
}

TEST(Boundary, StopsWhatAStrangerSendsAndLetsTheRestThrough) {
  AlarmLog alarms;
  Participant reading(OnLoopback(110, "reading"), alarms.Handler());
  Subscriber<RelativePose> subscriber(reading);
  RawParticipant stranger(110);
  auto* writer = stranger.Writer<RelativePose>();
  ASSERT_TRUE(Eventually([&] { return subscriber.matched_writers() == 1; }));
  fdds::PublicationMatchedStatus matched;
  ASSERT_TRUE(Eventually([&] {
    writer->get_publication_matched_status(matched);
    return matched.current_count == 1;
  }));
  const auto send = [&](const std::function<void(v1::RelativePose&)>& spoil) {
    WireSample<v1::RelativePose> sample;
    ToWire(FullRelativePose(), sample.value);
    spoil(sample.value);
    writer->write(&sample);
  };
  send([](v1::RelativePose& p) { p.status(static_cast<v1::PoseStatus>(7)); });
  ASSERT_TRUE(Eventually([&] { return subscriber.counters().rejected == 1; }));
  EXPECT_EQ(subscriber.counters().rejected_because, BoundaryFault::kEnumRange);
  send([](v1::RelativePose& p) { p.camera_from_target_qw(kNaN); });
  ASSERT_TRUE(Eventually([&] { return subscriber.counters().rejected == 2; }));
  EXPECT_EQ(subscriber.counters().rejected_because, BoundaryFault::kNotFinite);
  send([](v1::RelativePose& p) { p.sample_number(5); });
  RelativePose pose;
  SampleFacts facts;
  ASSERT_TRUE(subscriber.Take(pose, facts, 5s));
  EXPECT_EQ(pose.sample_number, 5u);
  EXPECT_EQ(subscriber.counters().delivered, 1u);
  EXPECT_GE(alarms.Count(AlarmKind::kRejected), 1);
}

TEST(Boundary, TellsAWriterOfItsOwnMistake) {
  Participant writing(OnLoopback(111, "writing"));
  Publisher<RelativePose> publisher(writing);
  RelativePose pose = FullRelativePose();
  pose.covariance(2, 2) = kNaN;
  EXPECT_EQ(publisher.Write(pose), WriteOutcome::kRefused);
  EXPECT_EQ(publisher.counters().refused_because, BoundaryFault::kNotFinite);
  EXPECT_EQ(publisher.counters().refused, 1u);
}

TEST(IncompatibleQos, IsAnAlarmOnBothSides) {
  AlarmLog reader_alarms;
  AlarmLog writer_alarms;
  Participant reading(OnLoopback(112, "reading"), reader_alarms.Handler());
  Participant writing(OnLoopback(112, "writing"), writer_alarms.Handler());
  Subscriber<RelativePose> subscriber(reading);
  Publisher<DeviceHealth> publisher(writing);
  RawParticipant stranger(112);
  ASSERT_NE(stranger.Writer<RelativePose>([](fdds::DataWriterQos& qos) {
    qos.reliability().kind = fdds::BEST_EFFORT_RELIABILITY_QOS;
  }),
            nullptr);
  ASSERT_NE(stranger.Reader<DeviceHealth>([](fdds::DataReaderQos& qos) {
    qos.deadline().period = {0, 100'000'000};
  }),
            nullptr);
  EXPECT_TRUE(Eventually([&] { return reader_alarms.Count(AlarmKind::kIncompatibleQos) == 1; }));
  EXPECT_TRUE(Eventually([&] { return writer_alarms.Count(AlarmKind::kIncompatibleQos) == 1; }));
  EXPECT_NE(reader_alarms.Text(AlarmKind::kIncompatibleQos).find("RELIABILITY"), std::string::npos);
  EXPECT_NE(writer_alarms.Text(AlarmKind::kIncompatibleQos).find("DEADLINE"), std::string::npos);
}

TEST(Queue, DropsTheOldestAndCounts) {
  Participant writing(OnLoopback(113, "writing"));
  Participant reading(OnLoopback(113, "reading"));
  SubscriberOptions options;
  options.queue_capacity = 3;
  Subscriber<RelativePose> subscriber(reading, options);
  Publisher<RelativePose> publisher(writing);
  ASSERT_TRUE(Eventually([&] { return publisher.matched_readers() == 1; }));
  RelativePose pose = FullRelativePose();
  for (std::uint64_t i = 1; i <= 8; ++i) {
    pose.sample_number = i;
    publisher.Write(pose);
    ASSERT_TRUE(Eventually([&] { return subscriber.counters().delivered == i; }));
  }
  SampleFacts facts;
  for (std::uint64_t i = 6; i <= 8; ++i) {
    ASSERT_TRUE(subscriber.Take(pose, facts, 1s));
    EXPECT_EQ(pose.sample_number, i);
  }
  EXPECT_EQ(subscriber.counters().dropped, 5u);
}

// Six of them: without a raised range the fifth and sixth would find the first four, but never each
// other.
TEST(Unicast, FindsMoreThanFourParticipantsOnOnePeer) {
  ParticipantConfig config = OnLoopback(114, "unicast");
  config.peers = {"127.0.0.1"};
  std::vector<std::unique_ptr<Participant>> participants;
  std::vector<std::unique_ptr<Subscriber<RelativePose>>> subscribers;
  for (int i = 0; i < 6; ++i) participants.push_back(std::make_unique<Participant>(config));
  for (auto& participant : participants) {
    subscribers.push_back(std::make_unique<Subscriber<RelativePose>>(*participant));
  }
  const Publisher<RelativePose> publisher(*participants.back());
  EXPECT_TRUE(Eventually([&] { return publisher.matched_readers() == 6; }, 10s))
      << publisher.matched_readers();
}

TEST(Config, NamesEveryWrongKeyAtOnce) {
  ParticipantConfig config;
  EXPECT_TRUE(Problems(config).empty());
  EXPECT_EQ(config.interfaces, std::vector<std::string>{"127.0.0.1"});
  config.domain_id = 233;
  config.name = "";
  config.interfaces = {};
  config.peers = {"192.168.1.300"};
  config.socket_buffer_bytes = 1;
  EXPECT_EQ(Problems(config).size(), 5u);
}

}  // namespace
}  // namespace tbm::dds::test
