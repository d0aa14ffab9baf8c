#include "guidance/station/polar.h"

#include <cmath>
#include <numbers>

#include <Eigen/LU>

namespace tbm {
namespace {

constexpr double kShortest_m = 1e-6;  // in plan: below it there is no bearing

// The triangle of a sight: plan distance h as the instrument sees it, and the apparent rise a.
struct Triangle {
  double east_m, north_m;
  double plan_m;  // in site coordinates
  double h_m, a_m;
  double bend_per_m;  // (1 - k) / (2 R)
};

Triangle TriangleOf(const Station& station, const Eigen::Vector3d& p, const SightModel& model) {
  Triangle t{};
  const Eigen::Vector3d d = p - station.p_axes_in_site;
  t.east_m = d.x();
  t.north_m = d.y();
  t.plan_m = std::hypot(d.x(), d.y());
  t.h_m = t.plan_m / model.grid_scale;
  t.bend_per_m = (1.0 - model.refraction_k) / (2.0 * model.earth_radius_m);
  t.a_m = d.z() - t.bend_per_m * t.h_m * t.h_m;
  return t;
}

}  // namespace

double Turn(double angle_rad) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double turn = angle_rad - kTurn * std::floor(angle_rad / kTurn);
  return turn < kTurn ? turn : 0.0;  // -1e-20 would round up to a whole turn
}

double HalfTurn(double angle_rad) { return Turn(angle_rad + std::numbers::pi) - std::numbers::pi; }

Result<PolarReading, SightFailure> Sight(const Station& station,
                                         const Eigen::Vector3d& p_in_site,
                                         const SightModel& model) {
  const Triangle t = TriangleOf(station, p_in_site, model);
  if (!(t.plan_m > kShortest_m)) return Failure{SightFailure::kAlongTheAxis};
  PolarReading reading;
  reading.circle_rad = Turn(std::atan2(t.east_m, t.north_m) - station.circle_zero_bearing_rad);
  reading.zenith_rad = std::atan2(t.h_m, t.a_m);
  reading.slope_m = std::hypot(t.h_m, t.a_m);
  return reading;
}

Result<Eigen::Vector3d, SightFailure> PointSighted(const Station& station,
                                                   const PolarReading& reading,
                                                   const SightModel& model) {
  if (!reading.slope_m) return Failure{SightFailure::kNoDistance};
  if (!std::isfinite(reading.circle_rad) || !std::isfinite(reading.zenith_rad) ||
      !std::isfinite(*reading.slope_m)) {
    return Failure{SightFailure::kNotFinite};
  }
  const double h_m = *reading.slope_m * std::sin(reading.zenith_rad);
  if (!(h_m > kShortest_m)) return Failure{SightFailure::kAlongTheAxis};
  const double a_m = *reading.slope_m * std::cos(reading.zenith_rad);
  const double bend_per_m = (1.0 - model.refraction_k) / (2.0 * model.earth_radius_m);
  const double bearing_rad = reading.circle_rad + station.circle_zero_bearing_rad;
  const double plan_m = h_m * model.grid_scale;
  return Eigen::Vector3d(station.p_axes_in_site + Eigen::Vector3d(plan_m * std::sin(bearing_rad),
                                                                  plan_m * std::cos(bearing_rad),
                                                                  a_m + bend_per_m * h_m * h_m));
}

SightJacobian SightBy(const Station& station,
                      const Eigen::Vector3d& p_in_site,
                      const SightModel& model) {
  const Triangle t = TriangleOf(station, p_in_site, model);
  const double slope_m = std::hypot(t.h_m, t.a_m);
  const Eigen::RowVector3d circle_by =
      Eigen::RowVector3d(t.north_m, -t.east_m, 0.0) / (t.plan_m * t.plan_m);
  const Eigen::RowVector3d h_by =
      Eigen::RowVector3d(t.east_m, t.north_m, 0.0) / (t.plan_m * model.grid_scale);
  const Eigen::RowVector3d a_by =
      Eigen::RowVector3d(0.0, 0.0, 1.0) - 2.0 * t.bend_per_m * t.h_m * h_by;
  SightJacobian jacobian;
  jacobian.by_point.row(0) = circle_by;
  jacobian.by_point.row(1) = (t.a_m * h_by - t.h_m * a_by) / (slope_m * slope_m);
  jacobian.by_point.row(2) = (t.h_m * h_by + t.a_m * a_by) / slope_m;
  jacobian.by_station.leftCols<3>() = -jacobian.by_point;
  jacobian.by_station.col(3) = Eigen::Vector3d(-1.0, 0.0, 0.0);
  return jacobian;
}

SightedCovariance CovarianceSighted(const Station& station,
                                    const Eigen::Vector3d& p_in_site,
                                    const SightModel& model,
                                    const PolarSigma& sigma) {
  // reading = f(station, p): d p = (df/dp)^-1 (d reading - df/dstation d station)
  const SightJacobian jacobian = SightBy(station, p_in_site, model);
  const Eigen::Matrix3d point_by_reading = jacobian.by_point.inverse();
  const Eigen::Vector3d variance =
      Eigen::Vector3d(sigma.circle_rad, sigma.zenith_rad, sigma.slope_m).cwiseAbs2();
  return {point_by_reading * variance.asDiagonal() * point_by_reading.transpose(),
          -point_by_reading * jacobian.by_station};
}

}  // namespace tbm
