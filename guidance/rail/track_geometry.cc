#include "guidance/rail/track_geometry.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

#include "guidance/rail/band_pass.h"

namespace tbm {
namespace {

constexpr double kApart_m = 1e-3;
constexpr double kHole_m = 0.5;

// What is resampled: position, and the slopes of the unit's floor towards x and y of the world.
using Channels = Eigen::Matrix<double, 5, 1>;

// A piece of the line without holes.
struct Piece {
  std::vector<double> distance_m;
  std::vector<Channels> values;
  std::vector<Channels> integrals;  // from the first sample
};

Channels ChannelsOf(const RailPoint& point) {
  const Eigen::Vector3d plumb = point.world_from_imu * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d& p = point.position_world_m;
  Channels channels;
  channels << p.x(), p.y(), p.z(), -plumb.x() / plumb.z(), -plumb.y() / plumb.z();
  return channels;
}

std::vector<Piece> PiecesOf(std::span<const RailPoint> points) {
  std::vector<Piece> pieces;
  bool is_broken = true;
  for (const RailPoint& point : points) {
    if (point.status == RailStatus::kGap) {
      is_broken = true;
      continue;
    }
    if (!is_broken) {
      const double step_m = point.distance_m - pieces.back().distance_m.back();
      if (step_m < kApart_m) continue;
      is_broken = step_m > kHole_m;
    }
    if (is_broken) pieces.emplace_back();
    is_broken = false;
    Piece& piece = pieces.back();
    const Channels channels = ChannelsOf(point);
    Channels integral = Channels::Zero();
    if (!piece.values.empty()) {
      integral = piece.integrals.back() + 0.5 * (point.distance_m - piece.distance_m.back()) *
                                              (channels + piece.values.back());
    }
    piece.distance_m.push_back(point.distance_m);
    piece.values.push_back(channels);
    piece.integrals.push_back(integral);
  }
  return pieces;
}

// Integral from the first sample to anywhere, of what runs straight from sample to sample.
Channels IntegralTo(const Piece& piece, double distance_m) {
  const auto after =
      std::upper_bound(piece.distance_m.begin() + 1, piece.distance_m.end() - 1, distance_m);
  const auto i = static_cast<std::size_t>(after - piece.distance_m.begin()) - 1;
  const double span_m = piece.distance_m[i + 1] - piece.distance_m[i];
  const double in_m = distance_m - piece.distance_m[i];
  const Channels here = piece.values[i] + (in_m / span_m) * (piece.values[i + 1] - piece.values[i]);
  return piece.integrals[i] + 0.5 * in_m * (piece.values[i] + here);
}

// A piece at equal steps, each the mean over one step.
struct Stations {
  double first = 0.0;  // number of the first: its distance in steps
  std::vector<Channels> values;
};

Stations StationsOf(const Piece& piece, double step_m) {
  Stations stations;
  if (piece.values.size() < 2) return stations;
  stations.first = std::ceil(piece.distance_m.front() / step_m + 0.5 - 1e-9);
  for (double k = stations.first; (k + 0.5) * step_m <= piece.distance_m.back() + 1e-9; k += 1.0) {
    stations.values.push_back(
        (IntegralTo(piece, (k + 0.5) * step_m) - IntegralTo(piece, (k - 0.5) * step_m)) / step_m);
  }
  return stations;
}

// Direction in plan at each station, from the chord of its neighbours, without jumps of a turn.
std::vector<double> HeadingsOf(const std::vector<Channels>& values) {
  std::vector<double> headings;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t before = i > 0 ? i - 1 : i;
    const std::size_t after = std::min(i + 1, values.size() - 1);
    const Eigen::Vector2d chord = values[after].head<2>() - values[before].head<2>();
    headings.push_back(std::atan2(chord.y(), chord.x()));
  }
  return headings;
}

// How far the line has come to the left, its curves unrolled: the sum of step times heading. An
// even curve makes a parabola of it, which no band lets pass; a deviation stays as large as it is.
std::vector<double> UnrolledLeft(const std::vector<Channels>& values, double step_m) {
  std::vector<double> left_m(values.size(), 0.0);
  double heading_rad = 0.0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const Eigen::Vector2d chord = values[i].head<2>() - values[i - 1].head<2>();
    const double turned_rad = std::atan2(chord.y(), chord.x());
    heading_rad =
        i == 1 ? turned_rad
               : heading_rad + std::remainder(turned_rad - heading_rad, 2.0 * std::numbers::pi);
    left_m[i] = left_m[i - 1] + step_m * heading_rad;
  }
  return left_m;
}

