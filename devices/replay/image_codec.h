#pragma once

#include "devices/replay/image_file.h"

namespace tbm {

// What the three decoders share. Used by image_file.cc only.
inline constexpr std::int64_t kMostPixels = 64'000'000;

ImageResult Unreadable(std::string what);

// Refuses sizes that are not `expected` or that no camera has; empty when the size is fine.
std::optional<ImageFileFault> CheckSize(std::int64_t width_px,
                                        std::int64_t height_px,
                                        std::optional<ImageSize> expected);

OwnedImage BlankImage(ImageSize size, int bytes_per_pixel, std::uint32_t max_value);

bool LooksLikePgm(std::span<const std::uint8_t> bytes);
bool LooksLikePng(std::span<const std::uint8_t> bytes);
bool LooksLikeTiff(std::span<const std::uint8_t> bytes);
ImageResult ParsePgm(std::span<const std::uint8_t> bytes, std::optional<ImageSize> expected);
ImageResult ParsePng(std::span<const std::uint8_t> bytes, std::optional<ImageSize> expected);
ImageResult ParseTiff(std::span<const std::uint8_t> bytes, std::optional<ImageSize> expected);

}  // namespace tbm
