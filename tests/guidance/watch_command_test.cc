#include "guidance/app/watch_command.h"

#include <atomic>
#include <chrono>
#include <sstream>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/cpp/publisher.h"
#include "pose/base/clock.h"

namespace tbm {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kDomain = 141;
constexpr int kEmptyDomain = 142;

dds::RelativePose PoseAt(Timestamp at) {
  dds::RelativePose pose;
  pose.machine_id = "tbm7";
  pose.sensed_at = at;
  pose.published_at = at;
  pose.sample_number = 1;
  pose.status = PoseStatus::kOk;
  pose.leds_used = 0b11111;
  pose.camera_from_target = {Eigen::Quaterniond::Identity(), {0.1, 0.2, 3.0}};
  pose.covariance = PoseCovariance::Identity() * 1e-8;
  pose.rms_px = 0.05;
  return pose;
}

// Publishes a pose every 50 ms while `write` says so.
class Talker {
 public:
  explicit Talker(Duration stamp_offset)
      : participant_(Config()), publisher_(participant_), thread_([this, stamp_offset] {
          const SystemClock clock;
          while (!is_over_) {
            if (is_talking_) last_ = publisher_.Write(PoseAt(clock.Now() + stamp_offset));
            std::this_thread::sleep_for(std::chrono::milliseconds(50));
          }
        }) {}
  ~Talker() {
    is_over_ = true;
    thread_.join();
  }
  void FallSilent() { is_talking_ = false; }

 private:
  static dds::ParticipantConfig Config() {
    dds::ParticipantConfig config;
    config.domain_id = kDomain;
    config.name = "talker";
    return config;
  }
  dds::Participant participant_;
  dds::Publisher<dds::RelativePose> publisher_;
  std::atomic<bool> is_over_{false};
  std::atomic<bool> is_talking_{true};
  std::atomic<dds::WriteOutcome> last_{dds::WriteOutcome::kWritten};
  std::thread thread_;
};

struct Outcome {
  ExitCode code;
  std::string out;
};

Outcome Watch(int domain_id, double seconds, bool on_terminal = false) {
  WatchRequest request;
  request.network.domain_id = domain_id;
  request.seconds = seconds;
  std::ostringstream out;
  std::ostringstream err;
  const ExitCode code = RunWatch(request, {out, err, false, on_terminal});
  return {code, out.str()};
}

TEST(WatchCommand, ShowsLivePosesAsLinesAndThenTheirSilence) {
  Talker talker(Duration(0));
  std::thread hush([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(2500));
    talker.FallSilent();
  });
  const Outcome outcome = Watch(kDomain, 4.5);
  hush.join();
  EXPECT_EQ(outcome.code, ExitCode::kDone);
  EXPECT_THAT(outcome.out, HasSubstr("relative_pose machine=tbm7"));
  EXPECT_THAT(outcome.out, HasSubstr("status=ok leds_used=5"));
  EXPECT_THAT(outcome.out, HasSubstr("tz_mm=3000.0000"));
  EXPECT_THAT(outcome.out, HasSubstr("stale what=\"pose tbm7\""));
}

TEST(WatchCommand, OldStampsAreStaleAlthoughTheyComeNow) {
  const Talker talker(std::chrono::seconds(-5));
  const Outcome lines = Watch(kDomain, 2.0);
  EXPECT_THAT(lines.out, HasSubstr("status=stale was=ok"));
  EXPECT_THAT(lines.out, Not(HasSubstr("tz_mm=")));
  const Outcome screen = Watch(kDomain, 2.0, true);
  EXPECT_THAT(screen.out, HasSubstr("STALE, was ok"));
  EXPECT_THAT(screen.out, Not(HasSubstr("\x1b[32mpose")));
}

TEST(WatchCommand, SaysWhenNobodyIsThere) {
  EXPECT_EQ(Watch(kEmptyDomain, 0.5).code, ExitCode::kDds);
}

TEST(WatchCommand, RefusesAPeerThatIsNoAddress) {
  WatchRequest request;
  request.network.peers = {"300.1.1.1"};
  request.seconds = 0.1;
  std::ostringstream out;
  std::ostringstream err;
  EXPECT_EQ(RunWatch(request, {out, err}), ExitCode::kBadInput);
  EXPECT_THAT(err.str(), HasSubstr("300.1.1.1"));
}

}  // namespace
}  // namespace tbm
