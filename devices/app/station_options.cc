#include "devices/app/station_options.h"

#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "devices/replay/csv.h"
#include "pose/base/angle.h"
#include "pose/base/parse_number.h"

namespace tbm {
namespace {

double ArcsecToRad(double angle_arcsec) { return DegToRad(angle_arcsec / 3600.0); }

std::chrono::nanoseconds Milliseconds(double span_ms) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(span_ms * 1e6));
}

std::vector<std::string_view> Split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

std::optional<double> Number(std::string_view text) {
  const auto number = ParseReal(text);
  return number && std::isfinite(*number) ? number : std::nullopt;
}

std::optional<std::vector<double>> Numbers(std::string_view text, std::size_t count) {
  const auto parts = Split(text, ',');
  if (parts.size() != count) return std::nullopt;
  std::vector<double> numbers;
  for (const std::string_view part : parts) {
    const auto number = Number(part);
    if (!number) return std::nullopt;
    numbers.push_back(*number);
  }
  return numbers;
}

struct Window {
  double from_s = 0.0;
  double to_s = 1e12;
  bool Contains(double t_s) const { return t_s >= from_s && t_s < to_s; }
};

// "WHAT" or "WHAT@FROM-TO".
struct Windowed {
  std::string_view what;
  Window window;
};
std::optional<Windowed> ParseWindowed(std::string_view text) {
  const std::size_t at = text.find('@');
  if (at == std::string_view::npos) return Windowed{text, {}};
  const auto limits = Split(text.substr(at + 1), '-');
  if (limits.size() != 2) return std::nullopt;
  const auto from = Number(limits[0]);
  const auto to = Number(limits[1]);
  if (!from || !to || *to <= *from) return std::nullopt;
  return Windowed{text.substr(0, at), {*from, *to}};
}

// Collects what is wrong, one a line, so that all is said at once.
class Reader {
 public:
  Reader(const StationOptions& options, std::vector<SimulatedPrism> prisms, Timestamp start)
      : o_(options), start_(start), prisms_(std::move(prisms)) {}

  Result<SimulatedStation, std::string> Read() {
    ReadPillar();
    ReadErrors();
    ReadPrismsInTime();
    ReadFaults();
    station_.emulator = o_.emulator;
    station_.emulator.distance_time = Milliseconds(o_.distance_ms);
    station_.emulator.recognition_time = Milliseconds(o_.recognition_ms);
    station_.emulator.turn_rad_per_s = DegToRad(o_.turn_deg_per_s);
    if (o_.has_no_checksum) station_.emulator.checksum = EmulatedChecksum::kRefused;
    if (!problems_.empty()) return Failure{problems_};
    return std::move(station_);
  }

 private:
  void Wrong(std::string_view option, std::string_view text, std::string_view wanted) {
    problems_ += fmt::format("--{} {}: wanted {}\n", option, text, wanted);
  }
  Eigen::Vector3d Vector(std::string_view option, const std::string& text) {
    const auto numbers = Numbers(text, 3);
    if (numbers) return {(*numbers)[0], (*numbers)[1], (*numbers)[2]};
    Wrong(option, text, "X,Y,Z such as 12.5,-3,0.25");
    return Eigen::Vector3d::Zero();
  }
  std::optional<std::size_t> Find(std::string_view name) const {
    for (std::size_t i = 0; i < prisms_.size(); ++i) {
      if (prisms_[i].name == name) return i;
    }
    return std::nullopt;
  }

  void ReadPillar() {
    EmulatedPillar& pillar = station_.instrument.pillar;
    pillar.p_in_site = Vector("station", o_.station);
    pillar.circle_zero_bearing_rad = DegToRad(o_.circle_zero_deg);
    pillar.lean_east_rad = ArcsecToRad(o_.lean_east_arcsec);
    pillar.lean_north_rad = ArcsecToRad(o_.lean_north_arcsec);
    pillar.since = start_;
    pillar.drift_m_per_s = Vector("drift", o_.drift_mm_per_h) * (1e-3 / 3600.0);
    pillar.drift_rad_per_s = ArcsecToRad(o_.drift_arcsec_per_h) / 3600.0;
    for (const std::string& text : o_.knocks) {
      const auto parts = Split(text, '@');
      const auto numbers = Numbers(parts[0], 4);
      const auto at_s = parts.size() == 2 ? Number(parts[1]) : std::nullopt;
      if (!numbers || !at_s) {
        Wrong("knock", text, "DX,DY,DZ,ARCSEC@AT in mm and seconds, such as 3,0,-1,5@60");
        continue;
      }
      const std::vector<double>& n = *numbers;
      pillar.knocks.push_back({start_ + Milliseconds(*at_s * 1e3),
                               1e-3 * Eigen::Vector3d(n[0], n[1], n[2]),
                               ArcsecToRad(n[3])});
    }
  }

