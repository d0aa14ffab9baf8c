#include "devices/replay/image_file.h"

#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>
#include <tiffio.h>

#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::Random;
using test::TempFolder;

OwnedImage Noise(ImageSize size, int bytes_per_pixel, std::uint32_t max_value, Random& random) {
  OwnedImage image{size, bytes_per_pixel, max_value, {}};
  const auto count =
      static_cast<std::size_t>(size.width_px) * static_cast<std::size_t>(size.height_px);
  image.bytes.resize(count * static_cast<std::size_t>(bytes_per_pixel));
  for (std::size_t i = 0; i < count; ++i) {
    const auto value = static_cast<std::uint16_t>(random.Bits() % (max_value + 1));
    std::memcpy(image.bytes.data() + i * static_cast<std::size_t>(bytes_per_pixel),
                &value,
                static_cast<std::size_t>(bytes_per_pixel));
  }
  return image;
}

void ExpectSame(const ImageResult& read, const OwnedImage& image) {
  ASSERT_TRUE(read.has_value()) << read.error().what;
  EXPECT_EQ(read->size, image.size);
  EXPECT_EQ(read->bytes_per_pixel, image.bytes_per_pixel);
  EXPECT_EQ(read->max_value, image.max_value);
  EXPECT_EQ(read->bytes, image.bytes);
}

// Written by libtiff itself into a file: the reader under test works from memory.
std::vector<std::uint8_t> TiffOf(const OwnedImage& image, int compression, bool is_big_endian) {
  const TempFolder folder;
  const std::string path = folder / "i.tif";
  TIFF* tiff = TIFFOpen(path.c_str(), is_big_endian ? "wb" : "wl");
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, image.size.width_px);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, image.size.height_px);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, image.bytes_per_pixel * 8);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, compression);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 3);
  if (image.max_value == 4095) TIFFSetField(tiff, TIFFTAG_MAXSAMPLEVALUE, 4095);
  const std::size_t row_bytes = image.bytes.size() / static_cast<std::size_t>(image.size.height_px);
  std::vector<std::uint8_t> row(row_bytes);
  for (int v = 0; v < image.size.height_px; ++v) {
    std::memcpy(
        row.data(), image.bytes.data() + static_cast<std::size_t>(v) * row_bytes, row_bytes);
    TIFFWriteScanline(tiff, row.data(), static_cast<std::uint32_t>(v), 0);
  }
  TIFFClose(tiff);
  const std::string bytes = test::ReadText(path);
  return {bytes.begin(), bytes.end()};
}

// A colour or palette image, or an interlaced one, by libpng's simple writer.
std::vector<std::uint8_t> ForeignPng(png_uint_32 format, int channels) {
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  image.width = 4;
  image.height = 3;
  image.format = format;
  const std::vector<std::uint8_t> pixels(static_cast<std::size_t>(4 * 3 * channels), 77);
  png_alloc_size_t size = 0;
  png_image_write_to_memory(&image, nullptr, &size, 0, pixels.data(), 0, nullptr);
  std::vector<std::uint8_t> bytes(size);
  png_image_write_to_memory(&image, bytes.data(), &size, 0, pixels.data(), 0, nullptr);
  return bytes;
}

struct Depth {
  int bytes_per_pixel;
  std::uint32_t max_value;
};
constexpr Depth kDepths[] = {{1, 255}, {2, 65535}, {2, 4095}, {2, 1023}};

TEST(ImageFile, PgmAndPngGiveBackWhatWasWritten) {
  Random random("ImageFile.PgmAndPngGiveBackWhatWasWritten");
  for (const Depth& depth : kDepths) {
    const OwnedImage image = Noise({37, 11}, depth.bytes_per_pixel, depth.max_value, random);
    ExpectSame(ParseImage(EncodePgm(image.View())), image);
    const auto png = EncodePng(image.View());
    ASSERT_TRUE(png.has_value());
    ExpectSame(ParseImage(*png), image);
  }
}

TEST(ImageFile, PgmKeepsAnOddFullScaleThatPngRefuses) {
  Random random("ImageFile.PgmKeepsAnOddFullScaleThatPngRefuses");
  const OwnedImage image = Noise({5, 4}, 2, 3000, random);
  ExpectSame(ParseImage(EncodePgm(image.View())), image);
  EXPECT_FALSE(EncodePng(image.View()).has_value());
}

TEST(ImageFile, WritersHonourTheStride) {
  Random random("ImageFile.WritersHonourTheStride");
  const OwnedImage whole = Noise({16, 8}, 1, 255, random);
  ImageView part = whole.View();
  part.width_px = 5;
  OwnedImage expected{{5, 8}, 1, 255, {}};
  for (std::size_t v = 0; v < 8; ++v) {
    expected.bytes.insert(expected.bytes.end(), &whole.bytes[v * 16], &whole.bytes[v * 16] + 5);
  }
  ExpectSame(ParseImage(EncodePgm(part)), expected);
  ExpectSame(ParseImage(*EncodePng(part)), expected);
}

TEST(ImageFile, ReadsTiffOfBothByteOrdersPlainAndCompressed) {
  Random random("ImageFile.ReadsTiffOfBothByteOrdersPlainAndCompressed");
  for (const Depth& depth : {kDepths[0], kDepths[1], kDepths[2]}) {
    const OwnedImage image = Noise({21, 10}, depth.bytes_per_pixel, depth.max_value, random);
    for (const int compression : {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE}) {
      for (const bool is_big_endian : {false, true}) {
        ExpectSame(ParseImage(TiffOf(image, compression, is_big_endian)), image);
      }
    }
  }
}

