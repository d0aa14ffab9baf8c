// Writers and readers in processes of their own: killed, frozen, and built from other IDL files.
#include <filesystem>
#include <set>

#include <gtest/gtest.h>

#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "tests/idl/dds_support.h"
#include "tests/idl/samples.h"
#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace tbm::dds::test {
namespace {

using ::tbm::test::Process;

const std::string kPeer = TBM_PEER;
const std::string kOtherVersionPeer = TBM_OTHER_VERSION_PEER;

// What Fast DDS would leave behind of shared memory.
std::set<std::string> SharedMemoryFiles() {
  std::set<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator("/dev/shm")) {
    const std::string name = entry.path().filename();
    if (name.find("fast") != std::string::npos) files.insert(name);
  }
  return files;
}

TEST(KilledWriter, LeavesNothingInSharedMemoryAndIsHeardAgainAfterEachRestart) {
  const auto before = SharedMemoryFiles();
  AlarmLog alarms;
  Participant reading(OnLoopback(120, "reading"), alarms.Handler());
  Subscriber<RelativePose> subscriber(reading);
  std::set<std::array<std::uint8_t, 16>> writers;
  for (int restart = 0; restart < 20; ++restart) {
    Process writer({kPeer, "write", "120", "default", "10"});
    RelativePose pose;
    SampleFacts facts;
    const bool is_new = Eventually(
        [&] { return subscriber.Take(pose, facts, 100ms) && writers.insert(facts.writer).second; });
    ASSERT_TRUE(is_new) << "restart " << restart << "\n" << writer.Output() << alarms.All();
    writer.Signal(SIGKILL);
    EXPECT_EQ(writer.Wait(), 128 + SIGKILL);
  }
  EXPECT_EQ(writers.size(), 20u);
  EXPECT_EQ(alarms.Count(AlarmKind::kSecondWriter), 0) << alarms.All();  // a restart is no rival
  EXPECT_EQ(subscriber.counters().rejected, 0u);
  EXPECT_EQ(SharedMemoryFiles(), before);
}

TEST(KilledReader, DoesNotDisturbTheWriterAndGetsTheStandingStateAgain) {
  const auto before = SharedMemoryFiles();
  Participant writing(OnLoopback(121, "writing"));
  Publisher<DeviceHealth> health(writing);
  DeviceHealth state = FullDeviceHealth();
  for (int restart = 1; restart <= 10; ++restart) {
    state.samples_good = static_cast<std::uint64_t>(restart);
    ASSERT_EQ(health.Write(state), WriteOutcome::kWritten);
    Process reader({kPeer, "read", "121", "default"});
    ASSERT_TRUE(Eventually([&] { return reader.HasLine("health " + std::to_string(restart)); }))
        << reader.Output();
    reader.Signal(SIGKILL);
    reader.Wait();
  }
  EXPECT_EQ(SharedMemoryFiles(), before);
}

// With a writer that waited, 2000 samples would take its blocking time of 100 ms each.
TEST(FrozenReader, BlocksNeitherTheWriterNorAnotherReader) {
  Participant writing(OnLoopback(122, "writing"));
  Publisher<RelativePose> publisher(writing);
  Process frozen({kPeer, "read", "122", "default"});
  Process awake({kPeer, "read", "122", "default"});
  ASSERT_TRUE(Eventually([&] { return publisher.matched_readers() == 2; }, 10s));
  RelativePose pose = FullRelativePose();
  const auto write_until = [&](std::uint64_t last) {
    for (; pose.sample_number <= last; ++pose.sample_number) {
      ASSERT_EQ(publisher.Write(pose), WriteOutcome::kWritten);
      std::this_thread::sleep_for(1ms);
    }
  };
  pose.sample_number = 1;
  write_until(100);
  ASSERT_TRUE(Eventually([&] { return frozen.HasLine("pose 100"); }));
  frozen.Signal(SIGSTOP);
  const auto began = std::chrono::steady_clock::now();
  write_until(2100);
  EXPECT_LT(std::chrono::steady_clock::now() - began, 60s);
  EXPECT_TRUE(Eventually([&] { return awake.HasLine("pose 2100"); }));
  std::uint64_t expected = 0;
  for (const std::string& line : awake.Lines()) {
    if (line.rfind("pose ", 0) != 0) continue;
    const std::uint64_t number = std::stoull(line.substr(5));
    EXPECT_TRUE(expected == 0 || number == expected) << number << " after " << expected - 1;
    expected = number + 1;
  }
  frozen.Signal(SIGCONT);
  pose.sample_number = 3000;
  publisher.Write(pose);
  EXPECT_TRUE(Eventually([&] { return frozen.HasLine("pose 3000"); }, 30s));
}