using Optionals = std::vector<std::optional<double>>;

void FillTwist(const std::vector<double>& bases_m, double step_m, std::vector<TrackPlace>* places) {
  const double last = static_cast<double>(places->size()) - 1.0;
  const auto cross_level_m = [&](double at) -> std::optional<double> {
    if (at < -1e-9 || at > last + 1e-9) return std::nullopt;
    const auto i = static_cast<std::size_t>(std::clamp(std::floor(at + 1e-9), 0.0, last));
    const double part = std::max(at - static_cast<double>(i), 0.0);
    const auto& here = (*places)[i].cross_level_m;
    if (part < 1e-6) return here;
    const auto& next = (*places)[i + 1].cross_level_m;
    if (!here || !next) return std::nullopt;
    return *here + part * (*next - *here);
  };
  for (std::size_t i = 0; i < places->size(); ++i) {
    TrackPlace& place = (*places)[i];
    for (const double base_m : bases_m) {
      const double half = 0.5 * base_m / step_m;
      const auto ahead = cross_level_m(static_cast<double>(i) + half);
      const auto behind = cross_level_m(static_cast<double>(i) - half);
      place.twist.push_back(ahead && behind ? std::optional((*ahead - *behind) / base_m)
                                            : std::nullopt);
    }
  }
}

void Measure(const Stations& stations,
             const TrackGeometryOptions& options,
             std::vector<TrackPlace>* places) {
  const BandPass d1(kBandD1.shortest_m, kBandD1.longest_m, options.step_m);
  const BandPass d2(kBandD2.shortest_m, kBandD2.longest_m, options.step_m);
  std::vector<double> up_m;
  for (const Channels& values : stations.values) up_m.push_back(values[2]);
  const std::vector<double> left_m = UnrolledLeft(stations.values, options.step_m);
  const std::vector<double> headings_rad = HeadingsOf(stations.values);
  const Optionals level_d1_m = d1.Filtered(up_m);
  const Optionals level_d2_m = d2.Filtered(up_m);
  const Optionals alignment_d1_m = d1.Filtered(left_m);
  const Optionals alignment_d2_m = d2.Filtered(left_m);
  for (std::size_t i = 0; i < stations.values.size(); ++i) {
    TrackPlace place;
    place.distance_m = (stations.first + static_cast<double>(i)) * options.step_m;
    place.level_d1_m = level_d1_m[i];
    place.level_d2_m = level_d2_m[i];
    place.alignment_d1_m = alignment_d1_m[i];
    place.alignment_d2_m = alignment_d2_m[i];
    // The floor's slope to the left: of the unit only its plumb axis counts, so it may be turned on
    // the trolley.
    const Channels& values = stations.values[i];
    const double slope =
        -std::sin(headings_rad[i]) * values[3] + std::cos(headings_rad[i]) * values[4];
    place.cross_level_m = options.gauge_m * std::sin(std::atan(slope));
    places->push_back(std::move(place));
  }
}

}  // namespace

double TrackGain(const WaveBand& band, double step_m, double wavelength_m) {
  const double angle = std::numbers::pi * step_m / wavelength_m;
  return BandPass(band.shortest_m, band.longest_m, step_m).Gain(wavelength_m) * std::sin(angle) /
         angle;
}

double TrackRoom(const WaveBand& band) {
  return BandPass(band.shortest_m, band.longest_m, band.shortest_m / 4.0).room_m();
}

std::vector<TrackPlace> MeasureTrack(std::span<const RailPoint> points,
                                     const TrackGeometryOptions& options) {
  std::vector<TrackPlace> places;
  for (const Piece& piece : PiecesOf(points)) {
    const Stations stations = StationsOf(piece, options.step_m);
    if (stations.values.size() < 2) continue;  // no direction
    std::vector<TrackPlace> measured;
    Measure(stations, options, &measured);
    FillTwist(options.bases_m, options.step_m, &measured);
    // Stations of the hole stand in the table, empty.
    const auto next = std::llround(measured.front().distance_m / options.step_m);
    while (!places.empty()) {
      const auto number = std::llround(places.back().distance_m / options.step_m) + 1;
      if (number >= next) break;
      TrackPlace nothing;
      nothing.distance_m = static_cast<double>(number) * options.step_m;
      nothing.twist.resize(options.bases_m.size());
      places.push_back(std::move(nothing));
    }
    places.insert(places.end(),
                  std::make_move_iterator(measured.begin()),
                  std::make_move_iterator(measured.end()));
  }
  return places;
}

}  // namespace tbm
