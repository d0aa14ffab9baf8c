#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "guidance/rail/rail_line.h"

namespace tbm {

// A place at which runs over the same rail are compared: on the base line, plumb above one point of
// the plan. Run-up distance differs from run to run, the place in the world does not.
struct LinePlace {
  double distance_m = 0.0;  // of the base line
  Eigen::Vector2d plan_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d along = Eigen::Vector2d::Zero();  // unit vector, as the base line runs
};

// How high a line is at a place.
struct PlaceHeight {
  double z_world_m = 0.0;
  // Of the height at this place of the plan: sigma of the sample's height, and of its place along
  // the line times the gradient.
  double sigma_m = 0.0;
  Timestamp at;
};

// A line whose points are found by where they lie in plan.
class PlanLine {
 public:
  explicit PlanLine(std::span<const RailPoint> points);

  // Where the line first runs back on itself (as an index of `points`): there is no order along it.
  std::optional<std::size_t> TurnsBackAt() const;

  // Every multiple of `step_m` > 0 of the distance, from the first point to the last.
  std::vector<LinePlace> EqualPlaces(double step_m) const;

  // The sample that is nearest in plan, carried to the place along the line's own gradient. One
  // sample, not a mean of two: its error is what its sigma says, however the errors of neighbours
  // hang together (docs/settlement.md). Empty where the line does not pass, or has a hole or gap.
  std::optional<PlaceHeight> HeightAt(const LinePlace& place) const;

 private:
  // Points that lie apart: a trolley at rest gives thousands for one place.
  struct Sample {
    const RailPoint* point;
    Eigen::Vector2d plan_world_m;
  };
  std::optional<std::size_t> NearestTo(const Eigen::Vector2d& plan_world_m) const;
  // First and last of the samples about one, with no hole between.
  std::pair<std::size_t, std::size_t> About(std::size_t sample) const;
  Eigen::Vector2d DirectionAt(std::size_t sample) const;

  std::span<const RailPoint> points_;
  std::vector<Sample> samples_;
  std::vector<std::pair<std::uint64_t, std::size_t>> cells_;  // in order
};

}  // namespace tbm