// The writer's type has one field more in the middle: without care its bytes read as other numbers.
TEST(OtherVersion, IsReportedAtDiscoveryAndNothingOfItIsDelivered) {
  AlarmLog alarms;
  Participant reading(OnLoopback(123, "reading"), alarms.Handler());
  Subscriber<RelativePose> subscriber(reading);
  Process writer({kOtherVersionPeer, "123", "with-id"});
  ASSERT_TRUE(Eventually([&] { return alarms.Count(AlarmKind::kInterfaceMismatch) == 1; }, 10s))
      << writer.Output();
  EXPECT_NE(alarms.Text(AlarmKind::kInterfaceMismatch).find("other_version"), std::string::npos)
      << alarms.All();
  ASSERT_TRUE(Eventually([&] { return subscriber.counters().from_other_interface >= 5; }))
      << writer.Output();
  EXPECT_EQ(subscriber.counters().delivered, 0u);
  writer.Signal(SIGTERM);
  writer.Wait();
  EXPECT_TRUE(
      Eventually([&] { return alarms.Count(AlarmKind::kInterfaceMismatch, false) == 1; }, 15s));
}

TEST(OtherVersion, WithoutAnIdIsStoppedAtTheBoundary) {
  AlarmLog alarms;
  Participant reading(OnLoopback(124, "reading"), alarms.Handler());
  Subscriber<RelativePose> subscriber(reading);
  Process writer({kOtherVersionPeer, "124", "without-id"});
  ASSERT_TRUE(Eventually([&] { return subscriber.counters().rejected >= 5; }, 10s))
      << writer.Output();
  EXPECT_EQ(subscriber.counters().delivered, 0u);
  EXPECT_EQ(alarms.Count(AlarmKind::kInterfaceMismatch), 0);
  EXPECT_GE(alarms.Count(AlarmKind::kRejected), 1);
}

// A settings file in the working directory must not change how a process talks: this one would put
// it into shared memory alone.
TEST(WorkingDirectory, WithASettingsFileChangesNothing) {
  const ::tbm::test::TempFolder folder;
  const std::string file = folder / "DEFAULT_FASTRTPS_PROFILES.xml";
  ::tbm::test::WriteText(
      file,
      "<?xml version=\"1.0\"?><dds><profiles xmlns=\"http://www.eprosima.com/XMLSchemas/"
      "fastRTPS_Profiles\"><participant profile_name=\"p\" is_default_profile=\"true\"><rtps>"
      "<name>from_file</name></rtps></participant><data_writer profile_name=\"w\" "
      "is_default_profile=\"true\"><qos><reliability><kind>BEST_EFFORT</kind></reliability></qos>"
      "</data_writer></profiles><library_settings><intraprocess_delivery>FULL"
      "</intraprocess_delivery></library_settings></dds>");
  AlarmLog alarms;
  Participant reading(OnLoopback(125, "reading"), alarms.Handler());
  Subscriber<RelativePose> subscriber(reading);
  Process writer({"env",
                  "-C",
                  folder.path(),
                  "FASTRTPS_DEFAULT_PROFILES_FILE=" + file,
                  "ROS_DISCOVERY_SERVER=127.0.0.1:1",
                  kPeer,
                  "write",
                  "125",
                  "default",
                  "10"});
  RelativePose pose;
  SampleFacts facts;
  EXPECT_TRUE(subscriber.Take(pose, facts, 10s)) << writer.Output() << alarms.All();
  EXPECT_EQ(alarms.Count(AlarmKind::kIncompatibleQos), 0);
  writer.Signal(SIGKILL);
  writer.Wait();
}

}  // namespace
}  // namespace tbm::dds::test
