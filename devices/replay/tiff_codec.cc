#include <algorithm>
#include <bit>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>

#include <fmt/format.h>
#include <tiffio.h>

#include "devices/replay/image_codec.h"

namespace tbm {
namespace {

// A file in memory, as libtiff wants to see one.
struct MemoryFile {
  std::span<const std::uint8_t> bytes;
  std::uint64_t at = 0;
  std::string message;  // the first thing libtiff complains about
};

tmsize_t Read(thandle_t handle, void* to, tmsize_t count) {
  auto* file = static_cast<MemoryFile*>(handle);
  if (count <= 0 || file->at >= file->bytes.size()) return 0;
  const std::size_t left = file->bytes.size() - static_cast<std::size_t>(file->at);
  const std::size_t taken = std::min(left, static_cast<std::size_t>(count));
  std::memcpy(to, file->bytes.data() + file->at, taken);
  file->at += taken;
  return static_cast<tmsize_t>(taken);
}

tmsize_t Write(thandle_t, void*, tmsize_t) { return 0; }

toff_t Seek(thandle_t handle, toff_t offset, int whence) {
  auto* file = static_cast<MemoryFile*>(handle);
  const std::uint64_t base = whence == SEEK_CUR   ? file->at
                             : whence == SEEK_END ? file->bytes.size()
                                                  : 0;
  file->at = base + offset;
  return file->at;
}

int Close(thandle_t) { return 0; }

toff_t Size(thandle_t handle) { return static_cast<MemoryFile*>(handle)->bytes.size(); }

int KeepMessage(TIFF*, void* user, const char*, const char* format, va_list arguments) {
  auto* file = static_cast<MemoryFile*>(user);
  if (file->message.empty()) {
    char text[128] = {};
    std::vsnprintf(text, sizeof text, format, arguments);
    file->message = text;
  }
  return 1;
}

int Ignore(TIFF*, void*, const char*, const char*, va_list) { return 1; }

struct TiffCloser {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};
using TiffHandle = std::unique_ptr<TIFF, TiffCloser>;

TiffHandle Open(MemoryFile& file) {
  struct OptionsFree {
    void operator()(TIFFOpenOptions* options) const { TIFFOpenOptionsFree(options); }
  };
  const std::unique_ptr<TIFFOpenOptions, OptionsFree> options(TIFFOpenOptionsAlloc());
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), KeepMessage, &file);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), Ignore, nullptr);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), 2 * kMostPixels);
  // 'm': no memory mapping, all goes through Read.
  return TiffHandle(TIFFClientOpenExt(
      "image", "rm", &file, Read, Write, Seek, Close, Size, nullptr, nullptr, options.get()));
}

std::uint16_t Tag16(TIFF* tiff, std::uint32_t tag) {
  std::uint16_t value = 0;
  return TIFFGetFieldDefaulted(tiff, tag, &value) == 1 ? value : std::uint16_t{0};
}

// Empty when the layout is one that the decoder below can read.
std::string_view LayoutFault(TIFF* tiff) {
  const std::uint16_t bits = Tag16(tiff, TIFFTAG_BITSPERSAMPLE);
  if (Tag16(tiff, TIFFTAG_SAMPLESPERPIXEL) != 1 || (bits != 8 && bits != 16)) {
    return "is not an 8- or 16-bit grey TIFF";
  }
  std::uint16_t photometric = 0;
  if (TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &photometric) == 1 &&
      photometric != PHOTOMETRIC_MINISBLACK) {
    return "is a TIFF whose zero is not black; save it as plain grey";
  }
  if (Tag16(tiff, TIFFTAG_SAMPLEFORMAT) != SAMPLEFORMAT_UINT)
    return "is a TIFF of signed or real numbers";
  if (TIFFIsTiled(tiff) != 0) return "is a tiled TIFF; save it in strips";
  return {};
}

// MaxSampleValue of a 10- or 12-bit camera. Some programs write the brightest pixel of this very
// image there; that is not of the form 2^n - 1 but by chance, and is passed over.
std::uint32_t FullScale(TIFF* tiff, int bytes_per_pixel) {
  if (bytes_per_pixel == 1) return 255;
  std::uint16_t declared = 0;
  const bool is_there = TIFFGetField(tiff, TIFFTAG_MAXSAMPLEVALUE, &declared) == 1;
  return is_there && declared >= 255 && std::has_single_bit(declared + 1u) ? declared : 65535u;
}

}  // namespace

bool LooksLikeTiff(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 8) return false;
  const bool is_little = std::memcmp(bytes.data(), "II", 2) == 0 && bytes[3] == 0;
  const bool is_big = std::memcmp(bytes.data(), "MM", 2) == 0 && bytes[2] == 0;
  const std::uint8_t version = is_little ? bytes[2] : bytes[3];
  return (is_little || is_big) && (version == 42 || version == 43);
}

ImageResult ParseTiff(std::span<const std::uint8_t> bytes, std::optional<ImageSize> expected) {
  MemoryFile file{bytes, 0, {}};
  const TiffHandle tiff = Open(file);
  if (!tiff) return Unreadable("TIFF: " + file.message);

  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  TIFFGetField(tiff.get(), TIFFTAG_IMAGEWIDTH, &width_px);
  TIFFGetField(tiff.get(), TIFFTAG_IMAGELENGTH, &height_px);
  if (auto fault = CheckSize(width_px, height_px, expected)) return Failure{std::move(*fault)};
  if (const auto fault = LayoutFault(tiff.get()); !fault.empty())
    return Unreadable(std::string(fault));

  const int bytes_per_pixel = Tag16(tiff.get(), TIFFTAG_BITSPERSAMPLE) / 8;
  const std::uint32_t max_value = FullScale(tiff.get(), bytes_per_pixel);
  OwnedImage image = BlankImage(
      {static_cast<int>(width_px), static_cast<int>(height_px)}, bytes_per_pixel, max_value);
  const std::size_t row_bytes =
      static_cast<std::size_t>(width_px) * static_cast<std::size_t>(bytes_per_pixel);
  if (static_cast<std::size_t>(TIFFScanlineSize64(tiff.get())) != row_bytes) {
    return Unreadable("TIFF: its rows have an odd length");
  }
  for (std::uint32_t v = 0; v < height_px; ++v) {
    if (TIFFReadScanline(tiff.get(), image.bytes.data() + v * row_bytes, v) != 1) {
      return Unreadable(fmt::format("TIFF: row {}: {}", v, file.message));
    }
  }
  return image;
}

}  // namespace tbm
