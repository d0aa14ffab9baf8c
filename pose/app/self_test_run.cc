#include "pose/app/self_test_run.h"

#include <chrono>
#include <mutex>
#include <thread>

#include <fmt/format.h>

#include "idl/cpp/dds_process.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "pose/app/box_parts.h"
#include "pose/app/camera_box.h"
#include "pose/app/host_facts.h"
#include "pose/app/self_test.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;

constexpr auto kCameraPatience = 15s;
constexpr auto kExposureSettles = 1500ms;
constexpr auto kDdsPatience = 5s;

template <class Condition>
bool WaitFor(const Clock& clock, std::chrono::milliseconds patience, const Condition& condition) {
  const auto until = clock.Steady() + patience;
  while (!condition()) {
    if (clock.Steady() > until) return false;
    std::this_thread::sleep_for(50ms);
  }
  return true;
}

// One event out on the box's own topic and back in, and what DDS complains of meanwhile.
std::vector<Finding> TryDds(const BoxConfig& config, const Clock& clock) {
  std::vector<Finding> findings;
  std::mutex mutex;  // guards the two below
  std::vector<std::string> complaints;
  bool has_come = false;
  {
    dds::Participant participant(dds::ParticipantOf(config.dds, "camera_box " + config.machine_id),
                                 [&](const dds::Alarm& alarm) {
                                   const std::lock_guard lock(mutex);
                                   if (alarm.active) complaints.push_back(alarm.text);
                                 });
    const dds::Subscriber<dds::Event> subscriber(
        participant, [&](const dds::Event& event, const dds::SampleFacts&) {
          const std::lock_guard lock(mutex);
          has_come = has_come || event.source == "self_test";
        });
    dds::Publisher<dds::Event> publisher(participant);
    dds::Event event;
    event.machine_id = std::string_view(config.machine_id);
    event.source = "self_test";
    event.code = "self_test";
    event.text = "an installer tries the box";
    const bool is_back = WaitFor(clock, kDdsPatience, [&] {
      event.at = clock.Now();
      ++event.sample_number;
      publisher.Write(event);
      const std::lock_guard lock(mutex);
      return has_come;
    });
    if (!is_back) {
      findings.push_back({Verdict::kBad,
                          "DDS",
                          "a message of our own does not come back",
                          "a firewall, or dds.interfaces names no address that is up"});
    } else {
      findings.push_back({Verdict::kGood, "DDS", "a message of our own comes back", ""});
    }
  }
  for (const std::string& complaint : complaints) {
    findings.push_back(
        {Verdict::kDoubtful,
         "DDS",
         complaint,
         "another program on this network disturbs: /usr/share/doc/tbm-camera-box/README.md, 4.4"});
  }
  return findings;
}

std::vector<Finding> TryDevices(
    const BoxConfig& config, const Rig& rig, double seconds, const Clock& clock, Sleeper& sleeper) {
  if (config.camera.driver == CameraDriver::kReplay) {
    return {{Verdict::kBad,
             "camera",
             "camera.driver is replay: there is no camera to try",
             "set camera.driver to gige"}};
  }
  BoxConfig trial = config;
  trial.recording.folder.clear();
  SelfTestCollector collector;
  CameraBox box(trial, rig, "", MakeParts(trial, rig, "", clock, sleeper), clock, collector);
  std::jthread runner([&box](const std::stop_token& stop) { box.Run(stop); });
  const bool streams = WaitFor(
      clock, kCameraPatience, [&] { return box.camera_health().state == CameraState::kStreaming; });
  if (streams) std::this_thread::sleep_for(kExposureSettles);

  MeasuredSpan span;
  const auto tilt = [&](TiltSensor sensor) { return box.inclinometer_health(sensor); };
  collector.Restart();
  const auto began = clock.Steady();
  span.camera_before = box.camera_health();
  span.tilt_before = {tilt(TiltSensor::kTarget), tilt(TiltSensor::kCamera)};
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  span.camera = box.camera_health();
  span.tilt = {tilt(TiltSensor::kTarget), tilt(TiltSensor::kCamera)};
  span.seconds = std::chrono::duration<double>(clock.Steady() - began).count();
  const SelfTestCollector::Seen seen = collector.seen();
  runner.request_stop();
  runner.join();

  std::vector<Finding> findings = JudgeCamera(span, seen, trial);
  for (const auto& more :
       {JudgeLeds(seen, trial, rig), JudgeTilts(span, seen, trial, rig), JudgePose(seen)}) {
    findings.insert(findings.end(), more.begin(), more.end());
  }
  return findings;
}

}  // namespace

bool RunSelfTest(
    const BoxConfig& config, const Rig& rig, double seconds, const Clock& clock, Sleeper& sleeper) {
  fmt::print("{}: trying the box, this takes {:.0f} to {:.0f} s\n",
             config.machine_id,
             seconds + 2.0,
             seconds + 22.0);
  std::fflush(stdout);
  std::vector<Finding> findings = JudgeHost(GatherHostFacts(config, clock.Now()), config, rig);
  for (const auto& more :
       {TryDds(config, clock), TryDevices(config, rig, seconds, clock, sleeper)}) {
    findings.insert(findings.end(), more.begin(), more.end());
  }
  fmt::print("{}", ReportText(findings));
  for (const Finding& finding : findings) {
    if (finding.verdict == Verdict::kBad) return false;
  }
  return true;
}

}  // namespace tbm
