#include "pose/centres/find_centres.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/no_alloc.h"
#include "tests/support/render.h"

namespace tbm::test {
namespace {

RenderSpot Spot(double u_px, double v_px, double sigma_px = 2.5, double peak_dn = 180.0) {
  RenderSpot spot;
  spot.pixel_px = {u_px, v_px};
  spot.sigma_px = sigma_px;
  spot.peak_dn = peak_dn;
  return spot;
}

// A disc of full scale with a soft rim: a work lamp.
void AddLamp(RenderedImage& image, double u_px, double v_px, double radius_px) {
  for (int row = 0; row < image.view.height_px; ++row) {
    for (int column = 0; column < image.view.width_px; ++column) {
      const double beyond = std::hypot(column - u_px, row - v_px) - radius_px;
      const double light = beyond <= 0.0 ? 255.0 : 255.0 * std::exp(-beyond / 6.0);
      const auto sum = std::min(255.0, light + image.At(column, row));
      image.Set(column, row, static_cast<std::uint32_t>(sum));
    }
  }
}

const Centre* Nearest(const FoundCentres& found,
                      const Eigen::Vector2d& pixel_px,
                      double within_px) {
  const Centre* nearest = nullptr;
  for (const Centre& centre : found.centres) {
    const double distance_px = (centre.pixel_px - pixel_px).norm();
    if (distance_px < within_px) {
      nearest = &centre;
      within_px = distance_px;
    }
  }
  return nearest;
}

TEST(FindCentres, MeasuresPlaceSpreadPeakAndBackground) {
  Random random("FindCentres.Measures");
  RenderScene scene;
  scene.background_dn = 12.0;
  scene.spots = {Spot(61.3, 70.8, 2.2, 150.0)};
  const RenderedImage image = Render(scene, random);
  CentreFinder finder({});
  const auto found = finder.Find(image.view);
  ASSERT_TRUE(found);
  ASSERT_EQ(found.value()->centres.size(), 1u);
  const Centre& centre = found.value()->centres[0];
  EXPECT_NEAR(centre.pixel_px.x(), 61.3, 0.03);
  EXPECT_NEAR(centre.pixel_px.y(), 70.8, 0.03);
  EXPECT_NEAR(centre.spread_px, std::sqrt(2.2 * 2.2 + 1.0 / 12.0), 0.03);
  EXPECT_NEAR(centre.peak_dn, 150.0, 4.0);
  EXPECT_NEAR(centre.background_dn, 12.0, 0.3);
  EXPECT_LT(centre.elongation, 1.03);
  EXPECT_EQ(centre.clipped_pixels, 0);
  EXPECT_NEAR(found.value()->levels.background_dn, 12.0, 1.0);
  // Read noise 0.5, photons of 12 DN at 0.02 DN per electron, rounding.
  EXPECT_NEAR(found.value()->levels.noise_dn, std::sqrt(0.25 + 0.24 + 1.0 / 12.0), 0.1);
}

TEST(FindCentres, ComeBrightestFirst) {
  Random random("FindCentres.Brightest");
  RenderScene scene;
  scene.spots = {Spot(30, 30, 2, 80), Spot(90, 40, 2, 200), Spot(50, 95, 2, 140)};
  const RenderedImage image = Render(scene, random);
  CentreFinder finder({});
  const auto found = finder.Find(image.view);
  ASSERT_TRUE(found);
  ASSERT_EQ(found.value()->centres.size(), 3u);
  EXPECT_NEAR(found.value()->centres[0].peak_dn, 200.0, 5.0);
  EXPECT_NEAR(found.value()->centres[2].peak_dn, 80.0, 5.0);
}

TEST(FindCentres, BlackImageIsDarkAlsoWithHotPixels) {
  Random random("FindCentres.Dark");
  RenderScene scene;
  scene.background_dn = 3.0;
  scene.hot = {{20, 20, 120.0}, {100, 7, 60.0}, {64, 90, 200.0}};
  CentreFinder finder({});
  const auto found = finder.Find(Render(scene, random).view);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error(), ImageFailure::kDark);
}

TEST(FindCentres, WhiteImageIsSaturated) {
  Random random("FindCentres.White");
  RenderScene scene;
  scene.background_dn = 400.0;
  CentreFinder finder({});
  const auto found = finder.Find(Render(scene, random).view);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error(), ImageFailure::kSaturated);
}

