#include "devices/app/fault_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/support/scene.h"

namespace tbm {
namespace {

using ::testing::HasSubstr;

TEST(FaultOptions, AHiddenLedByNameAndWindow) {
  const Rig rig = test::PublishedRig();
  const auto hidden = ParseHiddenLed(rig.leds[2].id + "@10-20.5", rig);
  ASSERT_TRUE(hidden);
  EXPECT_EQ(hidden->led, 2u);
  EXPECT_EQ(hidden->window.from_s, 10.0);
  EXPECT_EQ(hidden->window.to_s, 20.5);
  EXPECT_TRUE(ParseHiddenLed(rig.leds[0].id, rig)->window.Contains(1e9));
}

TEST(FaultOptions, ALampAReflectionAndATiltFault) {
  const auto lamp = ParseLamp("640,200.5,15,600@5-10");
  ASSERT_TRUE(lamp);
  EXPECT_EQ(lamp->pixel_px, Eigen::Vector2d(640.0, 200.5));
  EXPECT_EQ(lamp->spread_px, Eigen::Vector2d(15.0, 15.0));
  EXPECT_EQ(lamp->peak_dn, 600.0);
  const auto mirrored = ParseReflection("640,1,-30,0.4");
  ASSERT_TRUE(mirrored);
  EXPECT_TRUE(mirrored->is_mirrored);
  EXPECT_EQ(mirrored->mirror_u_px, 640.0);
  EXPECT_EQ(mirrored->shift_px, Eigen::Vector2d(1.0, -30.0));
  EXPECT_EQ(mirrored->strength, 0.4);
  EXPECT_FALSE(ParseReflection("-,8,3,0.3")->is_mirrored);
  const auto tilt = ParseTiltFault("camera,4,-0.5@20-30");
  ASSERT_TRUE(tilt);
  EXPECT_EQ(tilt->sensor, sim::TiltSensor::kCamera);
  EXPECT_DOUBLE_EQ(tilt->offset.beta_rad, DegToRad(4.0));
  EXPECT_DOUBLE_EQ(tilt->offset.gamma_rad, DegToRad(-0.5));
  EXPECT_EQ(tilt->window.to_s, 30.0);
}

TEST(FaultOptions, AnythingElseIsRefusedWithWhatWouldBeRight) {
  const Rig rig = test::PublishedRig();
  for (const char* text : {"", "P9", "P3@", "P3@5", "P3@20-10", "P3,P4", "P3@a-b"}) {
    const auto hidden = ParseHiddenLed(text, rig);
    ASSERT_FALSE(hidden) << text;
    EXPECT_THAT(hidden.error(), HasSubstr("P3@10-20"));
  }
  for (const char* text : {"", "1,2,3", "1,2,3,4,5", "1,2,0,4", "1,2,x,4", "1,,3,4", "nan,2,3,4"}) {
    ASSERT_FALSE(ParseLamp(text)) << text;
  }
  EXPECT_THAT(ParseLamp("1").error(), HasSubstr("--lamp 1: wanted U,V,SPREAD,PEAK"));
  for (const char* text : {"", "-", "x,1,2,3", "640,1,2"})
    EXPECT_FALSE(ParseReflection(text)) << text;
  for (const char* text : {"", "target", "rail,1,2", "target,1", "target,1,2,3"}) {
    EXPECT_FALSE(ParseTiltFault(text)) << text;
  }
}

}  // namespace
}  // namespace tbm
