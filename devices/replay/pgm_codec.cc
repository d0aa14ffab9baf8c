#include <cstring>

#include <fmt/format.h>

#include "devices/replay/image_codec.h"

namespace tbm {
namespace {

bool IsBlank(std::uint8_t c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

// The header of a P5 file: numbers between blanks, `#` starts a comment until the end of the line.
class HeaderReader {
 public:
  explicit HeaderReader(std::span<const std::uint8_t> bytes) : bytes_(bytes), at_(2) {}

  std::optional<int> Number() {
    while (at_ < bytes_.size() && (IsBlank(bytes_[at_]) || bytes_[at_] == '#')) {
      if (bytes_[at_] == '#') {
        while (at_ < bytes_.size() && bytes_[at_] != '\n') ++at_;
      } else {
        ++at_;
      }
    }
    constexpr int kMost = 99'999'999;
    int number = 0;
    const std::size_t first = at_;
    for (; at_ < bytes_.size() && bytes_[at_] >= '0' && bytes_[at_] <= '9'; ++at_) {
      number = number * 10 + (bytes_[at_] - '0');
      if (number > kMost) return std::nullopt;
    }
    if (at_ == first) return std::nullopt;
    return number;
  }

  // One blank stands between the last number and the pixels.
  std::optional<std::span<const std::uint8_t>> Pixels() const {
    if (at_ >= bytes_.size() || !IsBlank(bytes_[at_])) return std::nullopt;
    return bytes_.subspan(at_ + 1);
  }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_;
};

}  // namespace

bool LooksLikePgm(std::span<const std::uint8_t> bytes) {
  return bytes.size() > 2 && bytes[0] == 'P' && bytes[1] == '5' && IsBlank(bytes[2]);
}

ImageResult ParsePgm(std::span<const std::uint8_t> bytes, std::optional<ImageSize> expected) {
  HeaderReader header(bytes);
  const auto width_px = header.Number();
  const auto height_px = header.Number();
  const auto max_value = header.Number();
  const auto pixels = header.Pixels();
  if (!width_px || !height_px || !max_value || !pixels)
    return Unreadable("PGM header is cut or wrong");
  if (*max_value < 1 || *max_value > 65535) return Unreadable("PGM full scale must be 1 .. 65535");
  if (auto fault = CheckSize(*width_px, *height_px, expected)) return Failure{std::move(*fault)};

  const int bytes_per_pixel = *max_value > 255 ? 2 : 1;
  const std::size_t wanted = static_cast<std::size_t>(*width_px) *
                             static_cast<std::size_t>(*height_px) *
                             static_cast<std::size_t>(bytes_per_pixel);
  if (pixels->size() != wanted) {
    return Unreadable(
        fmt::format("PGM holds {} bytes of pixels instead of {}", pixels->size(), wanted));
  }
  OwnedImage image =
      BlankImage({*width_px, *height_px}, bytes_per_pixel, static_cast<std::uint32_t>(*max_value));
  if (bytes_per_pixel == 1) {
    std::memcpy(image.bytes.data(), pixels->data(), wanted);
  } else {
    for (std::size_t i = 0; i < wanted; i += 2) {
      const auto pixel = static_cast<std::uint16_t>((*pixels)[i] << 8 | (*pixels)[i + 1]);
      std::memcpy(image.bytes.data() + i, &pixel, 2);
    }
  }
  return image;
}

std::vector<std::uint8_t> EncodePgm(const ImageView& image) {
  const std::string header =
      fmt::format("P5\n{} {}\n{}\n", image.width_px, image.height_px, image.max_value);
  const auto row_bytes =
      static_cast<std::size_t>(image.width_px) * static_cast<std::size_t>(image.bytes_per_pixel);
  std::vector<std::uint8_t> bytes(header.begin(), header.end());
  bytes.reserve(header.size() + row_bytes * static_cast<std::size_t>(image.height_px));
  const auto* row = static_cast<const std::uint8_t*>(image.pixels);
  for (int v = 0; v < image.height_px; ++v, row += image.stride_bytes) {
    if (image.bytes_per_pixel == 1) {
      bytes.insert(bytes.end(), row, row + row_bytes);
      continue;
    }
    for (std::size_t i = 0; i < row_bytes; i += 2) {
      std::uint16_t pixel = 0;
      std::memcpy(&pixel, row + i, 2);
      // A full scale of 255 or less makes one byte a pixel of it, whatever the memory had.
      if (image.max_value > 255) bytes.push_back(static_cast<std::uint8_t>(pixel >> 8));
      bytes.push_back(static_cast<std::uint8_t>(pixel & 0xff));
    }
  }
  return bytes;
}

}  // namespace tbm