TEST(FindCentres, HotPixelBesideASpotDoesNotPullIt) {
  Random random("FindCentres.Hot");
  double sum_px = 0.0;
  for (int draw = 0; draw < 30; ++draw) {
    RenderScene scene;
    scene.spots = {Spot(64.0 + random.Uniform(-0.5, 0.5), 64.0)};
    scene.hot = {{69, 64, 110.0}, {20, 20, 200.0}};
    const RenderedImage image = Render(scene, random);
    CentreFinder finder({});
    const auto found = finder.Find(image.view);
    ASSERT_TRUE(found);
    ASSERT_EQ(found.value()->centres.size(), 1u);
    EXPECT_GE(found.value()->levels.rejected_spots, 1);
    sum_px += found.value()->centres[0].pixel_px.x() - scene.spots[0].pixel_px.x();
  }
  EXPECT_NEAR(sum_px / 30.0, 0.0, 0.006);
}

TEST(FindCentres, LampIsNoSpotAndTheLedBesideItIsFound) {
  Random random("FindCentres.Lamp");
  RenderScene scene;
  scene.width_px = 400;
  scene.height_px = 300;
  scene.spots = {Spot(247.4, 150.7), Spot(90.2, 60.6)};
  RenderedImage image = Render(scene, random);
  AddLamp(image, 160.0, 150.0, 60.0);
  CentreFinder finder({});
  const auto found = finder.Find(image.view);
  ASSERT_TRUE(found);
  EXPECT_EQ(found.value()->centres.size(), 2u);
  for (const RenderSpot& spot : scene.spots) {
    const Centre* centre = Nearest(*found.value(), spot.pixel_px, 1.0);
    ASSERT_NE(centre, nullptr);
    EXPECT_LT((centre->pixel_px - spot.pixel_px).norm(), 4.0 * centre->sigma_px);
  }
  EXPECT_GE(found.value()->levels.rejected_spots, 1);
}

TEST(FindCentres, SpotOnTheRimOfALampIsRejectedOrHonest) {
  Random random("FindCentres.Rim");
  for (int draw = 0; draw < 40; ++draw) {
    RenderScene scene;
    scene.width_px = 300;
    scene.height_px = 240;
    scene.spots = {Spot(120.0 + 40.0 + random.Uniform(3.0, 22.0), 120.0 + random.Uniform(-9, 9))};
    RenderedImage image = Render(scene, random);
    AddLamp(image, 120.0, 120.0, 40.0);
    CentreFinder finder({});
    const auto found = finder.Find(image.view);
    if (!found) continue;
    for (const Centre& centre : found.value()->centres) {
      EXPECT_LT((centre.pixel_px - scene.spots[0].pixel_px).norm(), 5.0 * centre.sigma_px);
    }
  }
}

// Two sigmas of light must be left on every side: of less one cannot tell what was cut off. What is
// reported beyond that is honest, and nothing else is left out.
TEST(FindCentres, SpotCutByTheBorderIsRejectedOrHonest) {
  Random random("FindCentres.Border");
  constexpr double kSigmaPx = 2.5;
  int kept = 0;
  int missed = 0;
  double nees = 0.0;
  for (int draw = 0; draw < 200; ++draw) {
    const double inside_px = random.Uniform(-3.0, 12.0);  // from the image's edge
    const double along_px = random.Uniform(20.0, 70.0);
    RenderScene scene;
    scene.width_px = scene.height_px = 90;
    const double far_px = 89.5 - inside_px;
    const Eigen::Vector2d places[4] = {{inside_px - 0.5, along_px},
                                       {along_px, inside_px - 0.5},
                                       {far_px, along_px},
                                       {along_px, far_px}};
    scene.spots = {Spot(places[draw % 4].x(), places[draw % 4].y(), kSigmaPx)};
    const RenderedImage image = Render(scene, random);
    CentreFinder finder({});
    const auto found = finder.Find(image.view);
    missed += inside_px > 2.1 * kSigmaPx && (!found || found.value()->centres.empty());
    if (!found) continue;
    for (const Centre& centre : found.value()->centres) {
      ++kept;
      EXPECT_GT(inside_px, 1.9 * kSigmaPx);
      EXPECT_LT((centre.pixel_px - scene.spots[0].pixel_px).norm(), 5.0 * centre.sigma_px);
      nees += 0.5 * (centre.pixel_px - scene.spots[0].pixel_px).squaredNorm() /
              (centre.sigma_px * centre.sigma_px);
    }
  }
  EXPECT_EQ(missed, 0);
  EXPECT_GT(kept, 60);
  EXPECT_LT(nees / kept, 1.3);
}

