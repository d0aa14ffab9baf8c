#include "pose/app/self_test.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "pose/rig/rig_file.h"

namespace tbm {
namespace {

using ::testing::HasSubstr;

class SelfTest : public ::testing::Test {
 protected:
  SelfTest() : rig_(LoadRigFile(TBM_SOURCE_DIR "/pose/app/example/rig.yaml").value().rig) {
    config_.camera.driver = CameraDriver::kGige;
    config_.camera.address = "192.168.10.2";
    config_.camera.frame_rate_hz = 10.0;
    config_.dds.interfaces = {"10.0.0.5"};
    config_.recording.folder = "/var/lib/tbm/runs";
    config_.target_inclinometer.port.path = "/dev/tbm/tilt_target";
    config_.camera_inclinometer.port.path = "/dev/tbm/tilt_camera";
    host_.now = {1'800'000'000'000'000'000};
    host_.is_clock_synchronised = true;
    host_.receive_buffer_max_bytes = 8'000'000;
    host_.camera_link = CameraLink{"eth1", 1000, 1500, true, false};
    host_.recording_free_bytes = 8'000'000'000;
    host_.is_recording_writable = true;

    span_.seconds = 5.0;
    span_.camera.state = CameraState::kStreaming;
    span_.camera.frames = 50;
    span_.camera.packet_size_bytes = 1500;
    for (InclinometerHealth& tilt : span_.tilt) {
      tilt.state = InclinometerState::kStreaming;
      tilt.counters.good = 250;
    }
  }

  // What the box says of one frame with all LEDs as given.
  void Frame(double level_dn, double spread_px, int clipped = 0, int without_led = -1) {
    dds::FrameFeatures features;
    features.exposure_s = 0.005;
    for (int i = 0; i < static_cast<int>(rig_.leds.size()); ++i) {
      if (i == without_led) continue;
      dds::Spot spot;
      spot.led_index = i;
      spot.centre.peak_dn = level_dn - 10.0;
      spot.centre.background_dn = 10.0;
      spot.centre.spread_px = spread_px;
      spot.centre.elongation = 1.02;
      spot.centre.clipped_pixels = clipped;
      features.spots.push_back(spot);
    }
    collector_.Publish(features);
  }
  void Tilts(int count, double scatter_rad) {
    for (int i = 0; i < count; ++i) {
      dds::TiltReading reading;
      reading.validity = dds::Validity::kValid;
      reading.inclination = {0.01 + (i % 2 == 0 ? scatter_rad : -scatter_rad), 0.02};
      reading.sensor = "target";
      collector_.Publish(reading);
      reading.sensor = "camera";
      collector_.Publish(reading);
    }
  }
  static const Finding& Of(const std::vector<Finding>& findings, const std::string& part) {
    static const Finding kAbsent{Verdict::kBad, "", "no such finding", ""};
    for (const Finding& finding : findings) {
      if (finding.part == part) return finding;
    }
    ADD_FAILURE() << "nothing said of " << part;
    return kAbsent;
  }
  static int Count(const std::vector<Finding>& findings, Verdict verdict) {
    int count = 0;
    for (const Finding& finding : findings) count += finding.verdict == verdict ? 1 : 0;
    return count;
  }

