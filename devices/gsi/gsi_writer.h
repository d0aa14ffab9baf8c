#pragma once

#include <optional>
#include <string>

#include "pose/base/result.h"

namespace tbm {

enum class GsiWidth {
  kGsi8,   // 8 data characters: lengths end at 99 999.999 m
  kGsi16,  // 16 data characters, blocks begin with '*'
};
enum class GsiLengthUnit { kMm, kTenthMm, kHundredthMm };
enum class GsiAngleUnit {
  kGon,          // 1e-5 gon: 1.6e-7 rad
  kDegree,       // 1e-5 degree: 1.7e-7 rad
  kSexagesimal,  // 0.1": 4.8e-7 rad
  kMil,          // 1e-4 of 6400 to the circle: 9.8e-8 rad
};

struct GsiFormat {
  GsiWidth width = GsiWidth::kGsi16;
  GsiLengthUnit length_unit = GsiLengthUnit::kHundredthMm;
  GsiAngleUnit angle_unit = GsiAngleUnit::kGon;
};

// One block: a point and what is known about it. Words of absent values are not written.
struct GsiRecord {
  std::string point;
  std::optional<double> horizontal_rad;       // 21, written in 0 .. full circle
  std::optional<double> zenith_rad;           // 22, the same
  std::optional<double> slope_m;              // 31
  std::optional<double> ppm;                  // 51, whole ppm, with the prism constant
  std::optional<double> prism_constant_m;     // 51, whole mm; 58, tenths of mm
  std::optional<double> east_m;               // 81
  std::optional<double> north_m;              // 82
  std::optional<double> height_m;             // 83
  std::optional<double> station_east_m;       // 84
  std::optional<double> station_north_m;      // 85
  std::optional<double> station_height_m;     // 86
  std::optional<double> reflector_height_m;   // 87
  std::optional<double> instrument_height_m;  // 88

  bool operator==(const GsiRecord&) const = default;
};

// The record as the line of a Leica GSI file, with CR LF. `block_number` goes from 1 and wraps at
// 9999. The error says which value has no place in this format and what would be right: nothing is
// cut off or rounded beyond the format's last digit.
Result<std::string, std::string> GsiLine(const GsiRecord& record,
                                         int block_number,
                                         const GsiFormat& format);

}  // namespace tbm
