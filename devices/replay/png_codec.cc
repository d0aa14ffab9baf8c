#include <bit>
#include <csetjmp>
#include <cstring>

#include <fmt/format.h>
#include <png.h>

#include "devices/replay/image_codec.h"

namespace tbm {
namespace {

// libpng reports errors by longjmp, which must not cross a destructor. So everything that owns
// memory lives in these structs, made by a caller further up, and the functions that set the jump
// hold nothing but pointers and numbers.
struct DecodeState {
  std::span<const std::uint8_t> rest;
  std::optional<ImageSize> expected;
  OwnedImage image;
  std::optional<ImageFileFault> fault;
  char message[128] = {};
  png_structp png = nullptr;
  png_infop info = nullptr;

  ~DecodeState() { png_destroy_read_struct(&png, &info, nullptr); }
};

struct EncodeState {
  ImageView image;
  std::vector<std::uint8_t> bytes;
  std::vector<std::uint16_t> row;
  char message[128] = {};
  png_structp png = nullptr;
  png_infop info = nullptr;

  ~EncodeState() { png_destroy_write_struct(&png, &info); }
};

template <class State>
[[noreturn]] void OnError(png_structp png, png_const_charp message) {
  auto* state = static_cast<State*>(png_get_error_ptr(png));
  std::strncpy(state->message, message, sizeof state->message - 1);
  png_longjmp(png, 1);
}

void OnWarning(png_structp, png_const_charp) {}

void ReadBytes(png_structp png, png_bytep to, std::size_t count) {
  auto* state = static_cast<DecodeState*>(png_get_io_ptr(png));
  if (count > state->rest.size()) png_error(png, "the file is cut short");
  std::memcpy(to, state->rest.data(), count);
  state->rest = state->rest.subspan(count);
}

void WriteBytes(png_structp png, png_bytep from, std::size_t count) {
  auto* state = static_cast<EncodeState*>(png_get_io_ptr(png));
  state->bytes.insert(state->bytes.end(), from, from + count);
}

void Flush(png_structp) {}

// Full scale and the shift that brings the pixels to it: cameras of 10 or 12 bits are stored scaled
// up to 16, with the true number of bits in sBIT.
struct Depth {
  int bytes_per_pixel = 1;
  std::uint32_t max_value = 255;
  int shift = 0;
};

Depth DepthOf(png_structp png, png_infop info) {
  const int bits = png_get_bit_depth(png, info);
  png_color_8p significant = nullptr;
  int used = bits;
  if (png_get_sBIT(png, info, &significant) != 0 && significant != nullptr &&
      significant->gray > 0 && significant->gray < bits && bits == 16) {
    used = significant->gray;
  }
  return {bits / 8, (1u << used) - 1u, bits - used};
}

// False and state.fault set when the header is of no image that is wanted here.
[[gnu::noinline]] bool AcceptHeader(DecodeState& state) {
  if (png_get_color_type(state.png, state.info) != PNG_COLOR_TYPE_GRAY ||
      png_get_bit_depth(state.png, state.info) < 8) {
    state.fault =
        ImageFileFault{ImageFileFailure::kUnreadable,
                       "is a colour, palette or less than 8-bit PNG; wanted is 8- or 16-bit grey"};
    return false;
  }
  const auto width_px = png_get_image_width(state.png, state.info);
  const auto height_px = png_get_image_height(state.png, state.info);
  state.fault = CheckSize(width_px, height_px, state.expected);
  if (state.fault) return false;
  const Depth depth = DepthOf(state.png, state.info);
  state.image = BlankImage({static_cast<int>(width_px), static_cast<int>(height_px)},
                           depth.bytes_per_pixel,
                           depth.max_value);
  return true;
}

bool Decode(DecodeState& state) {
  state.png =
      png_create_read_struct(PNG_LIBPNG_VER_STRING, &state, OnError<DecodeState>, OnWarning);
  if (state.png == nullptr) return false;
  state.info = png_create_info_struct(state.png);
  if (state.info == nullptr) return false;
  if (setjmp(png_jmpbuf(state.png)) != 0) return false;
  // Text and colour profiles of any size are none of our business.
  png_set_chunk_malloc_max(state.png, 1 << 20);
  png_set_read_fn(state.png, &state, ReadBytes);
  png_read_info(state.png, state.info);
  if (!AcceptHeader(state)) return false;
  if (state.image.bytes_per_pixel == 2 && std::endian::native == std::endian::little) {
    png_set_swap(state.png);
  }
  const int passes = png_set_interlace_handling(state.png);
  png_read_update_info(state.png, state.info);
  const std::size_t row_bytes = png_get_rowbytes(state.png, state.info);
  const auto rows = static_cast<std::size_t>(state.image.size.height_px);
  if (row_bytes * rows != state.image.bytes.size()) return false;
  for (int pass = 0; pass < passes; ++pass) {
    for (std::size_t v = 0; v < rows; ++v) {
      png_read_row(state.png, state.image.bytes.data() + v * row_bytes, nullptr);
    }
  }
  // The end chunk too: a file cut after the last pixel has lost something and says so.
  png_read_end(state.png, nullptr);
  return true;
}

void ShiftDown(OwnedImage& image, int shift) {
  for (std::size_t i = 0; i + 1 < image.bytes.size(); i += 2) {
    std::uint16_t pixel = 0;
    std::memcpy(&pixel, image.bytes.data() + i, 2);
    pixel = static_cast<std::uint16_t>(pixel >> shift);
    std::memcpy(image.bytes.data() + i, &pixel, 2);
  }
}

bool Encode(EncodeState& state, int bits, int bits_used, int png_effort) {
  state.png =
      png_create_write_struct(PNG_LIBPNG_VER_STRING, &state, OnError<EncodeState>, OnWarning);
  if (state.png == nullptr) return false;
  state.info = png_create_info_struct(state.png);
  if (state.info == nullptr) return false;
  if (setjmp(png_jmpbuf(state.png)) != 0) return false;
  png_set_write_fn(state.png, &state, WriteBytes, Flush);
  png_set_compression_level(state.png, png_effort);
  png_set_filter(state.png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_set_IHDR(state.png,
               state.info,
               static_cast<png_uint_32>(state.image.width_px),
               static_cast<png_uint_32>(state.image.height_px),
               bits,
               PNG_COLOR_TYPE_GRAY,
               PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  if (bits_used < bits) {
    png_color_8 significant = {};
    significant.gray = static_cast<png_byte>(bits_used);
    png_set_sBIT(state.png, state.info, &significant);
  }
  png_write_info(state.png, state.info);
  if (bits == 16 && std::endian::native == std::endian::little) png_set_swap(state.png);
  const auto* row = static_cast<const std::uint8_t*>(state.image.pixels);
  for (int v = 0; v < state.image.height_px; ++v, row += state.image.stride_bytes) {
    if (bits == 8) {
      png_write_row(state.png, row);
      continue;
    }
    std::memcpy(state.row.data(), row, state.row.size() * 2);
    for (std::uint16_t& pixel : state.row)
      pixel = static_cast<std::uint16_t>(pixel << (bits - bits_used));
    png_write_row(state.png, reinterpret_cast<png_const_bytep>(state.row.data()));
  }
  png_write_end(state.png, state.info);
  return true;
}

}  // namespace

bool LooksLikePng(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= 8 && png_sig_cmp(bytes.data(), 0, 8) == 0;
}

ImageResult ParsePng(std::span<const std::uint8_t> bytes, std::optional<ImageSize> expected) {
  DecodeState state;
  state.rest = bytes;
  state.expected = expected;
  if (!Decode(state)) {
    if (state.fault) return Failure{std::move(*state.fault)};
    return Unreadable(
        fmt::format("PNG: {}", state.message[0] != 0 ? state.message : "cannot be decoded"));
  }
  const Depth depth = DepthOf(state.png, state.info);
  if (depth.shift > 0) ShiftDown(state.image, depth.shift);
  return std::move(state.image);
}

std::optional<std::vector<std::uint8_t>> EncodePng(const ImageView& image, int png_effort) {
  const int bits = image.bytes_per_pixel * 8;
  const auto bits_used = static_cast<int>(std::bit_width(image.max_value));
  const bool is_power = image.max_value == (1u << bits_used) - 1u;
  if (!is_power || bits_used > bits || (bits == 8 && bits_used < 8)) return std::nullopt;
  EncodeState state;
  state.image = image;
  state.row.resize(static_cast<std::size_t>(image.width_px));
  if (!Encode(state, bits, bits_used, png_effort)) return std::nullopt;
  return std::move(state.bytes);
}

}  // namespace tbm
