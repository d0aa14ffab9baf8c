// The finder on images that ask everything of its arithmetic; prints every result to the last bit.
// Built with each kind of vectors and for each machine, it must print the same: same_bits_test.py.
#include <algorithm>
#include <bit>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <vector>

#include "pose/centres/find_centres.h"
#include "tests/support/render.h"

namespace tbm::test {
namespace {

std::uint64_t Bits(double value) { return std::bit_cast<std::uint64_t>(value); }

// Of the image: were it not the same on both machines, the finder is not to blame.
std::uint64_t SumOf(const RenderedImage& image) {
  std::uint64_t sum = 1469598103934665603ull;
  for (const std::uint8_t byte : image.bytes) sum = (sum ^ byte) * 1099511628211ull;
  return sum;
}

void Print(const char* what, const RenderedImage& image, CentreFinder& finder) {
  std::printf("%s image %016" PRIx64, what, SumOf(image));
  const auto result = finder.Find(image.view);
  if (!result) {
    std::printf(" failure %d\n", static_cast<int>(result.error()));
    return;
  }
  const FoundCentres& found = **result;
  std::printf(" background %016" PRIx64 " noise %016" PRIx64 " rejected %d dropped %d\n",
              Bits(found.levels.background_dn),
              Bits(found.levels.noise_dn),
              found.levels.rejected_spots,
              found.levels.dropped_spots);
  for (const Centre& centre : found.centres) {
    for (const double value : {centre.pixel_px.x(),
                               centre.pixel_px.y(),
                               centre.sigma_px,
                               centre.peak_dn,
                               centre.background_dn,
                               centre.spread_px,
                               centre.elongation}) {
      std::printf("  %016" PRIx64, Bits(value));
    }
    std::printf(
        "  %d  (%.4f, %.4f)\n", centre.clipped_pixels, centre.pixel_px.x(), centre.pixel_px.y());
  }
}

RenderSpot AnySpot(const RenderScene& scene, double brightest_dn, Random& random) {
  RenderSpot spot;
  spot.pixel_px = {random.Uniform(-5.0, scene.width_px + 5.0),
                   random.Uniform(-5.0, scene.height_px + 5.0)};
  spot.sigma_px = random.Uniform(0.4, 8.0);
  spot.peak_dn = brightest_dn * random.Uniform(0.02, 3.0);
  if (random.Unit() < 0.3) spot.smear_px = random.Normal2(6.0);
  return spot;
}

// Spots of every size and brightness on one another, hot pixels, slopes, full scale.
RenderedImage Crowded(int width_px, int height_px, int bytes, std::uint32_t full, Random& random) {
  RenderScene scene;
  scene.width_px = width_px;
  scene.height_px = height_px;
  const double unit_dn = full / 255.0;
  scene.background_dn = unit_dn * random.Uniform(0.0, 40.0);
  scene.slope_dn_per_px = 0.05 * unit_dn * random.Normal2();
  scene.read_noise_dn = unit_dn * random.Uniform(0.0, 2.0);
  scene.gain_dn_per_electron = 0.02 * unit_dn;
  const int spots = 1 + random.Index(width_px * height_px / 2500 + 1);
  for (int i = 0; i < spots; ++i) scene.spots.push_back(AnySpot(scene, full, random));
  for (int i = 0; i < 5; ++i) {
    scene.hot.push_back({random.Index(width_px), random.Index(height_px), full * random.Unit()});
  }
  return Render(scene, RenderMean(scene), random, bytes, full, random.Index(9));
}

// Nothing but black, full scale and single steps.
RenderedImage Nasty(int width_px, int height_px, int kind, Random& random) {
  RenderScene scene;
  scene.width_px = width_px;
  scene.height_px = height_px;
  RenderedImage image =
      Render(scene, std::vector<double>(static_cast<std::size_t>(width_px * height_px)), random);
  for (int row = 0; row < height_px; ++row) {
    for (int column = 0; column < width_px; ++column) {
      const bool is_set = kind == 0   ? random.Unit() < 0.02
                          : kind == 1 ? (column / 9 + row / 9) % 5 == 0
                          : kind == 2 ? std::hypot(column - 40.5, row - 37.25) < 6.0
                                      : column > row;
      image.Set(column, row, is_set ? 255u : static_cast<std::uint32_t>(kind == 2));
    }
  }
  return image;
}

int Main() {
  CentreFinder finder({});
  FinderOptions told;
  told.gain_dn_per_electron = 0.02;
  told.read_noise_dn = 0.5;
  CentreFinder told_finder(told);
  Random random("centre_bits");
  for (int i = 0; i < 60; ++i) {
    const int width_px = 40 + random.Index(260);
    const int height_px = 30 + random.Index(200);
    Print("bytes", Crowded(width_px, height_px, 1, 255, random), i % 2 == 0 ? finder : told_finder);
    const std::uint32_t full = i % 3 == 0 ? 4095 : i % 3 == 1 ? 65535 : 1023;
    Print("words", Crowded(width_px, height_px, 2, full, random), finder);
  }
  for (int i = 0; i < 12; ++i) Print("nasty", Nasty(90 + 7 * i, 81 + i, i % 4, random), finder);
  return 0;
}

}  // namespace
}  // namespace tbm::test

int main() { return tbm::test::Main(); }
