#include "devices/camera/exposure_control.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace tbm {
namespace {

constexpr double kFullScale = 255.0;

// A camera whose exposure comes into force some frames after it was asked for, in front of LEDs of
// different brightness.
struct Scene {
  std::vector<double> leds = {1.0, 0.85, 0.7, 1.1, 0.95};  // of brightness_dn_per_us
  double brightness_dn_per_us = 0.03;
  double noise_dn = 1.0;
  double flicker = 0.0;
  int latency = 2;
  double exposure_step_us = 1.0;
  double visible_dn = 12.0;  // fainter peaks are not recognised
  ExposureLimits limits{20.0, 50'000.0};
};

class Loop {
 public:
  Loop(const Scene& scene, double exposure_us, const char* stream)
      : scene_(scene),
        random_(stream),
        control_(scene.limits),
        coming_us_(static_cast<std::size_t>(scene.latency), exposure_us),
        exposure_us_(exposure_us) {}

  void Frame() {
    std::vector<LedLevel> seen;
    brightest_ = 0.0;
    faintest_ = 1.0;
    for (const double led : scene_.leds) {
      const double lit = 1.0 + scene_.flicker * random_.Normal();
      const double dn =
          led * lit * scene_.brightness_dn_per_us * exposure_us_ + random_.Normal(scene_.noise_dn);
      const double mean = led * scene_.brightness_dn_per_us * exposure_us_;
      brightest_ = std::max(brightest_, mean / kFullScale);
      faintest_ = std::min(faintest_, mean / kFullScale);
      if (dn >= scene_.visible_dn) seen.push_back({std::min(dn, kFullScale), dn >= kFullScale});
    }
    if (hidden_) seen.clear();
    const auto asked = control_.Update({exposure_us_, kFullScale, seen, false});
    if (asked) {
      ++steps_;
      wanted_us_ = scene_.exposure_step_us * std::round(*asked / scene_.exposure_step_us);
    }
    coming_us_.push_back(wanted_us_.value_or(exposure_us_));
    exposure_us_ = coming_us_.front();
    coming_us_.pop_front();
  }
  void Frames(int count) {
    for (int i = 0; i < count; ++i) Frame();
  }

  bool IsInBand() const { return brightest_ <= 0.9 && faintest_ >= 0.4; }
  double brightest() const { return brightest_; }
  double exposure_us() const { return exposure_us_; }
  int steps() const { return steps_; }
  void Hide(bool hidden) { hidden_ = hidden; }
  Scene& scene() { return scene_; }

