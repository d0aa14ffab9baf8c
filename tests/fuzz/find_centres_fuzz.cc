#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "pose/centres/find_centres.h"

// Any bytes as an image of any size, stride and depth: the finder reads nothing outside and reports
// nothing that is not finite. Header: width, height, padding, depth and scale, one byte each; the
// pixels follow and are repeated to fill the image.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 5) return 0;
  const int width = data[0];
  const int height = data[1];
  const int bytes = 1 + data[3] % 2;
  const int stride = width * bytes + data[2] % 16;
  // Exactly as much memory as the view may read, so that the sanitizer sees one byte more.
  const std::size_t needed =
      height == 0 ? 0 : static_cast<std::size_t>(stride * (height - 1) + width * bytes);
  std::vector<std::uint8_t> pixels(needed);
  for (std::size_t i = 0; i < needed && size > 5; ++i) pixels[i] = data[5 + i % (size - 5)];

  tbm::ImageView view;
  view.pixels = pixels.data();
  view.width_px = width;
  view.height_px = height;
  view.stride_bytes = stride;
  view.bytes_per_pixel = bytes;
  view.max_value = bytes == 1 ? 255u : (1u << (8 + data[4] % 9)) - 1u;
  static tbm::CentreFinder finder({});
  const auto found = finder.Find(view);
  if (!found) return 0;
  for (const tbm::Centre& centre : found.value()->centres) {
    const bool sound = centre.pixel_px.allFinite() && centre.sigma_px > 0.0 &&
                       std::isfinite(centre.sigma_px) && std::isfinite(centre.peak_dn) &&
                       centre.pixel_px.x() >= -0.5 && centre.pixel_px.x() <= width - 0.5 &&
                       centre.pixel_px.y() >= -0.5 && centre.pixel_px.y() <= height - 0.5 &&
                       centre.elongation >= 1.0;
    if (!sound) std::abort();
  }
  return 0;
}