// Vibration smears every lamp alike: 6 px along any direction.
TEST(FindCentres, MotionBlurDoesNotBias) {
  Random random("FindCentres.Blur");
  for (const double angle : {0.0, 0.6, 1.57, 2.4}) {
    Eigen::Vector2d sum_px = Eigen::Vector2d::Zero();
    double nees = 0.0;
    const int draws = 40;
    int found_spots = 0;
    for (int draw = 0; draw < draws; ++draw) {
      RenderScene scene;
      scene.width_px = 200;
      scene.height_px = 160;
      for (const Eigen::Vector2d& place :
           {Eigen::Vector2d(50, 50), Eigen::Vector2d(140, 40), Eigen::Vector2d(100, 110)}) {
        RenderSpot spot = Spot(place.x() + random.Unit(), place.y() + random.Unit());
        spot.smear_px = 6.0 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
        scene.spots.push_back(spot);
      }
      const RenderedImage image = Render(scene, random);
      CentreFinder finder({});
      const auto found = finder.Find(image.view);
      ASSERT_TRUE(found);
      for (const RenderSpot& spot : scene.spots) {
        const Centre* centre = Nearest(*found.value(), spot.pixel_px, 1.0);
        ASSERT_NE(centre, nullptr);
        EXPECT_NEAR(centre->elongation, std::sqrt(1.0 + 3.0 / (2.5 * 2.5)), 0.06);
        const Eigen::Vector2d error = centre->pixel_px - spot.pixel_px;
        sum_px += error;
        nees += 0.5 * error.squaredNorm() / (centre->sigma_px * centre->sigma_px);
        ++found_spots;
      }
    }
    // Sigma of one is 0.007 px.
    EXPECT_LT((sum_px / found_spots).norm(), 0.003) << "angle " << angle;
    EXPECT_LT(nees / found_spots, 1.25) << "angle " << angle;
  }
}

TEST(FindCentres, TwoSpotsTwelvePixelsApartAreTwo) {
  Random random("FindCentres.Two");
  double nees = 0.0;
  int count = 0;
  for (const double sigma_px : {1.5, 2.5, 3.5}) {
    for (int draw = 0; draw < 30; ++draw) {
      const double angle = random.Uniform(0.0, 3.14);
      const Eigen::Vector2d apart = 12.0 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      RenderScene scene;
      scene.spots = {Spot(60, 60, sigma_px, 180),
                     Spot(60 + apart.x(), 60 + apart.y(), sigma_px, random.Uniform(90, 200))};
      const RenderedImage image = Render(scene, random);
      CentreFinder finder({});
      const auto found = finder.Find(image.view);
      ASSERT_TRUE(found);
      for (const RenderSpot& spot : scene.spots) {
        const Centre* centre = Nearest(*found.value(), spot.pixel_px, 1.0);
        ASSERT_NE(centre, nullptr) << "sigma " << sigma_px << " angle " << angle;
        nees += 0.5 * (centre->pixel_px - spot.pixel_px).squaredNorm() /
                (centre->sigma_px * centre->sigma_px);
        ++count;
      }
    }
  }
  EXPECT_LT(nees / count, 2.0);
}

