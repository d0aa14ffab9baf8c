#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pose/base/pose_reason.h"
#include "pose/base/result.h"
#include "pose/centres/image_view.h"

namespace tbm {

struct ImageSize {
  int width_px = 0;
  int height_px = 0;
  bool operator==(const ImageSize&) const = default;
};

// A grey image in its own memory, rows without padding, 16-bit pixels in host order.
struct OwnedImage {
  ImageSize size;
  int bytes_per_pixel = 1;        // 1 or 2
  std::uint32_t max_value = 255;  // full scale, e.g. 4095 for a 12-bit camera
  std::vector<std::uint8_t> bytes;

  // Valid as long as the image is neither changed nor moved.
  ImageView View() const;
};

enum class ImageFileFailure {
  kMissing,     // no such file, or it cannot be opened
  kUnreadable,  // cut, damaged, or not an 8- or 16-bit grey PNG, PGM (P5) or TIFF
  kSize,        // whole, but not of the expected size
};

struct ImageFileFault {
  ImageFileFailure failure = ImageFileFailure::kUnreadable;
  std::string what;  // for the log: "IDAT: CRC error"
};

using ImageResult = Result<OwnedImage, ImageFileFault>;

// The format is told by the first bytes, not by the name. With `expected`, an image of another size
// is refused before its pixels are decoded. No image above 64 million pixels is read.
//
// Full scale: 255 or 65535; PGM says it itself; PNG by its sBIT chunk and TIFF by MaxSampleValue,
// where a camera of 10 or 12 bits wrote it.
ImageResult ParseImage(std::span<const std::uint8_t> bytes, std::optional<ImageSize> expected = {});
ImageResult ReadImageFile(const std::string& path, std::optional<ImageSize> expected = {});

// The reason that stands in a frame's result.
PoseReason ReasonOf(ImageFileFailure failure);

// An image as the bytes of a file. PGM keeps any full scale; PNG only one of 2^n - 1: others come
// out empty (optional). `png_effort` 0 .. 9 as in zlib; 1 is four times faster than 6 and 3 %
// larger on noisy frames.
std::vector<std::uint8_t> EncodePgm(const ImageView& image);
std::optional<std::vector<std::uint8_t>> EncodePng(const ImageView& image, int png_effort = 1);

}  // namespace tbm
