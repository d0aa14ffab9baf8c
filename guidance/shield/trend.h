#pragma once

#include <optional>

#include <Eigen/Core>

#include "guidance/axis/chainage.h"
#include "pose/base/fixed_vector.h"

namespace tbm {

// One look at where a point of the machine is, in one direction (right or up) off the design.
struct TrackPoint {
  InternalChainage at;
  double off_m = 0.0;
  double random_sigma_m = 0.0;  // what differs from look to look; what is common is not in here
};

struct TrackOptions {
  // How fast the machine's path bends by itself, against the design's bend: after one metre its
  // direction has changed by this much (one sigma), after four by twice as much. 1 mm/m is a calm
  // drive; measure it with `tbm check` on a drive of one's own.
  double steering_per_sqrt_m = 1e-3;
  // A shield does not go exactly where it points: it crabs. One sigma of the difference.
  double crab_sigma_per_m = 3e-3;
  double start_slope_sigma = 2e-2;  // before anything is known of the direction
  double least_step_m = 0.02;       // looks closer together than this are one place
  double back_m = 0.5;              // going back by more than this begins a new track
};

// Where the path leads. `sigma_m` is of the prediction against the path that the machine will take
// by itself; what is common to all looks comes on top.
struct Prediction {
  double off_m = 0.0;
  double sigma_m = 0.0;
};

// The slope of the path over a length already driven.
struct Slope {
  double per_m = 0.0;
  double sigma_per_m = 0.0;
  double length_m = 0.0;  // that it was taken over
};

// The path of one point in one direction, as a filter along the chainage: offset d and slope d',
//   d(s + ds) = d + ds d',  d'(s + ds) = d' + w,  w ~ N(0, steering^2 ds),
// observed through the offsets and, loosely, through where the shield points. Time does not enter:
// a machine that stands still learns nothing of its direction by being looked at again, and what it
// averages is one place. Pure, no heap.
class Track {
 public:
  explicit Track(const TrackOptions& options) : options_(options) {}

  // `lead_per_m` is where the shield points against the design. False when the look was ignored: it
  // is no number, or behind the last one by less than `back_m`.
  bool Add(const TrackPoint& look, std::optional<double> lead_per_m, double lead_sigma_per_m);

  // Nothing before the first look.
  std::optional<Prediction> Ahead(double ahead_m) const;

  // By least squares through what was kept over the last `length_m`; nothing with less than a third
  // of it driven, or fewer than three places.
  std::optional<Slope> Over(double length_m) const;

  // The last look's chainage, as far as there is one.
  std::optional<InternalChainage> at() const;

 private:
  // The mean of the looks from one chainage on, by their weights.
  struct Place {
    double from_m = 0.0;
    double at_m = 0.0;
    double off_m = 0.0;
    double variance_m2 = 0.0;
  };
  static constexpr std::size_t kMostPlaces = 256;

  void Begin(const TrackPoint& look);
  void Go(double step_m);
  void Observe(const Eigen::RowVector2d& by_state, double value, double variance);
  void Keep(const TrackPoint& look);

  TrackOptions options_;
  bool has_begun_ = false;
  double at_m_ = 0.0;                                // of the state
  double pointed_at_m_ = 0.0;                        // where the lead was last used
  Eigen::Vector2d state_ = Eigen::Vector2d::Zero();  // d [m], d' [1]
  Eigen::Matrix2d covariance_ = Eigen::Matrix2d::Zero();
  FixedVector<Place, kMostPlaces> places_;
};

}  // namespace tbm
