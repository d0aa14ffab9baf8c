#include "devices/gsi/gsi_writer.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include <fmt/format.h>

namespace tbm {
namespace {

constexpr double kFullCircle = 2.0 * std::numbers::pi;

struct Unit {
  char digit;
  double per_si;  // counts to the metre or to the radian
};

Unit UnitOf(GsiLengthUnit unit) {
  switch (unit) {
    case GsiLengthUnit::kMm:
      return {'0', 1e3};
    case GsiLengthUnit::kTenthMm:
      return {'6', 1e4};
    case GsiLengthUnit::kHundredthMm:
      return {'8', 1e5};
  }
  return {'0', 1e3};
}

Unit UnitOf(GsiAngleUnit unit) {
  switch (unit) {
    case GsiAngleUnit::kGon:
      return {'2', 400e5 / kFullCircle};
    case GsiAngleUnit::kDegree:
      return {'3', 360e5 / kFullCircle};
    case GsiAngleUnit::kSexagesimal:
      return {'4', 360.0 * 36000.0 / kFullCircle};  // tenths of a second
    case GsiAngleUnit::kMil:
      return {'5', 6400e4 / kFullCircle};
  }
  return {'2', 400e5 / kFullCircle};
}

// One line being written. The first thing that has no place ends it.
class LineWriter {
 public:
  explicit LineWriter(const GsiFormat& format)
      : format_(format), digits_(format.width == GsiWidth::kGsi8 ? 8 : 16) {
    if (format.width == GsiWidth::kGsi16) line_ = "*";
  }

  void Name(const std::string& name, int block_number) {
    const auto is_fine = [](char c) { return c >= 0x20 && c != 0x7f; };
    if (name.empty() || name.size() > digits_ || name.ends_with(' ') ||
        !std::ranges::all_of(name, is_fine)) {
      return Refuse(
          fmt::format("point name \"{}\": wanted 1 to {} characters without a blank at the end",
                      name,
                      digits_));
    }
    Word(fmt::format("11{:04}", block_number), false, fmt::format("{:0>{}}", name, digits_));
  }

  void Length(int index, const char* what, const std::optional<double>& value_m) {
    if (!value_m) return;
    const Unit unit = UnitOf(format_.length_unit);
    if (const auto counts = Counts(*value_m * unit.per_si, what)) {
      Word(fmt::format("{}...{}", index, unit.digit), *counts < 0, Padded(std::abs(*counts)));
    }
  }

  void Angle(int index, const char* what, const std::optional<double>& value_rad) {
    if (!value_rad) return;
    if (!std::isfinite(*value_rad)) return Refuse(fmt::format("{}: is not a number", what));
    const Unit unit = UnitOf(format_.angle_unit);
    const auto circle = std::llround(kFullCircle * unit.per_si);
    std::int64_t counts = std::llround(std::remainder(*value_rad, kFullCircle) * unit.per_si);
    if (counts < 0) counts += circle;
    if (format_.angle_unit == GsiAngleUnit::kSexagesimal) {
      const std::int64_t minutes = counts / 600;
      counts = (minutes / 60 * 100 + minutes % 60) * 1000 + counts % 600;
    }
    Word(fmt::format("{}...{}", index, unit.digit), false, Padded(counts));
  }

  void PpmAndConstant(const std::optional<double>& ppm, const std::optional<double>& constant_m) {
    if (!ppm && !constant_m) return;
    const auto whole_ppm = Counts(ppm.value_or(0.0), "ppm");
    const auto whole_mm = Counts(constant_m.value_or(0.0) * 1e3, "prism constant");
    if (!whole_ppm || !whole_mm) return;
    const std::size_t ppm_digits = digits_ - 4;
    if (std::abs(*whole_ppm) > 9999) return Refuse("ppm: wanted -9999 to 9999");
    if (std::abs(*whole_mm) > 999) return Refuse("prism constant: wanted -0.999 m to 0.999 m");
    Word("51....",
         *whole_ppm < 0,
         fmt::format("{:0{}}{}{:03}",
                     std::abs(*whole_ppm),
                     ppm_digits,
                     *whole_mm < 0 ? '-' : '+',
                     std::abs(*whole_mm)));
    if (!constant_m) return;
    if (const auto tenths = Counts(*constant_m * 1e4, "prism constant")) {
      Word("58...6", *tenths < 0, Padded(std::abs(*tenths)));
    }
  }

  Result<std::string, std::string> Take() && {
    if (!problem_.empty()) return Failure{problem_};
    return line_ + "\r\n";
  }

 private:
  void Refuse(std::string problem) {
    if (problem_.empty()) problem_ = std::move(problem);
  }
  std::optional<std::int64_t> Counts(double counts, const char* what) {
    const double most = std::pow(10.0, static_cast<double>(digits_)) - 1.0;
    if (!std::isfinite(counts)) {
      Refuse(fmt::format("{}: is not a number", what));
    } else if (std::abs(counts) > most) {
      Refuse(
          fmt::format("{}: {} digits are not enough; {}",
                      what,
                      digits_,
                      digits_ == 8 ? "wanted GSI-16, or a coarser unit" : "wanted a coarser unit"));
    } else {
      return std::llround(counts);
    }
    return std::nullopt;
  }
  std::string Padded(std::int64_t counts) const { return fmt::format("{:0{}}", counts, digits_); }
  void Word(const std::string& head, bool is_negative, const std::string& data) {
    line_ += head + (is_negative ? "-" : "+") + data + " ";
  }

  const GsiFormat format_;
  const std::size_t digits_;
  std::string line_;
  std::string problem_;
};

}  // namespace

Result<std::string, std::string> GsiLine(const GsiRecord& record,
                                         int block_number,
                                         const GsiFormat& format) {
  LineWriter writer(format);
  writer.Name(record.point, (block_number - 1) % 9999 + 1);
  writer.Angle(21, "horizontal angle", record.horizontal_rad);
  writer.Angle(22, "zenith angle", record.zenith_rad);
  writer.Length(31, "slope distance", record.slope_m);
  writer.PpmAndConstant(record.ppm, record.prism_constant_m);
  writer.Length(81, "east", record.east_m);
  writer.Length(82, "north", record.north_m);
  writer.Length(83, "height", record.height_m);
  writer.Length(84, "east of the station", record.station_east_m);
  writer.Length(85, "north of the station", record.station_north_m);
  writer.Length(86, "height of the station", record.station_height_m);
  writer.Length(87, "reflector height", record.reflector_height_m);
  writer.Length(88, "instrument height", record.instrument_height_m);
  return std::move(writer).Take();
}

}  // namespace tbm