 private:
  Scene scene_;
  test::Random random_;
  ExposureControl control_;
  std::deque<double> coming_us_;
  std::optional<double> wanted_us_;
  double exposure_us_;
  double brightest_ = 0.0;
  double faintest_ = 1.0;
  int steps_ = 0;
  bool hidden_ = false;
};

// 0.03 DN/us puts the LEDs in their band near 5.5 ms.
class FromAnyExposure : public ::testing::TestWithParam<std::tuple<double, int>> {};

TEST_P(FromAnyExposure, ComesIntoTheBandAndStays) {
  const auto [start_us, latency] = GetParam();
  Scene scene;
  scene.latency = latency;
  Loop loop(scene, start_us, "ExposureControl.converge");
  loop.Frames(80);
  EXPECT_TRUE(loop.IsInBand()) << loop.exposure_us();
  const int steps = loop.steps();
  loop.Frames(500);
  EXPECT_TRUE(loop.IsInBand()) << loop.exposure_us();
  EXPECT_EQ(loop.steps(), steps);
}

INSTANTIATE_TEST_SUITE_P(
    HundredTimesTooDarkToTooBright,
    FromAnyExposure,
    ::testing::Combine(::testing::Values(55.0, 550.0, 4000.0, 5500.0, 8000.0, 50'000.0),
                       ::testing::Values(0, 1, 3, 6)));

TEST(ExposureControl, ComesDownFromAHundredTimesTooBright) {
  Scene scene;
  scene.brightness_dn_per_us = 3.0;  // the band is near 55 us
  Loop loop(scene, 5500.0, "ExposureControl.bright");
  loop.Frames(80);
  EXPECT_TRUE(loop.IsInBand()) << loop.exposure_us();
}

TEST(ExposureControl, FlickeringLampsCauseNoOscillation) {
  Scene scene;
  scene.flicker = 0.10;
  scene.noise_dn = 3.0;
  Loop loop(scene, 5500.0, "ExposureControl.flicker");
  loop.Frames(100);
  const int steps = loop.steps();
  double lowest_us = 1e9;
  double highest_us = 0.0;
  for (int i = 0; i < 2000; ++i) {
    loop.Frame();
    lowest_us = std::min(lowest_us, loop.exposure_us());
    highest_us = std::max(highest_us, loop.exposure_us());
  }
  EXPECT_LE(loop.steps() - steps, 4);
  EXPECT_LT(highest_us / lowest_us, 1.6);
  EXPECT_LT(loop.brightest(), 0.95);
}

TEST(ExposureControl, OneFlashMovesNothing) {
  Scene scene;
  Loop loop(scene, 5500.0, "ExposureControl.flash");
  loop.Frames(50);
  const double exposure_us = loop.exposure_us();
  for (int i = 0; i < 20; ++i) {
    loop.scene().brightness_dn_per_us = 0.3;
    loop.Frame();
    loop.scene().brightness_dn_per_us = 0.03;
    loop.Frames(9);
  }
  EXPECT_EQ(loop.exposure_us(), exposure_us);
}

TEST(ExposureControl, OfVeryDifferentLedsTheBrightOnesDecide) {
  Scene scene;
  scene.leds = {1.0, 0.9, 0.15};
  Loop loop(scene, 500.0, "ExposureControl.different");
  loop.Frames(100);
  const int steps = loop.steps();
  loop.Frames(500);
  EXPECT_EQ(loop.steps(), steps);
  EXPECT_GT(loop.brightest(), 0.7);
  EXPECT_LE(loop.brightest(), 0.9);
}

TEST(ExposureControl, AHiddenTargetDoesNotMoveItForTwoSeconds) {
  Scene scene;
  Loop loop(scene, 5500.0, "ExposureControl.hidden");
  loop.Frames(50);
  const double exposure_us = loop.exposure_us();
  loop.Hide(true);
  loop.Frames(19);
  EXPECT_EQ(loop.exposure_us(), exposure_us);
  loop.Hide(false);
  loop.Frames(20);
  EXPECT_EQ(loop.exposure_us(), exposure_us);
}

TEST(ExposureControl, FindsTheTargetAgainWhateverTheSearchHadReached) {
  for (int hidden_frames = 20; hidden_frames < 120; hidden_frames += 7) {
    Scene scene;
    Loop loop(scene, 5500.0, "ExposureControl.again");
    loop.Frames(50);
    loop.Hide(true);
    loop.Frames(hidden_frames);
    loop.Hide(false);
    loop.Frames(120);
    EXPECT_TRUE(loop.IsInBand()) << hidden_frames;
  }
}

TEST(ExposureControl, TheSearchGoesRoundAllExposures) {
  Scene scene;
  Loop loop(scene, 5500.0, "ExposureControl.round");
  loop.Hide(true);
  double lowest_us = 1e9;
  double highest_us = 0.0;
  for (int i = 0; i < 200; ++i) {
    loop.Frame();
    lowest_us = std::min(lowest_us, loop.exposure_us());
    highest_us = std::max(highest_us, loop.exposure_us());
  }
  EXPECT_EQ(lowest_us, 20.0);
  EXPECT_EQ(highest_us, 50'000.0);
}

TEST(ExposureControl, KeepsToItsLimits) {
  Scene dark;
  dark.brightness_dn_per_us = 0.001;
  Loop in_the_dark(dark, 5000.0, "ExposureControl.limits");
  Scene bright;
  bright.brightness_dn_per_us = 100.0;
  Loop in_the_light(bright, 5000.0, "ExposureControl.limits");
  for (int i = 0; i < 400; ++i) {
    in_the_dark.Frame();
    in_the_light.Frame();
    EXPECT_LE(in_the_dark.exposure_us(), 50'000.0);
    EXPECT_GE(in_the_light.exposure_us(), 20.0);
  }
  EXPECT_EQ(in_the_dark.exposure_us(), 50'000.0);
  EXPECT_EQ(in_the_light.exposure_us(), 20.0);
}

TEST(ExposureControl, ASaturatedImageIsDarkenedAtOnce) {
  ExposureControl control({20.0, 50'000.0});
  EXPECT_EQ(control.Update({40'000.0, kFullScale, {}, true}), 10'000.0);
}

TEST(ExposureControl, AnUnknownExposureIsNotRegulated) {
  ExposureControl control({20.0, 50'000.0});
  for (int i = 0; i < 100; ++i) {
    EXPECT_FALSE(control.Update({std::nan(""), kFullScale, {}, true}));
    EXPECT_FALSE(control.Update({0.0, kFullScale, {}, false}));
  }
}

TEST(ExposureControl, OneStepIsInFlightUntilItHasArrived) {
  ExposureControl control({20.0, 50'000.0});
  const std::vector<LedLevel> dim = {{40.0, false}};
  std::optional<double> asked;
  for (int i = 0; i < 5; ++i) asked = control.Update({1000.0, kFullScale, dim, false});
  ASSERT_TRUE(asked);
  for (int i = 0; i < ExposureControl::kPatience; ++i) {
    EXPECT_FALSE(control.Update({1000.0, kFullScale, dim, false})) << i;
  }
  // The request was lost on its way: it is made again.
  for (int i = 0; i < 5; ++i) asked = control.Update({1000.0, kFullScale, dim, false});
  EXPECT_TRUE(asked);
}

}  // namespace
}  // namespace tbm
