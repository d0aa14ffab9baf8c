#include "devices/sim/camera_view.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/scene.h"

namespace tbm::sim {
namespace {

constexpr Timestamp kBegin{1'790'000'000'000'000'000};
constexpr double kExposureUs = 5000.0;

// A view whose only light is what a test puts in.
ViewOptions Dark() {
  ViewOptions view;
  view.background_dn = 0.0;
  view.background_slope_dn_per_px = {0.0, 0.0};
  view.black_dn = 0.0;
  view.read_noise_dn = 0.0;
  view.gain_dn_per_electron = 0.0;
  view.hot_pixels = 0;
  view.led_peak_dn = 100.0;
  view.led_spread_of_brightness = 0.0;
  return view;
}

struct Image {
  int width = 0;
  std::vector<std::uint8_t> pixels;

  double At(int u, int v) const { return pixels[static_cast<std::size_t>(v * width + u)]; }
};

Image Rendered(const Faults& faults,
               const ViewOptions& options,
               double exposure_us = kExposureUs,
               Timestamp when = kBegin) {
  CameraView view(std::make_shared<World>(test::FieldRig(), Motion{}, faults, kBegin), options);
  Image image{view.width_px(), std::vector<std::uint8_t>(view.size_bytes())};
  view.Render(when, exposure_us, image.pixels.data());
  return image;
}

Eigen::Vector3d TruePoint(std::size_t led) {
  const Rig rig = test::FieldRig();
  return World(rig, Motion{}, {}, kBegin).At(kBegin).camera_from_target *
         rig.leds[led].p_led_in_target;
}

Eigen::Vector2d TruePixel(std::size_t led) {
  return test::ExactPixel(test::FieldRig().camera, TruePoint(led));
}

// Sum of the light and its centre in a square around a point.
struct Light {
  double sum = 0.0;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
};

Light LightAround(const Image& image, const Eigen::Vector2d& pixel) {
  Light light;
  const int u0 = static_cast<int>(std::lround(pixel.x()));
  const int v0 = static_cast<int>(std::lround(pixel.y()));
  for (int v = v0 - 11; v <= v0 + 11; ++v) {
    for (int u = u0 - 11; u <= u0 + 11; ++u) {
      light.sum += image.At(u, v);
      light.centre += image.At(u, v) * Eigen::Vector2d(u, v);
    }
  }
  if (light.sum > 0.0) light.centre /= light.sum;
  return light;
}

TEST(CameraView, PutsEachLedWhereTheLensDoes) {
  const Image image = Rendered({}, Dark());
  for (std::size_t led = 0; led < 5; ++led) {
    const Light light = LightAround(image, TruePixel(led));
    // Rounding to whole grey values is all that is between them.
    EXPECT_LT((light.centre - TruePixel(led)).norm(), 0.03) << led;
    const double nearness = 4.0 / TruePoint(led).norm();
    const double expected = 2.0 * std::numbers::pi * 2.2 * 2.2 * 100.0 * nearness * nearness;
    EXPECT_NEAR(light.sum / expected, 1.0, 0.01) << led;
  }
}

TEST(CameraView, LightGrowsWithTheExposureUntilItClips) {
  const Light once = LightAround(Rendered({}, Dark(), 2000.0), TruePixel(0));
  const Light twice = LightAround(Rendered({}, Dark(), 4000.0), TruePixel(0));
  EXPECT_NEAR(twice.sum / once.sum, 2.0, 0.02);
  const Image clipped = Rendered({}, Dark(), 50'000.0);
  EXPECT_EQ(*std::max_element(clipped.pixels.begin(), clipped.pixels.end()), 255);
}

TEST(CameraView, AHiddenLedIsDarkAndALampIsThere) {
  Faults faults;
  faults.hidden.push_back({1, {}});
  faults.lamps.push_back({{900.0, 900.0}, {3.0, 3.0}, 120.0, {}});
  const Image image = Rendered(faults, Dark());
  EXPECT_EQ(LightAround(image, TruePixel(1)).sum, 0.0);
  EXPECT_GT(LightAround(image, TruePixel(0)).sum, 1000.0);
  EXPECT_LT((LightAround(image, {900.0, 900.0}).centre - Eigen::Vector2d(900.0, 900.0)).norm(),
            0.02);
}

TEST(CameraView, AReflectionIsAFainterMirrorImage) {
  Faults faults;
  faults.reflections.push_back({900.0, {0.0, -300.0}, true, 0.4, {}});
  const Eigen::Vector2d led = TruePixel(1);
  const Eigen::Vector2d ghost(1800.0 - led.x(), led.y() - 300.0);
  const Image image = Rendered(faults, Dark());
  ASSERT_LT(ghost.x(), 1260.0);
  EXPECT_LT((LightAround(image, ghost).centre - ghost).norm(), 0.05);
  EXPECT_NEAR(LightAround(image, ghost).sum / LightAround(image, led).sum, 0.4, 0.02);
}

TEST(CameraView, TheBackgroundHasItsLevelSlopeAndNoise) {
  ViewOptions options;
  options.led_peak_dn = 0.0;
  options.hot_pixels = 0;
  const Image image = Rendered({}, options);
  const auto mean_at = [&](int u0, int v0) {
    double sum = 0.0;
    for (int v = v0; v < v0 + 100; ++v) {
      for (int u = u0; u < u0 + 100; ++u) sum += image.At(u, v);
    }
    return sum / 1e4;
  };
  EXPECT_NEAR(mean_at(590, 462), 16.0, 0.1);
  EXPECT_NEAR(mean_at(1100, 462) - mean_at(100, 462), 4.0, 0.1);
  EXPECT_NEAR(mean_at(590, 900) - mean_at(590, 100), -2.4, 0.1);
  double squares = 0.0;
  for (int v = 462; v < 562; ++v) {
    for (int u = 590; u < 689; ++u) squares += std::pow(image.At(u + 1, v) - image.At(u, v), 2);
  }
  // Read noise 0.9, photon noise sqrt(0.02 * 12), rounding sqrt(1/12).
  const double sigma_dn = std::sqrt(squares / (2.0 * 100.0 * 99.0));
  EXPECT_NEAR(sigma_dn, std::sqrt(0.81 + 0.24 + 1.0 / 12.0), 0.03);
}

TEST(CameraView, NoiseChangesFromFrameToFrameButNotFromRunToRun) {
  const Image first = Rendered({}, ViewOptions{});
  EXPECT_EQ(first.pixels, Rendered({}, ViewOptions{}).pixels);
  EXPECT_NE(first.pixels,
            Rendered({}, ViewOptions{}, kExposureUs, {kBegin.ns + 100'000'000}).pixels);
}

TEST(CameraView, SurvivesEveryExposureAndSpotsOutsideTheImage) {
  Faults faults;
  faults.lamps.push_back({{-200.0, 500.0}, {60.0, 60.0}, 1e6, {}});
  faults.lamps.push_back({{1279.0, 1023.0}, {40.0, 40.0}, 1e9, {}});
  ViewOptions bright;
  bright.background_dn = 1e5;
  for (const double exposure_us : {0.0, 20.0, 5000.0, 1e9}) {
    Rendered(faults, bright, exposure_us);
  }
  const Image image = Rendered({}, bright);
  EXPECT_EQ(*std::min_element(image.pixels.begin(), image.pixels.end()), 255);
}

}  // namespace
}  // namespace tbm::sim
