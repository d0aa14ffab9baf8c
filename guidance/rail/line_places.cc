#include "guidance/rail/line_places.h"

#include <algorithm>
#include <cmath>

namespace tbm {
namespace {

constexpr double kApart_m = 1e-3;
// Between samples further apart than this nobody knows the line.
constexpr double kHole_m = 0.5;
// Further to the side runs another track.
constexpr double kAside_m = 0.5;
// Gradient and direction are those of so many samples to either side: what is carried over half a
// spacing then adds a thousandth of the sample's variance, whatever the spacing is.
constexpr std::size_t kChordSamples = 10;
// Two runs that start at the same mark do not start at the same place.
constexpr double kInside_m = 5e-3;
constexpr double kMark_m = 0.5;
// Wide enough for all that may be near to lie in the cell or beside it.
constexpr double kCell_m = 1.0;

std::uint64_t Cell(double x_m, double y_m, int dx, int dy) {
  const auto index = [](double m, int d) {
    return static_cast<std::uint64_t>(std::llround(m / kCell_m) + d) & 0xffffffffu;
  };
  return index(x_m, dx) << 32 | index(y_m, dy);
}

}  // namespace

PlanLine::PlanLine(std::span<const RailPoint> points) : points_(points) {
  for (const RailPoint& point : points) {
    if (!samples_.empty() && point.distance_m < samples_.back().point->distance_m + kApart_m) {
      continue;
    }
    samples_.push_back({&point, point.position_world_m.head<2>()});
  }
  cells_.reserve(samples_.size());
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const Eigen::Vector2d& plan = samples_[i].plan_world_m;
    cells_.emplace_back(Cell(plan.x(), plan.y(), 0, 0), i);
  }
  std::sort(cells_.begin(), cells_.end());
}

std::optional<std::size_t> PlanLine::TurnsBackAt() const {
  if (samples_.empty()) return std::nullopt;
  Eigen::Vector2d chord = Eigen::Vector2d::Zero();
  Eigen::Vector2d mark = samples_.front().plan_world_m;
  for (const Sample& sample : samples_) {
    const Eigen::Vector2d next = sample.plan_world_m - mark;
    if (next.norm() < kMark_m) continue;
    if (chord.dot(next) < 0.0) return static_cast<std::size_t>(sample.point - points_.data());
    chord = next;
    mark = sample.plan_world_m;
  }
  return std::nullopt;
}

std::pair<std::size_t, std::size_t> PlanLine::About(std::size_t sample) const {
  const auto is_hole = [&](std::size_t before) {
    return samples_[before + 1].point->distance_m - samples_[before].point->distance_m > kHole_m;
  };
  std::size_t first = sample;
  while (first > 0 && sample - first < kChordSamples && !is_hole(first - 1)) --first;
  std::size_t last = sample;
  while (last + 1 < samples_.size() && last - sample < kChordSamples && !is_hole(last)) ++last;
  return {first, last};
}

Eigen::Vector2d PlanLine::DirectionAt(std::size_t sample) const {
  const auto [first, last] = About(sample);
  const Eigen::Vector2d chord = samples_[last].plan_world_m - samples_[first].plan_world_m;
  return chord.norm() > 0.0 ? Eigen::Vector2d(chord.normalized()) : chord;
}

std::vector<LinePlace> PlanLine::EqualPlaces(double step_m) const {
  std::vector<LinePlace> places;
  if (samples_.size() < 2) return places;
  const double begin_m = samples_.front().point->distance_m;
  const double end_m = samples_.back().point->distance_m;
  std::size_t i = 0;
  for (double k = std::ceil(begin_m / step_m - 1e-9) + 0.0; k * step_m <= end_m + 1e-9; k += 1.0) {
    const double distance_m = k * step_m;
    while (i + 2 < samples_.size() && samples_[i + 1].point->distance_m < distance_m) ++i;
    const double from_m = samples_[i].point->distance_m;
    const double part =
        std::clamp((distance_m - from_m) / (samples_[i + 1].point->distance_m - from_m), 0.0, 1.0);
    places.push_back({distance_m,
                      (1.0 - part) * samples_[i].plan_world_m + part * samples_[i + 1].plan_world_m,
                      DirectionAt(part < 0.5 ? i : i + 1)});
  }
  return places;
}

std::optional<std::size_t> PlanLine::NearestTo(const Eigen::Vector2d& plan_world_m) const {
  std::optional<std::size_t> nearest;
  double least_m2 = kAside_m * kAside_m;
  for (int dx = -1; dx <= 1; ++dx) {
    for (int dy = -1; dy <= 1; ++dy) {
      const std::uint64_t cell = Cell(plan_world_m.x(), plan_world_m.y(), dx, dy);
      auto entry = std::lower_bound(
          cells_.begin(), cells_.end(), std::pair<std::uint64_t, std::size_t>(cell, 0));
      for (; entry != cells_.end() && entry->first == cell; ++entry) {
        const double m2 = (samples_[entry->second].plan_world_m - plan_world_m).squaredNorm();
        if (m2 >= least_m2) continue;
        least_m2 = m2;
        nearest = entry->second;
      }
    }
  }
  return nearest;
}

std::optional<PlaceHeight> PlanLine::HeightAt(const LinePlace& place) const {
  const auto nearest = NearestTo(place.plan_world_m);
  if (!nearest) return std::nullopt;
  const RailPoint& point = *samples_[*nearest].point;
  if (point.status == RailStatus::kGap) return std::nullopt;
  const auto along_m = [&](std::size_t sample) {
    return (samples_[sample].plan_world_m - place.plan_world_m).dot(place.along);
  };
  const auto [first, last] = About(*nearest);
  const double low_m = std::min(along_m(first), along_m(last));
  const double high_m = std::max(along_m(first), along_m(last));
  // Before its first sample and beyond its last there is no line; nor on a wall.
  if (low_m > kInside_m || high_m < -kInside_m || high_m - low_m < kApart_m / 2.0) {
    return std::nullopt;
  }
  const double rise_m =
      samples_[last].point->position_world_m.z() - samples_[first].point->position_world_m.z();
  const double gradient = rise_m / (along_m(last) - along_m(first));
  const Eigen::Vector3d& sigma_m = point.sigma_world_m;
  const double sigma_along_m =
      std::hypot(place.along.x() * sigma_m.x(), place.along.y() * sigma_m.y());
  return PlaceHeight{point.position_world_m.z() - gradient * along_m(*nearest),
                     std::hypot(sigma_m.z(), gradient * sigma_along_m),
                     point.at};
}

}  // namespace tbm
