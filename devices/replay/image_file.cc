#include "devices/replay/image_file.h"

#include <cerrno>
#include <cstring>
#include <fstream>

#include <fmt/format.h>

#include "devices/replay/image_codec.h"

namespace tbm {

ImageView OwnedImage::View() const {
  ImageView view;
  view.pixels = bytes.data();
  view.width_px = size.width_px;
  view.height_px = size.height_px;
  view.stride_bytes = static_cast<std::ptrdiff_t>(size.width_px) * bytes_per_pixel;
  view.bytes_per_pixel = bytes_per_pixel;
  view.max_value = max_value;
  return view;
}

ImageResult Unreadable(std::string what) {
  return Failure{ImageFileFault{ImageFileFailure::kUnreadable, std::move(what)}};
}

std::optional<ImageFileFault> CheckSize(std::int64_t width_px,
                                        std::int64_t height_px,
                                        std::optional<ImageSize> expected) {
  if (width_px < 1 || height_px < 1 || width_px > kMostPixels || height_px > kMostPixels ||
      width_px * height_px > kMostPixels) {
    return ImageFileFault{ImageFileFailure::kUnreadable,
                          fmt::format("claims to be {} x {} pixels", width_px, height_px)};
  }
  if (expected && (width_px != expected->width_px || height_px != expected->height_px)) {
    return ImageFileFault{ImageFileFailure::kSize,
                          fmt::format("is {} x {} pixels; the rig is calibrated for {} x {}",
                                      width_px,
                                      height_px,
                                      expected->width_px,
                                      expected->height_px)};
  }
  return std::nullopt;
}

OwnedImage BlankImage(ImageSize size, int bytes_per_pixel, std::uint32_t max_value) {
  OwnedImage image{size, bytes_per_pixel, max_value, {}};
  image.bytes.resize(static_cast<std::size_t>(size.width_px) *
                     static_cast<std::size_t>(size.height_px) *
                     static_cast<std::size_t>(bytes_per_pixel));
  return image;
}

ImageResult ParseImage(std::span<const std::uint8_t> bytes, std::optional<ImageSize> expected) {
  if (LooksLikePng(bytes)) return ParsePng(bytes, expected);
  if (LooksLikePgm(bytes)) return ParsePgm(bytes, expected);
  if (LooksLikeTiff(bytes)) return ParseTiff(bytes, expected);
  return Unreadable(bytes.empty() ? "is empty" : "is neither PNG, PGM (P5) nor TIFF");
}

ImageResult ReadImageFile(const std::string& path, std::optional<ImageSize> expected) {
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    const char* why = errno != 0 ? std::strerror(errno) : "cannot be opened";
    return Failure{ImageFileFault{ImageFileFailure::kMissing, why}};
  }
  // Longer than any image that would be accepted: 16 bits a pixel and some header.
  constexpr std::size_t kMostBytes = 2 * kMostPixels + (1 << 20);
  std::vector<std::uint8_t> bytes;
  std::vector<char> piece(1 << 18);
  while (stream.read(piece.data(), static_cast<std::streamsize>(piece.size())),
         stream.gcount() > 0) {
    bytes.insert(bytes.end(), piece.data(), piece.data() + stream.gcount());
    if (bytes.size() > kMostBytes) return Unreadable("is too large for an image");
  }
  if (stream.bad()) return Unreadable("cannot be read");
  return ParseImage(bytes, expected);
}

PoseReason ReasonOf(ImageFileFailure failure) {
  switch (failure) {
    case ImageFileFailure::kMissing:
      return PoseReason::kFrameMissing;
    case ImageFileFailure::kUnreadable:
      return PoseReason::kFrameUnreadable;
    case ImageFileFailure::kSize:
      return PoseReason::kFrameSize;
  }
  return PoseReason::kFrameUnreadable;
}

}  // namespace tbm
