#pragma once

#include <optional>

#include <Eigen/Core>

#include "pose/base/result.h"

namespace tbm {

// A total station that is set up: where its axes cross, and where its circle's zero points.
struct Station {
  Eigen::Vector3d p_axes_in_site = Eigen::Vector3d::Zero();  // [m] tilting axis, not the tripod
  // Bearing of the circle's zero: clockwise from north, as every bearing.
  double circle_zero_bearing_rad = 0.0;
};

// Order of a station's four unknowns in every covariance: east, north, up [m], circle zero [rad].
using StationCovariance = Eigen::Matrix4d;

// One pointing as the first face of a faultless instrument would show it: corrected for the
// instrument's own errors, for the air's density and for the prism's constant (see reduce.h), not
// for anything that depends on where the prism is.
struct PolarReading {
  double circle_rad = 0.0;        // clockwise
  double zenith_rad = 0.0;        // 0: straight up, pi/2: level
  std::optional<double> slope_m;  // from the tilting axis to the prism; empty: angles only
};

struct PolarSigma {
  double circle_rad = 0.0;
  double zenith_rad = 0.0;
  double slope_m = 0.0;  // of no meaning where there is no slope distance
};

// What bends and scales a line of sight.
struct SightModel {
  // Curvature of the ray over the curvature of the earth: 0.13 outdoors by day. In a tunnel it has
  // no fixed value (warm walls, ventilation): its sigma belongs into the budget.
  double refraction_k = 0.13;
  double earth_radius_m = 6.371e6;
  double grid_scale = 1.0;  // plan length in site coordinates over true length: 0.9996..1.0004
};

// Why a reading gives no point.
enum class SightFailure {
  kNoDistance,    // angles only
  kNotFinite,     // NaN or infinite
  kAlongTheAxis,  // straight up or down: no bearing
};

// What a faultless instrument on `station` reads on a prism; `circle_rad` in [0, 2 pi).
//
//   h = plan distance / grid_scale        a = rise - (1 - k) / (2 R) h^2
//   circle = bearing - zero   zenith = atan2(h, a)   slope = hypot(h, a)
//
// The usual first-order terms for curvature and refraction: at 350 m, uphill by 2 %, 0.04 mm from
// the exact geometry, growing with the square of the distance. Fails with kAlongTheAxis only.
Result<PolarReading, SightFailure> Sight(const Station& station,
                                         const Eigen::Vector3d& p_in_site,
                                         const SightModel& model);

// The point that was sighted. Inverse of Sight.
Result<Eigen::Vector3d, SightFailure> PointSighted(const Station& station,
                                                   const PolarReading& reading,
                                                   const SightModel& model);

// Derivatives of (circle, zenith, slope), rows in this order. `by_point` is invertible wherever
// Sight does not fail; `by_station` has the columns of StationCovariance and is [-by_point | -1 0
// 0].
struct SightJacobian {
  Eigen::Matrix3d by_point;
  Eigen::Matrix<double, 3, 4> by_station;
};
SightJacobian SightBy(const Station& station,
                      const Eigen::Vector3d& p_in_site,
                      const SightModel& model);

// Covariance of a sighted point [m^2], in two parts, because the station's error is common to all
// points of one set-up and does not average out:
//   covariance of the point = of_reading + by_station * station covariance * by_station^T.
struct SightedCovariance {
  Eigen::Matrix3d of_reading;
  Eigen::Matrix<double, 3, 4> by_station;
};
SightedCovariance CovarianceSighted(const Station& station,
                                    const Eigen::Vector3d& p_in_site,
                                    const SightModel& model,
                                    const PolarSigma& sigma);

// The same angle in [0, 2 pi), and in [-pi, pi).
double Turn(double angle_rad);
double HalfTurn(double angle_rad);

}  // namespace tbm
