#include "guidance/app/geometry_command.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <string_view>

#include <fmt/format.h>

#include "guidance/app/line_file.h"
#include "guidance/app/output_file.h"
#include "guidance/rail/line_places.h"
#include "guidance/rail/track_geometry.h"

namespace tbm {
namespace {

constexpr double kLeastStep_m = 0.05;
constexpr double kMostStep_m = 0.5;
constexpr double kLongest_m = 1e6;

std::optional<std::string> OptionFault(const GeometryRequest& request) {
  if (!(request.step_m >= kLeastStep_m && request.step_m <= kMostStep_m)) {
    return fmt::format(
        "--step {}: must lie between {} and {} m", request.step_m, kLeastStep_m, kMostStep_m);
  }
  if (!(request.gauge_mm >= 100.0 && request.gauge_mm <= 10000.0)) {
    return fmt::format("--gauge-mm {}: must lie between 100 and 10000 mm, such as 1435",
                       request.gauge_mm);
  }
  std::set<double> bases_m;
  for (const double base_m : request.bases_m) {
    if (!(base_m >= 2.0 * request.step_m && base_m <= 100.0)) {
      return fmt::format(
          "--bases: {} must lie between two steps ({} m) and 100 m", base_m, 2.0 * request.step_m);
    }
    if (!bases_m.insert(base_m).second) return fmt::format("--bases: {} stands twice", base_m);
  }
  return std::nullopt;
}

std::string Field(const std::optional<double>& value) {
  return value ? fmt::format(",{:.4f}", 1e3 * *value) : ",";
}

std::string Table(const std::vector<TrackPlace>& places, const GeometryRequest& request) {
  std::string text =
      "distance_m,level_d1_mm,level_d2_mm,alignment_d1_mm,alignment_d2_mm,cross_level_mm";
  for (const double base_m : request.bases_m) text += fmt::format(",twist_{}m_mm_per_m", base_m);
  text += "\n";
  for (const TrackPlace& place : places) {
    text += fmt::format("{:.6f}", place.distance_m);
    text += Field(place.level_d1_m) + Field(place.level_d2_m) + Field(place.alignment_d1_m) +
            Field(place.alignment_d2_m) + Field(place.cross_level_m);
    for (const auto& twist : place.twist) text += Field(twist);
    text += "\n";
  }
  return text;
}

using Picked = std::function<std::optional<double>(const TrackPlace&)>;

// Standard deviation and largest size of what is not empty.
std::string SpreadText(std::string_view what,
                       std::string_view unit,
                       std::string_view why_empty,
                       const std::vector<TrackPlace>& places,
                       const Picked& pick) {
  double sum = 0.0;
  double squares = 0.0;
  double largest = 0.0;
  double largest_at_m = 0.0;
  double count = 0.0;
  for (const TrackPlace& place : places) {
    const auto value = pick(place);
    if (!value) continue;
    sum += *value;
    squares += *value * *value;
    count += 1.0;
    if (std::abs(*value) <= std::abs(largest)) continue;
    largest = *value;
    largest_at_m = place.distance_m;
  }
  if (count == 0.0) return fmt::format("  {:<14} empty: {}\n", what, why_empty);
  const double mean = sum / count;
  const double deviation = std::sqrt(std::max(squares / count - mean * mean, 0.0));
  return fmt::format(
      "  {:<14} standard deviation {:.3f} {}, largest {:.3f} {} at {:.2f} m, {:.0f} places\n",
      what,
      1e3 * deviation,
      unit,
      1e3 * largest,
      unit,
      largest_at_m,
      count);
}

std::string BandText(std::string_view name, const WaveBand& band, double step_m) {
  return fmt::format(
      "band {}: {} to {} m; gain {:.3f} and {:.3f} at its ends, {:.3f} and {:.3f} at half and "
      "double of them; {} m at either end of the line stay empty\n",
      name,
      band.shortest_m,
      band.longest_m,
      TrackGain(band, step_m, band.shortest_m),
      TrackGain(band, step_m, band.longest_m),
      TrackGain(band, step_m, band.shortest_m / 2.0),
      TrackGain(band, step_m, band.longest_m * 2.0),
      TrackRoom(band));
}

std::string Summary(const std::vector<TrackPlace>& places, const GeometryRequest& request) {
  std::string text = fmt::format("{} places, {:.2f} to {:.2f} m\n",
                                 places.size(),
                                 places.front().distance_m,
                                 places.back().distance_m);
  text += BandText("D1", kBandD1, request.step_m) + BandText("D2", kBandD2, request.step_m);
  const auto too_short = [](const WaveBand& band) {
    return fmt::format("no part of the line without a hole is longer than {} m",
                       2.0 * TrackRoom(band));
  };
  const std::string d1 = too_short(kBandD1);
  const std::string d2 = too_short(kBandD2);
  text += SpreadText(
      "level D1", "mm", d1, places, [](const TrackPlace& place) { return place.level_d1_m; });
  text += SpreadText(
      "level D2", "mm", d2, places, [](const TrackPlace& place) { return place.level_d2_m; });
  text += SpreadText(
      "alignment D1", "mm", d1, places, [](const TrackPlace& p) { return p.alignment_d1_m; });
  text += SpreadText(
      "alignment D2", "mm", d2, places, [](const TrackPlace& p) { return p.alignment_d2_m; });
  text += SpreadText(
      "cross level", "mm", "", places, [](const TrackPlace& p) { return p.cross_level_m; });
  for (std::size_t i = 0; i < request.bases_m.size(); ++i) {
    text += SpreadText(fmt::format("twist {} m", request.bases_m[i]),
                       "mm/m",
                       "the line is shorter than the base",
                       places,
                       [i](const TrackPlace& place) { return place.twist[i]; });
  }
  return text +
         "one line only, cross level from the unit's roll: not a measurement after EN 13848\n";
}

// Empty after a complaint.
std::vector<TrackPlace> PlacesOf(const LineFile& line,
                                 const GeometryRequest& request,
                                 const Console& console) {
  if (const auto back = PlanLine(line.points).TurnsBackAt()) {
    Complain(console,
             FileFaults{{line.file,
                         line.line_of_point[*back],
                         "x_m",
                         "the trolley runs back here; give a line that runs one way"}});
    return {};
  }
  const double length_m = line.points.back().distance_m - line.points.front().distance_m;
  if (length_m > kLongest_m) {
    Complain(console,
             FileFaults{{line.file,
                         line.line_of_point.back(),
                         "distance_m",
                         fmt::format("{:.0f} m is longer than any run; write metres", length_m)}});
    return {};
  }
  std::vector<TrackPlace> places =
      MeasureTrack(line.points, {request.step_m, request.bases_m, 1e-3 * request.gauge_mm});
  if (places.empty()) {
    Complain(console,
             FileFaults{{line.file,
                         0,
                         "distance_m",
                         fmt::format("no part without a hole is longer than three steps, {} m",
                                     3.0 * request.step_m)}});
  }
  return places;
}

}  // namespace

ExitCode RunGeometry(const GeometryRequest& request, const Console& console) {
  if (const auto fault = OptionFault(request)) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  const OutputFile out(request.out, request.force);
  if (const auto obstacle = out.Obstacle()) {
    Complain(console, *obstacle);
    return ExitCode::kBadInput;
  }
  const auto line = ReadLineFile(request.line);
  if (!line) {
    Complain(console, line.error());
    return ExitCode::kBadInput;
  }
  for (const std::string& warning : line->warnings) Complain(console, "warning: " + warning);
  const std::vector<TrackPlace> places = PlacesOf(*line, request, console);
  if (places.empty()) return ExitCode::kBadInput;
  const std::string table = Table(places, request);
  if (request.out == "-") {
    console.out << table;
    console.err << Summary(places, request);
    return ExitCode::kDone;
  }
  if (const auto fault = out.Write(table)) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  console.out << Summary(places, request);
  return ExitCode::kDone;
}

}  // namespace tbm