// Two lamps too close to part: neither may be claimed with a small sigma.
TEST(FindCentres, LampsMergedIntoOneAreRejectedOrHonest) {
  Random random("FindCentres.Merged");
  double nees = 0.0;
  int kept = 0;
  for (const double apart_px : {4.0, 5.0, 6.0, 8.0}) {
    for (const double second_dn : {60.0, 100.0, 180.0}) {
      for (int draw = 0; draw < 10; ++draw) {
        const double angle = random.Uniform(0.0, 3.14);
        RenderScene scene;
        scene.spots = {
            Spot(64, 64, 2.5, 180),
            Spot(64 + apart_px * std::cos(angle), 64 + apart_px * std::sin(angle), 2.5, second_dn)};
        const RenderedImage image = Render(scene, random);
        CentreFinder finder({});
        const auto found = finder.Find(image.view);
        if (!found) continue;
        for (const Centre& centre : found.value()->centres) {
          double nearest_px = 1e9;
          for (const RenderSpot& spot : scene.spots) {
            nearest_px = std::min(nearest_px, (centre.pixel_px - spot.pixel_px).norm());
          }
          ++kept;
          nees += 0.5 * std::pow(nearest_px / centre.sigma_px, 2);
          EXPECT_LT(nearest_px, 6.0 * centre.sigma_px)
              << apart_px << " px apart, second " << second_dn << " DN, sigma " << centre.sigma_px;
        }
      }
    }
  }
  EXPECT_LT(nees / std::max(kept, 1), 2.5);
}

// The same grey values, stored wider, padded, or within a larger image: the same centres, bit for
// bit.
TEST(FindCentres, StorageOfThePixelsDoesNotMatter) {
  RenderScene scene;
  scene.width_px = 150;
  scene.height_px = 101;
  scene.spots = {Spot(40.3, 30.1), Spot(100.9, 60.2, 3.0, 400.0), Spot(141.0, 90.0, 1.5, 90.0)};
  const std::vector<double> mean = RenderMean(scene);
  std::vector<Centres> all;
  for (const auto& [bytes, padding] : {std::pair{1, 0}, {1, 13}, {2, 0}, {2, 6}, {2, 7}}) {
    Random random("FindCentres.Storage");
    const RenderedImage image = Render(scene, mean, random, bytes, 255, padding);
    CentreFinder finder({});
    const auto found = finder.Find(image.view);
    ASSERT_TRUE(found);
    all.push_back(found.value()->centres);
  }
  ASSERT_GE(all[0].size(), 2u);
  for (const Centres& other : all) {
    ASSERT_EQ(other.size(), all[0].size());
    for (std::size_t i = 0; i < other.size(); ++i) {
      EXPECT_EQ(other[i].pixel_px, all[0][i].pixel_px);
      EXPECT_EQ(other[i].sigma_px, all[0][i].sigma_px);
    }
  }
}

TEST(FindCentres, TwelveBitImageHasTheSameCentresWithLessNoise) {
  Random random("FindCentres.TwelveBit");
  RenderScene scene;
  scene.background_dn = 120.0;
  scene.read_noise_dn = 6.0;
  scene.gain_dn_per_electron = 0.3;
  scene.spots = {Spot(60.4, 66.7, 2.5, 2800.0), Spot(100.2, 30.6, 2.0, 9000.0)};
  const RenderedImage image = Render(scene, RenderMean(scene), random, 2, 4095, 2);
  CentreFinder finder({});
  const auto found = finder.Find(image.view);
  ASSERT_TRUE(found);
  ASSERT_EQ(found.value()->centres.size(), 2u);
  for (const RenderSpot& spot : scene.spots) {
    const Centre* centre = Nearest(*found.value(), spot.pixel_px, 1.0);
    ASSERT_NE(centre, nullptr);
    EXPECT_LT((centre->pixel_px - spot.pixel_px).norm(), 0.025);
  }
}

// Every width and height around the vector and block sizes; the rows end where the memory ends.
TEST(FindCentres, AnySizeOfImageIsRead) {
  CentreFinder finder({});
  for (int width = 1; width <= 70; width += width < 18 ? 1 : 13) {
    for (int height = 1; height <= 40; height += height < 18 ? 1 : 11) {
      for (const int bytes : {1, 2}) {
        std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width * height * bytes));
        const auto middle = static_cast<std::size_t>((height / 2 * width + width / 2) * bytes);
        pixels[middle] = 200;
        const ImageView view{pixels.data(), width, height, width * bytes, bytes, 255};
        const auto found = finder.Find(view);
        EXPECT_TRUE(!found || found.value()->centres.empty() || width * height > 20);
      }
    }
  }
}

