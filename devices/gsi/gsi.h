#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "devices/replay/csv.h"
#include "pose/base/result.h"

namespace tbm {

// One word of a Leica GSI block: `81..00+00030485` (GSI-8) or with 16 data characters (GSI-16).
struct GsiWord {
  int index = 0;    // 11 point, 21 Hz, 22 V, 31 slope distance, 81 82 83 east north height
  char unit = '.';  // character 6; a digit for measured values
  bool is_negative = false;
  std::string_view data;  // 8 or 16 characters as they stand, blanks at the end taken away
  int position = 1;       // of its first character in the line, 1 is the first
};

struct GsiBlock {
  int line = 0;
  std::vector<GsiWord> words;

  const GsiWord* Find(int index) const;
};

// All blocks of a file. GSI-8 and GSI-16 (blocks that begin with `*`) may be mixed; point names may
// hold blanks and odd characters; the last line may lack its end. The words point into `text`.
Result<std::vector<GsiBlock>, FileFault> ParseGsi(std::string_view text, const std::string& file);

// Whether the first line that is not empty looks like a GSI block.
bool LooksLikeGsi(std::string_view text);

// A length in metres, by the word's own unit digit (each word has its own): 0 mm, 1 ft/1000,
// 6 mm/10, 7 ft/10000, 8 mm/100. Feet are international (0.3048 m). Empty when the unit is not one
// of lengths or the data are not digits.
std::optional<double> GsiLengthM(const GsiWord& word);

// An angle in radians: unit 2 gon/100000, 3 degrees/100000, 4 dddmmsss (tenths of a second),
// 5 mil/10000 (6400 to the circle).
std::optional<double> GsiAngleRad(const GsiWord& word);

// What a block says about one point, in metres: 81, 82, 83 when it has them, else from 21, 22, 31
// (Hz, zenith angle, slope distance; 84 to 88 added where they stand: station, reflector and
// instrument height).
struct GsiPoint {
  std::string name;  // without leading zeros
  double east_m = 0.0;
  double north_m = 0.0;
  double height_m = 0.0;
};

// Empty for blocks that hold no coordinates (station set-up, codes, remarks); an error for those
// that hold some but not in a usable form.
Result<std::optional<GsiPoint>, FileFault> PointOf(const GsiBlock& block, const std::string& file);

// "0001" and "1" are one point to a total station.
std::string_view WithoutLeadingZeros(std::string_view name);

}  // namespace tbm
