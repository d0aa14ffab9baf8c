// How good the centres are, against the Cramer-Rao bound of the rendered spot with everything but
// the centre known: amplitude, spread and background plane (the stricter bound; with all of these
// estimated too it is less than 1 % larger).
#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/centres/find_centres.h"
#include "tests/support/render.h"

namespace tbm::test {
namespace {

constexpr double kReadNoise = 0.5;
constexpr double kGain = 0.02;

struct Tally {
  int found = 0;
  int missed = 0;
  double error2 = 0.0;  // per axis [px^2]
  double bound2 = 0.0;
  double nees = 0.0;  // error^2 by sigma^2, per axis

  void Add(const Tally& other) {
    found += other.found;
    missed += other.missed;
    error2 += other.error2;
    bound2 += other.bound2;
    nees += other.nees;
  }
  double RmsPx() const { return std::sqrt(error2 / found); }
  double Ratio() const { return std::sqrt(error2 / bound2); }
  double MeanNees() const { return nees / found; }
};

struct Case {
  double sigma_px = 2.5;
  double peak_dn = 200.0;
  double slope_dn_per_px = 0.0;
  bool sensor_known = true;
  bool may_clip = false;
  int draws = 100;
};

Tally RunCase(const Case& c, Random& random) {
  FinderOptions options;
  if (c.sensor_known) {
    options.gain_dn_per_electron = kGain;
    options.read_noise_dn = kReadNoise;
  }
  CentreFinder finder(options);
  Tally tally;
  double bound2 = 0.0;
  for (int draw = 0; draw < c.draws; ++draw) {
    RenderScene scene;
    scene.width_px = scene.height_px = 96;
    scene.background_dn = c.slope_dn_per_px > 0.0 ? 2.0 : 8.0;
    const double angle = random.Uniform(0.0, 1.57);
    scene.slope_dn_per_px = c.slope_dn_per_px * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    scene.read_noise_dn = kReadNoise;
    scene.gain_dn_per_electron = kGain;
    RenderSpot spot;
    spot.pixel_px = {48.0 + random.Uniform(-2.0, 2.0), 48.0 + random.Uniform(-2.0, 2.0)};
    spot.sigma_px = c.sigma_px;
    const double background_dn = scene.background_dn + scene.slope_dn_per_px.dot(spot.pixel_px);
    const double room_dn = 247.0 - background_dn;
    spot.peak_dn = c.may_clip ? c.peak_dn : std::min(c.peak_dn, room_dn);
    scene.spots = {spot};
    const RenderedImage image = Render(scene, random);
    if (draw % 25 == 0) bound2 = std::pow(CentreBoundPx(scene, spot, false), 2);
    const auto found = finder.Find(image.view);
    if (!found || found.value()->centres.size() != 1) {
      ++tally.missed;
      continue;
    }
    const Centre& centre = found.value()->centres[0];
    const double error2 = 0.5 * (centre.pixel_px - spot.pixel_px).squaredNorm();
    ++tally.found;
    tally.error2 += error2;
    tally.bound2 += bound2;
    tally.nees += error2 / (centre.sigma_px * centre.sigma_px);
  }
  return tally;
}

// The whole grid; each case at most 1.25 times its bound, with 100 draws that is 3.5 sigma above 1.
Tally RunGrid(const char* name, bool sensor_known) {
  Random random(name);
  Tally all;
  double worst = 0.0;
  for (const double slope : {0.0, 0.3}) {
    for (const double sigma_px : {1.5, 2.0, 2.5, 3.0, 4.0}) {
      for (const double peak_dn : {60.0, 120.0, 200.0, 245.0}) {
        const Tally tally = RunCase({sigma_px, peak_dn, slope, sensor_known}, random);
        EXPECT_LE(tally.Ratio(), 1.25)
            << "sigma " << sigma_px << " px, peak " << peak_dn << " DN, slope " << slope;
        EXPECT_EQ(tally.missed, 0) << "sigma " << sigma_px << ", peak " << peak_dn;
        worst = std::max(worst, tally.Ratio());
        all.Add(tally);
      }
    }
  }
  std::printf("%s: error %.3f x bound (worst case %.3f), NEES %.3f\n",
              name,
              all.Ratio(),
              worst,
              all.MeanNees());
  return all;
}

TEST(FindAccuracy, IsAtTheBoundWithAKnownSensor) {
  const Tally all = RunGrid("FindAccuracy.Known", true);
  EXPECT_LE(all.Ratio(), 1.05);
  EXPECT_GT(all.MeanNees(), 0.9);
  EXPECT_LT(all.MeanNees(), 1.1);
}

TEST(FindAccuracy, IsAtTheBoundWithTheSensorEstimatedFromTheImage) {
  const Tally all = RunGrid("FindAccuracy.Estimated", false);
  EXPECT_LE(all.Ratio(), 1.06);
  EXPECT_GT(all.MeanNees(), 0.9);
  EXPECT_LT(all.MeanNees(), 1.1);
}

// Peaks up to eight times full scale, the top cut off.
TEST(FindAccuracy, ClippedSpotsAreGoodToAHundredthOfAPixel) {
  Random random("FindAccuracy.Clipped");
  Tally all;
  for (const double slope : {0.0, 0.3}) {
    for (const double sigma_px : {1.5, 2.0, 2.5, 3.0, 4.0}) {
      for (const double peak_dn : {280.0, 400.0, 800.0, 2000.0}) {
        Case c{sigma_px, peak_dn, slope};
        c.may_clip = true;
        c.draws = 40;
        const Tally tally = RunCase(c, random);
        EXPECT_LE(tally.RmsPx(), 0.010) << "sigma " << sigma_px << " px, peak " << peak_dn;
        EXPECT_EQ(tally.missed, 0) << "sigma " << sigma_px << ", peak " << peak_dn;
        all.Add(tally);
      }
    }
  }
  std::printf("clipped: error %.4f px, NEES %.3f\n", all.RmsPx(), all.MeanNees());
  EXPECT_LE(all.RmsPx(), 0.005);
  EXPECT_GT(all.MeanNees(), 0.85);
  EXPECT_LT(all.MeanNees(), 1.15);
}

}  // namespace
}  // namespace tbm::test
