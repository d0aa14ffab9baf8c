#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/camera/camera.h"

namespace tbm {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

CameraConfig Gige() {
  CameraConfig config;
  config.driver = CameraDriver::kGige;
  config.address = "192.168.1.10";
  return config;
}

TEST(CheckCameraConfig, AcceptsTheDefaults) { EXPECT_THAT(CheckCameraConfig(Gige()), IsEmpty()); }

TEST(CheckCameraConfig, ReportsAllFaultsAtOnceWithKeyValueAndRange) {
  CameraConfig config = Gige();
  config.address = "camera.local";
  config.packet_size_bytes = 100;
  config.socket_buffer_bytes = 1000;
  config.frame_rate_hz = std::nan("");
  config.silent_after_ms = 5;
  EXPECT_THAT(CheckCameraConfig(config),
              ElementsAre(AllOf(StartsWith("camera.address: \"camera.local\""), HasSubstr("IPv4")),
                          "camera.packet_size_bytes: 100: wanted 576 .. 16000",
                          StartsWith("camera.socket_buffer_bytes: 1000: wanted 65536"),
                          StartsWith("camera.frame_rate_hz: nan: wanted 0.1"),
                          "camera.silent_after_ms: 5: wanted 100 .. 60000"));
}

TEST(CheckCameraConfig, TheFirstExposureMustLieWithinTheLimits) {
  CameraConfig config = Gige();
  config.exposure_us = 60'000.0;
  EXPECT_THAT(CheckCameraConfig(config),
              ElementsAre("camera.exposure_us: 60000: wanted 20 .. 50000"));
  config.exposure_us = 5.0;
  config.exposure_max_us = 1.0;
  EXPECT_THAT(CheckCameraConfig(config),
              ElementsAre(StartsWith("camera.exposure_max_us: 1: wanted 20"),
                          StartsWith("camera.exposure_us: 5")));
}

TEST(CheckCameraConfig, AReplayNeedsItsFolderAndNothingElse) {
  CameraConfig config;
  config.driver = CameraDriver::kReplay;
  config.frame_rate_hz = 0.0;
  EXPECT_THAT(CheckCameraConfig(config), ElementsAre(StartsWith("camera.run_folder: empty")));
  config.run_folder = "run";
  EXPECT_THAT(CheckCameraConfig(config), IsEmpty());
}

TEST(SilentAfter, IsThreePeriodsUnlessSaidOtherwise) {
  CameraConfig config = Gige();
  EXPECT_EQ(SilentAfter(config), std::chrono::milliseconds(300));
  config.frame_rate_hz = 100.0;
  EXPECT_EQ(SilentAfter(config), std::chrono::milliseconds(200));
  config.silent_after_ms = 750;
  EXPECT_EQ(SilentAfter(config), std::chrono::milliseconds(750));
}

}  // namespace
}  // namespace tbm