  void ReadErrors() {
    EmulatedErrors& errors = station_.instrument.errors;
    errors = o_.errors;
    errors.angle_sigma_rad = ArcsecToRad(o_.angle_sigma_arcsec);
    errors.slope_sigma_m = o_.slope_sigma_mm * 1e-3;
    errors.collimation_rad = ArcsecToRad(o_.collimation_arcsec);
    errors.trunnion_rad = ArcsecToRad(o_.trunnion_arcsec);
    errors.index_rad = ArcsecToRad(o_.index_arcsec);
    errors.lateral_bend_rad_per_m = ArcsecToRad(o_.lateral_bend_arcsec_per_100m) / 100.0;
  }

  void ReadPrismsInTime() {
    struct Swap {
      std::size_t other;
      Window window;
    };
    std::vector<std::vector<Window>> hidden(prisms_.size());
    std::vector<std::vector<Swap>> swaps(prisms_.size());
    for (const std::string& text : o_.hidden) {
      const auto parsed = ParseWindowed(text);
      const auto prism = parsed ? Find(parsed->what) : std::nullopt;
      if (prism) {
        hidden[*prism].push_back(parsed->window);
      } else {
        Wrong("hide", text, "one prism by name, such as left or left@10-20");
      }
    }
    for (const std::string& text : o_.swaps) {
      const auto parsed = ParseWindowed(text);
      const auto names = Split(parsed ? parsed->what : std::string_view(), ',');
      const auto a = Find(names[0]);
      const auto b = names.size() == 2 ? Find(names[1]) : std::nullopt;
      if (a && b) {
        swaps[*a].push_back({*b, parsed->window});
        swaps[*b].push_back({*a, parsed->window});
      } else {
        Wrong("swap", text, "two prisms by name, such as left,right@10-20");
      }
    }
    for (std::size_t i = 0; i < prisms_.size(); ++i) {
      const auto in_time =
          [all = prisms_, i, hides = hidden[i], changes = swaps[i], start = start_](
              Timestamp at) -> std::optional<Eigen::Vector3d> {
        const double t_s = SecondsBetween(start, at);
        for (const Window& window : hides) {
          if (window.Contains(t_s)) return std::nullopt;
        }
        std::size_t place = i;
        for (const Swap& swap : changes) {
          if (swap.window.Contains(t_s)) place = swap.other;
        }
        return all[place].p_in_site(at);
      };
      station_.instrument.prisms.push_back({prisms_[i].name, in_time, prisms_[i].constant_m});
    }
  }

  void ReadFaults() {
    for (const std::string& text : o_.faults) {
      const auto parts = Split(text, ':');
      const auto kind = GeocomFaultFromWord(parts[0]);
      const double ratio = parts.size() >= 2 ? Number(parts[1]).value_or(-1.0) : -1.0;
      const std::int64_t code = parts.size() == 3 ? ParseInteger(parts[2]).value_or(-1) : 0;
      const bool needs_code =
          kind == GeocomFaultKind::kReturnCode || kind == GeocomFaultKind::kComCode;
      const bool is_whole = parts.size() == (needs_code ? 3u : 2u);
      if (!kind || !is_whole || ratio < 0.0 || ratio > 1.0 || code < 0 || code > 65535) {
        Wrong("fault",
              text,
              "KIND:RATIO such as late:0.05 or bit_error:0.01, or return_code:RATIO:CODE such as "
              "return_code:0.02:8710");
        continue;
      }
      station_.faults.push_back(
          {{*kind, -1, 0, Milliseconds(o_.late_ms), static_cast<int>(code)}, ratio});
    }
  }

  const StationOptions& o_;
  const Timestamp start_;
  std::vector<SimulatedPrism> prisms_;
  SimulatedStation station_;
  std::string problems_;
};

}  // namespace