  Rig rig_;
  BoxConfig config_;
  HostFacts host_;
  MeasuredSpan span_;
  SelfTestCollector collector_;
};

TEST_F(SelfTest, AHealthyBoxIsGoodThroughout) {
  for (int i = 0; i < 50; ++i) Frame(160.0, 2.2);
  Tilts(250, 1e-5);
  dds::RelativePose pose;
  pose.status = PoseStatus::kOk;
  for (int i = 0; i < 50; ++i) collector_.Publish(pose);
  std::vector<Finding> all = JudgeHost(host_, config_, rig_);
  const auto seen = collector_.seen();
  for (const auto& more : {JudgeCamera(span_, seen, config_),
                           JudgeLeds(seen, config_, rig_),
                           JudgeTilts(span_, seen, config_, rig_),
                           JudgePose(seen)}) {
    all.insert(all.end(), more.begin(), more.end());
  }
  EXPECT_EQ(Count(all, Verdict::kGood), static_cast<int>(all.size())) << ReportText(all);
  EXPECT_THAT(ReportText(all), HasSubstr("The box is ready."));
  EXPECT_EQ(all.size(), 14u) << "clock, disk, DDS, link, camera, transfer, 5 LEDs, 2 tilts, pose\n"
                             << ReportText(all);
}

TEST_F(SelfTest, EveryFaultOfTheHostHasItsOwnWord) {
  host_.is_clock_synchronised = false;
  host_.recording_free_bytes = 1'000'000'000;
  host_.receive_buffer_max_bytes = 212'992;
  host_.camera_link->speed_mbit_s = 100;
  host_.dds_addresses_missing = {"10.0.0.5"};
  auto findings = JudgeHost(host_, config_, rig_);
  EXPECT_EQ(Of(findings, "clock").verdict, Verdict::kDoubtful);
  EXPECT_EQ(Of(findings, "disk").verdict, Verdict::kDoubtful);
  EXPECT_EQ(Of(findings, "socket buffer").verdict, Verdict::kDoubtful);
  EXPECT_EQ(Of(findings, "DDS").verdict, Verdict::kBad);
  const Finding& link = Of(findings, "camera link");
  EXPECT_EQ(link.verdict, Verdict::kBad);
  EXPECT_THAT(link.text, HasSubstr("100 Mbit/s, 110 needed"));  // 1280 x 1024 x 8 x 10 x 1.05

  host_.now = {0};
  host_.is_recording_writable = false;
  host_.camera_link->has_carrier = false;
  findings = JudgeHost(host_, config_, rig_);
  EXPECT_EQ(Of(findings, "clock").verdict, Verdict::kBad);
  EXPECT_EQ(Of(findings, "disk").verdict, Verdict::kBad);
  EXPECT_THAT(Of(findings, "camera link").remedy, HasSubstr("cable"));

  host_.camera_link.reset();
  EXPECT_THAT(Of(JudgeHost(host_, config_, rig_), "camera link").text,
              HasSubstr("subnet of 192.168.10.2"));
}

TEST_F(SelfTest, TheRigFileOfThePackageIsNoCalibration) {
  const std::string delivered = TBM_SOURCE_DIR "/tools/package/box/rig.yaml";
  const Rig rig = LoadRigFile(delivered).value().rig;
  EXPECT_EQ(Of(JudgeHost(host_, config_, rig), "rig file").verdict, Verdict::kBad);
}

TEST_F(SelfTest, AHundredMegabitIsEnoughForASlowCamera) {
  host_.camera_link->speed_mbit_s = 100;
  config_.camera.frame_rate_hz = 5.0;
  EXPECT_EQ(Of(JudgeHost(host_, config_, rig_), "camera link").verdict, Verdict::kGood);
}

TEST_F(SelfTest, ACameraThatDoesNotStreamSaysWhyAndWhatToDo) {
  span_.camera.state = CameraState::kClosed;
  span_.camera.failure = CameraFailure::kInUse;
  const auto findings = JudgeCamera(span_, collector_.seen(), config_);
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_EQ(findings[0].verdict, Verdict::kBad);
  EXPECT_THAT(findings[0].remedy, HasSubstr("systemctl stop tbm-camera-box"));
}

TEST_F(SelfTest, LossSmallPacketsAndALowRateAreDoubtful) {
  span_.camera.frames = 40;
  span_.camera.lost = 9;
  span_.camera.incomplete = 1;
  span_.camera.packet_size_bytes = 576;
  const auto findings = JudgeCamera(span_, collector_.seen(), config_);
  EXPECT_EQ(Count(findings, Verdict::kDoubtful), 3) << ReportText(findings);
  EXPECT_THAT(Of(findings, "image transfer").text, HasSubstr("10 of 50"));
  EXPECT_THAT(Of(findings, "packet size").text, HasSubstr("576"));
}

TEST_F(SelfTest, LedsAreJudgedOneByOne) {
  struct Case {
    double level_dn;
    double spread_px;
    int clipped;
    const char* word;
  };
  for (const Case& one : {Case{255.0, 2.0, 30, "too bright"},
                          Case{50.0, 2.0, 0, "too dark"},
                          Case{160.0, 6.5, 0, "out of focus"},
                          Case{160.0, 0.7, 0, "smaller than a pixel"}}) {
    collector_.Restart();
    for (int i = 0; i < 10; ++i) Frame(one.level_dn, one.spread_px, one.clipped);
    const auto findings = JudgeLeds(collector_.seen(), config_, rig_);
    EXPECT_EQ(Count(findings, Verdict::kDoubtful), 5) << one.word;
    EXPECT_THAT(findings[0].text, HasSubstr(one.word));
  }
  collector_.Restart();
  for (int i = 0; i < 10; ++i) Frame(160.0, 2.0, 0, 2);
  auto findings = JudgeLeds(collector_.seen(), config_, rig_);
  EXPECT_EQ(Of(findings, "LED " + rig_.leds[2].id).text, "not seen");
  EXPECT_EQ(Count(findings, Verdict::kBad), 1);
  for (int i = 0; i < 5; ++i) Frame(160.0, 2.0);
  findings = JudgeLeds(collector_.seen(), config_, rig_);
  EXPECT_EQ(Of(findings, "LED " + rig_.leds[2].id).text, "seen in 5 of 15 images only");
}

TEST_F(SelfTest, InclinometersAreJudgedByAnswersAngleAndScatter) {
  Tilts(250, 1e-5);
  span_.tilt[0].state = InclinometerState::kSilent;
  span_.tilt[0].last_failure = InclinometerFailure::kNoReply;
  span_.tilt[1].counters.garbled = 20;
  auto findings = JudgeTilts(span_, collector_.seen(), config_, rig_);
  ASSERT_EQ(findings.size(), 2u);
  EXPECT_EQ(findings[0].verdict, Verdict::kBad);
  EXPECT_EQ(findings[0].text, "no_reply at /dev/tbm/tilt_target");
  EXPECT_EQ(findings[1].verdict, Verdict::kDoubtful);
  EXPECT_THAT(findings[1].remedy, HasSubstr("termination"));

  span_.tilt[0] = {};
  span_.tilt[0].state = InclinometerState::kStreaming;
  span_.tilt[0].counters.good = 250;
  span_.tilt[1].counters.garbled = 0;
  collector_.Restart();
  Tilts(250, 30.0 * rig_.target_tilt.sigma_rad);
  findings = JudgeTilts(span_, collector_.seen(), config_, rig_);
  EXPECT_THAT(findings[0].remedy, HasSubstr("vibrates"));
}

TEST_F(SelfTest, ThePosesCommonestReasonIsNamed) {
  dds::RelativePose pose;
  pose.reason = PoseReason::kFrameDark;
  for (int i = 0; i < 3; ++i) collector_.Publish(pose);
  pose.reason = PoseReason::kTooFewLeds;
  collector_.Publish(pose);
  const auto findings = JudgePose(collector_.seen());
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_EQ(findings[0].verdict, Verdict::kBad);
  EXPECT_THAT(findings[0].text, HasSubstr("mostly frame_dark"));
  EXPECT_THAT(ReportText(findings), HasSubstr("1 bad, 0 doubtful. The box is not ready."));
}

}  // namespace
}  // namespace tbm