TEST(ImageFile, ReadsPgmWithComments) {
  const std::string text = "P5 # by hand\n# more\n 3\t2 #w h\n255\n";
  std::vector<std::uint8_t> bytes(text.begin(), text.end());
  for (std::uint8_t i = 0; i < 6; ++i) bytes.push_back(i);
  ExpectSame(ParseImage(bytes), OwnedImage{{3, 2}, 1, 255, {0, 1, 2, 3, 4, 5}});
}

TEST(ImageFile, EachFaultHasItsOwnReason) {
  const TempFolder folder;
  const auto reason = [&](const std::string& path) {
    const auto image = ReadImageFile(path, ImageSize{4, 3});
    EXPECT_FALSE(image.has_value());
    return ReasonOf(image.error().failure);
  };
  EXPECT_EQ(reason(folder / "absent.png"), PoseReason::kFrameMissing);
  test::WriteText(folder / "empty.png", "");
  EXPECT_EQ(reason(folder / "empty.png"), PoseReason::kFrameUnreadable);
  test::WriteText(folder / "text.png", "this is no picture");
  EXPECT_EQ(reason(folder / "text.png"), PoseReason::kFrameUnreadable);
  EXPECT_EQ(reason(folder.path()), PoseReason::kFrameUnreadable);
  test::WriteText(folder / "small.pgm", "P5\n2 2\n255\nabcd");
  EXPECT_EQ(reason(folder / "small.pgm"), PoseReason::kFrameSize);
}

TEST(ImageFile, RefusesColourAndPalette) {
  for (const auto& png : {ForeignPng(PNG_FORMAT_RGB, 3),
                          ForeignPng(PNG_FORMAT_RGBA, 4),
                          ForeignPng(PNG_FORMAT_GA, 2)}) {
    const auto image = ParseImage(png);
    ASSERT_FALSE(image.has_value());
    EXPECT_EQ(image.error().failure, ImageFileFailure::kUnreadable);
    EXPECT_THAT(image.error().what, ::testing::HasSubstr("grey"));
  }
  ASSERT_TRUE(ParseImage(ForeignPng(PNG_FORMAT_GRAY, 1)).has_value());
}

TEST(ImageFile, AHugePromiseIsRefusedBeforeMemoryIsTaken) {
  for (const std::string text : {"P5 99999999 99999999 255\n",
                                 "P5 60000 60000 65535\n",
                                 "P5 0 5 255\n",
                                 "P5 5 0 255\n",
                                 "P5 123456789012 5 255\n",
                                 "P5 4 3 70000\n",
                                 "P5 4 3 0\n",
                                 "P5 4 3",
                                 "P5 4"}) {
    const std::vector<std::uint8_t> bytes(text.begin(), text.end());
    EXPECT_FALSE(ParseImage(bytes).has_value()) << text;
  }
}

class ImageBytes : public ::testing::Test {
 protected:
  std::vector<std::vector<std::uint8_t>> Samples(Random& random) {
    const OwnedImage grey8 = Noise({13, 9}, 1, 255, random);
    const OwnedImage grey16 = Noise({13, 9}, 2, 4095, random);
    return {EncodePgm(grey8.View()),
            EncodePgm(grey16.View()),
            *EncodePng(grey8.View()),
            *EncodePng(grey16.View()),
            TiffOf(grey8, COMPRESSION_LZW, false),
            TiffOf(grey16, COMPRESSION_NONE, true)};
  }
};

TEST_F(ImageBytes, CutAtEveryLengthIsNeverAnImage) {
  Random random("ImageBytes.CutAtEveryLengthIsNeverAnImage");
  const auto samples = Samples(random);
  for (std::size_t s = 0; s < samples.size(); ++s) {
    for (std::size_t size = 0; size < samples[s].size(); ++size) {
      const auto image = ParseImage(std::span(samples[s]).first(size));
      // libtiff finds all pixels of a file whose directory is followed by padding only.
      if (image.has_value()) {
        EXPECT_GE(s, 4u) << size;
        EXPECT_EQ(image->bytes, ParseImage(samples[s])->bytes);
      }
    }
  }
}

TEST_F(ImageBytes, OneBitFlippedIsAnImageOfTheSizeOrAReason) {
  Random random("ImageBytes.OneBitFlippedIsAnImageOfTheSizeOrAReason");
  for (const auto& sample : Samples(random)) {
    for (std::size_t at = 0; at < sample.size(); ++at) {
      auto flipped = sample;
      flipped[at] = static_cast<std::uint8_t>(flipped[at] ^ (1u << (at % 8)));
      const auto image = ParseImage(flipped, ImageSize{13, 9});
      if (!image) continue;
      EXPECT_EQ(image->size, (ImageSize{13, 9}));
      EXPECT_EQ(image->bytes.size(), 13u * 9u * static_cast<std::size_t>(image->bytes_per_pixel));
    }
  }
}

TEST_F(ImageBytes, GarbageBeforeIsNoImage) {
  Random random("ImageBytes.GarbageBeforeIsNoImage");
  for (auto sample : Samples(random)) {
    sample.insert(sample.begin(), {0x00, 0x17, 0xff});
    EXPECT_FALSE(ParseImage(sample).has_value());
  }
}

TEST_F(ImageBytes, TwoGluedPgmAreRefused) {
  Random random("ImageBytes.TwoGluedPgmAreRefused");
  auto pgm = Samples(random)[0];
  const auto copy = pgm;
  pgm.insert(pgm.end(), copy.begin(), copy.end());
  EXPECT_FALSE(ParseImage(pgm).has_value());
}

}  // namespace
}  // namespace tbm
