// The other process of the DDS tests.
//
//   idl_test_peer write DOMAIN INTERFACE PERIOD_MS   relative poses and health, numbered from 1,
//   for ever idl_test_peer read DOMAIN INTERFACE              prints "pose N" or "health N" for
//   each sample
//
// INTERFACE is "default" for what the config says when nobody sets it. A variable
// TBM_PEER_UNICAST=ADDRESS makes it look for others at that address alone. Both print "starts N"
// when DDS has begun the Nth time and one line per alarm.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "tests/idl/dds_support.h"
#include "tests/idl/samples.h"

namespace tbm::dds::test {
namespace {

void Say(const char* word, unsigned long long number) {
  std::printf("%s %llu\n", word, number);
  std::fflush(stdout);
}

void Write(Participant& participant, std::chrono::milliseconds period) {
  Publisher<RelativePose> poses(participant);
  Publisher<DeviceHealth> health(participant);
  RelativePose pose = FullRelativePose();
  DeviceHealth state = FullDeviceHealth();
  int starts = 0;
  for (std::uint64_t number = 1;; ++number) {
    if (participant.starts() != starts)
      Say("starts", static_cast<unsigned>(starts = participant.starts()));
    pose.sample_number = number;
    state.samples_good = number;
    poses.Write(pose);
    health.Write(state);
    std::this_thread::sleep_for(period);
  }
}

void Read(Participant& participant) {
  const Subscriber<RelativePose> poses(
      participant,
      [](const RelativePose& pose, const SampleFacts&) { Say("pose", pose.sample_number); });
  const Subscriber<DeviceHealth> health(
      participant,
      [](const DeviceHealth& state, const SampleFacts&) { Say("health", state.samples_good); });
  int starts = 0;
  while (true) {
    if (participant.starts() != starts)
      Say("starts", static_cast<unsigned>(starts = participant.starts()));
    std::this_thread::sleep_for(10ms);
  }
}

}  // namespace
}  // namespace tbm::dds::test

int main(int argc, char** argv) {
  using namespace tbm::dds;
  const std::string verb = argc > 1 ? argv[1] : "";
  if (argc < (verb == "write" ? 5 : 4)) return 2;
  ParticipantConfig config = test::OnLoopback(std::atoi(argv[2]), "idl_test_peer");
  if (std::string(argv[3]) != "default") config.interfaces = {argv[3]};
  if (const char* peer = std::getenv("TBM_PEER_UNICAST")) config.peers = {peer};
  Participant participant(config, [](const Alarm& alarm) {
    std::printf("alarm %s %s\n", std::string(AlarmCode(alarm.kind)).c_str(), alarm.text.c_str());
    std::fflush(stdout);
  });
  if (verb == "write") test::Write(participant, std::chrono::milliseconds(std::atoi(argv[4])));
  if (verb == "read") test::Read(participant);
  return 2;
}