TEST(FindCentres, SpotInASmallImageIsFound) {
  Random random("FindCentres.Small");
  RenderScene scene;
  scene.width_px = 24;
  scene.height_px = 22;
  scene.spots = {Spot(11.6, 10.3, 1.5)};
  CentreFinder finder({});
  const auto found = finder.Find(Render(scene, random).view);
  ASSERT_TRUE(found);
  ASSERT_EQ(found.value()->centres.size(), 1u);
  EXPECT_LT((found.value()->centres[0].pixel_px - scene.spots[0].pixel_px).norm(), 0.05);
}

TEST(FindCentres, TakesNoMemoryAfterTheFirstImageOfASize) {
  Random random("FindCentres.NoAlloc");
  RenderScene scene;
  scene.width_px = 320;
  scene.height_px = 240;
  scene.spots = {Spot(60, 60)};
  const RenderedImage first = Render(scene, random);
  scene.spots = {Spot(50, 60), Spot(150, 60), Spot(162, 60), Spot(200, 180, 3.0, 900.0)};
  scene.hot = {{12, 12, 90.0}, {204, 180, 30.0}};
  RenderedImage second = Render(scene, random);
  AddLamp(second, 100.0, 180.0, 30.0);
  CentreFinder finder({});
  ASSERT_TRUE(finder.Find(first.view));
  const HeapCounter heap;
  const auto found = finder.Find(second.view);
  const long requests = heap.Count();
  ASSERT_TRUE(found);
  EXPECT_GE(found.value()->centres.size(), 4u);
  EXPECT_EQ(requests, 0);
}

TEST(FindCentres, MoreSpotsThanRoomDropsTheFaintest) {
  Random random("FindCentres.Many");
  RenderScene scene;
  scene.width_px = 460;
  scene.height_px = 460;
  for (int i = 0; i < 81; ++i) {
    scene.spots.push_back(Spot(30 + 50 * (i % 9), 30 + 50 * (i / 9), 2.0, 60.0 + 2.0 * i));
  }
  CentreFinder finder({});
  const auto found = finder.Find(Render(scene, random).view);
  ASSERT_TRUE(found);
  EXPECT_EQ(found.value()->centres.size(), kMaxCentres);
  EXPECT_EQ(found.value()->levels.dropped_spots, 81 - static_cast<int>(kMaxCentres));
  EXPECT_GT(found.value()->centres.back().peak_dn, 60.0 + 2.0 * 14);
}

// Noise in every pixel makes more runs than there is room for.
// Seen 2026-11: of the background only pixels on one line were left; the slope's variance came out
// negative and a centre with a sigma that is no number was reported.
TEST(FindCentres, BackgroundOnOneLineGivesNoSigmaThatIsNoNumber) {
  std::ifstream file(TBM_SOURCE_DIR "/tests/fuzz/seeds/find_centres_fuzz/nearly_all_clipped",
                     std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  ASSERT_EQ(bytes.size(), 699u);
  constexpr int kWidth = 40;
  constexpr int kHeight = 30;
  std::vector<std::uint8_t> pixels;
  for (std::size_t i = 0; i < kWidth * kHeight; ++i) {
    pixels.push_back(static_cast<std::uint8_t>(bytes[5 + i % (bytes.size() - 5)]));
  }
  ImageView view;
  view.pixels = pixels.data();
  view.stride_bytes = kWidth;
  view.width_px = kWidth;
  view.height_px = kHeight;
  view.bytes_per_pixel = 1;
  view.max_value = 255;
  CentreFinder finder({});
  const auto found = finder.Find(view);
  if (!found) return;
  for (const Centre& centre : found.value()->centres) EXPECT_GT(centre.sigma_px, 0.0);
}

TEST(FindCentres, PureNoiseEndsAndFindsNothing) {
  Random random("FindCentres.Noise");
  RenderedImage image;
  image.bytes.resize(1280 * 1024);
  for (std::uint8_t& byte : image.bytes) byte = static_cast<std::uint8_t>(random.Index(255));
  CentreFinder finder({});
  const ImageView view{image.bytes.data(), 1280, 1024, 1280, 1, 255};
  const auto found = finder.Find(view);
  EXPECT_TRUE(!found || found.value()->centres.empty());
}

}  // namespace
}  // namespace tbm::test