void AddStationOptions(CLI::App& app, StationOptions& o) {
  const auto number = [&](const char* name, double& value, const char* help) {
    app.add_option(name, value, help)->capture_default_str();
  };
  app.add_option("--station", o.station, "X,Y,Z of the instrument in site [m]")
      ->capture_default_str();
  number("--circle-zero-deg", o.circle_zero_deg, "bearing of the circle's zero, from north");
  app.add_option("--drift", o.drift_mm_per_h, "X,Y,Z by which the pillar moves [mm/h]");
  number("--drift-arcsec-per-h", o.drift_arcsec_per_h, "by which it turns, clockwise");
  number("--lean-east-arcsec", o.lean_east_arcsec, "of the standing axis");
  number("--lean-north-arcsec", o.lean_north_arcsec, "of the standing axis");
  app.add_option("--knock", o.knocks, "DX,DY,DZ,ARCSEC@AT: the pillar jumps [mm], [s]");
  number("--angle-sigma-arcsec", o.angle_sigma_arcsec, "noise of a pointing, each axis");
  number("--slope-sigma-mm", o.slope_sigma_mm, "noise of a distance");
  number("--slope-sigma-ppm", o.errors.slope_sigma_ppm, "noise of a distance, with its length");
  number("--collimation-arcsec", o.collimation_arcsec, "error left in the instrument");
  number("--trunnion-arcsec", o.trunnion_arcsec, "error left in the instrument");
  number("--index-arcsec", o.index_arcsec, "error left in the instrument");
  number("--air-ppm", o.errors.air_ppm, "by which a raw distance is too short");
  number("--refraction-k", o.errors.refraction_k, "curvature of the sight over the earth's");
  number("--earth-radius-m", o.errors.earth_radius_m, "1e15: flat");
  number("--lateral-bend", o.lateral_bend_arcsec_per_100m, "to the right [arcsec per 100 m]");
  app.add_option("--serial-number", o.emulator.serial_number, "that it tells")
      ->capture_default_str();
  app.add_option("--battery", o.emulator.battery_percent, "charge [%]")
      ->capture_default_str()
      ->check(CLI::Range(0, 100));
  app.add_flag("--old", o.emulator.is_old, "knows only the calls of a TPS1100");
  app.add_flag("--no-checksum", o.has_no_checksum, "refuses lines with a checksum");
  number("--distance-ms", o.distance_ms, "that a distance takes");
  number("--recognition-ms", o.recognition_ms, "that finding a prism takes");
  number("--turn-deg-per-s", o.turn_deg_per_s, "how fast the telescope turns");
  app.add_option("--hide", o.hidden, "PRISM[@FROM-TO]; may be repeated");
  app.add_option("--swap", o.swaps, "PRISM,PRISM[@FROM-TO]: each stands where the other belongs");
  app.add_option("--fault", o.faults, "KIND:RATIO[:CODE] of the line; may be repeated");
  number("--late-ms", o.late_ms, "how late `late` is, and the pause of `split`");
}

Result<std::vector<SimulatedPrism>, std::string> ReadPrisms(const std::string& path,
                                                            std::string_view name_column,
                                                            Timestamp start) {
  auto text = ReadTextFile(path, 1 << 20);
  if (!text) return Failure{text.error().Text()};
  const std::array<std::string_view, 4> required = {name_column, "x_m", "y_m", "z_m"};
  const auto table = CsvTable::Parse(*text, path, required);
  if (!table) return Failure{table.error().Text()};
  std::optional<FileFault> fault;
  const auto value = [&](std::size_t row, std::string_view name) {
    const auto column = table->Column(name);
    if (!column) return 0.0;
    const auto number = table->Finite(row, *column);
    if (!number && !fault) fault = number.error();
    return number ? *number : 0.0;
  };
  const std::string_view constant =
      table->Column("prism_constant_mm") ? "prism_constant_mm" : "constant_mm";
  std::vector<SimulatedPrism> prisms;
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const Eigen::Vector3d p_in_site(value(row, "x_m"), value(row, "y_m"), value(row, "z_m"));
    const Eigen::Vector3d velocity_m_per_s =
        1e-3 * Eigen::Vector3d(
                   value(row, "vx_mm_per_s"), value(row, "vy_mm_per_s"), value(row, "vz_mm_per_s"));
    prisms.push_back({std::string(table->Field(row, *table->Column(name_column))),
                      [=](Timestamp at) -> Eigen::Vector3d {
                        return p_in_site + SecondsBetween(start, at) * velocity_m_per_s;
                      },
                      value(row, constant) * 1e-3});
  }
  if (fault) return Failure{fault->Text()};
  return prisms;
}

Result<SimulatedStation, std::string> BuildStation(const StationOptions& options,
                                                   std::vector<SimulatedPrism> prisms,
                                                   Timestamp start) {
  return Reader(options, std::move(prisms), start).Read();
}

}  // namespace tbm
