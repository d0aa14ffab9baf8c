#include "guidance/axis/design_axis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "guidance/axis/axis_builder.h"

namespace tbm {
namespace {

// Beyond the ends by rounding only.
constexpr double kAtEnd_m = 1e-6;
// Two feet whose distances differ by less are equally near.
constexpr double kEquallyNear_m = 1e-3;

double BearingOf(const Eigen::Vector2d& direction) {
  const double bearing_rad = std::atan2(direction.x(), direction.y());
  return bearing_rad < 0.0 ? bearing_rad + 2.0 * std::numbers::pi : bearing_rad;
}

double DistanceOf(const AxisPosition& position) {
  return std::hypot(position.deviation_right_m, position.deviation_up_m.value_or(0.0));
}

}  // namespace

std::optional<Eigen::Vector3d> AxisPoint::p_in_site() const {
  if (!up_m) return std::nullopt;
  return Eigen::Vector3d(p_plan_in_site.x(), p_plan_in_site.y(), *up_m);
}

std::optional<Eigen::Vector3d> AxisPoint::direction_in_site() const {
  if (!gradient) return std::nullopt;
  const double level = 1.0 / std::hypot(1.0, *gradient);
  return Eigen::Vector3d(
      level * direction_plan_in_site.x(), level * direction_plan_in_site.y(), level * *gradient);
}

Result<DesignAxis, AxisRemarks> DesignAxis::Build(const AxisDescription& description) {
  AxisRemarks remarks;
  auto axis = AxisBuilder::Build(description, &remarks);
  if (!axis) return Failure{std::move(remarks)};
  return std::move(*axis);
}

AxisRemarks Inspect(const AxisDescription& description) {
  AxisRemarks remarks;
  (void)AxisBuilder::Build(description, &remarks);
  return remarks;
}

std::optional<Cant> DesignAxis::CantAt(InternalChainage chainage) const {
  if (cant_.empty() || chainage < cant_.front().at || chainage > cant_.back().at) {
    return std::nullopt;
  }
  const auto next = std::upper_bound(
      cant_.begin(), cant_.end(), chainage, [](InternalChainage at, const CantStation& s) {
        return at < s.at;
      });
  double cant_m = std::prev(next)->left_over_right_m;
  if (next != cant_.end()) {
    const CantStation& from = *std::prev(next);
    const double share = (chainage.m - from.at.m) / (next->at.m - from.at.m);
    cant_m += share * (next->left_over_right_m - from.left_over_right_m);
  }
  return Cant{cant_m, std::asin(std::clamp(cant_m / gauge_m_, -1.0, 1.0))};
}

Result<AxisPoint, AxisFailure> DesignAxis::At(InternalChainage chainage) const {
  if (!std::isfinite(chainage.m)) return Failure{AxisFailure::kNotFinite};
  if (chainage.m < start().m - kAtEnd_m) return Failure{AxisFailure::kBeforeStart};
  if (chainage.m > end().m + kAtEnd_m) return Failure{AxisFailure::kBeyondEnd};
  chainage.m = std::clamp(chainage.m, start().m, end().m);
  const PlanPoint plan = plan_.At(chainage);
  AxisPoint point;
  point.chainage = chainage;
  point.official = equations_.ToOfficial(chainage);
  point.p_plan_in_site = plan.place;
  point.direction_plan_in_site = plan.direction;
  point.bearing_rad = BearingOf(plan.direction);
  point.curvature_right_per_m = plan.curvature_right_per_m;
  if (const auto profile = profile_.At(chainage)) {
    point.up_m = profile->up_m;
    point.gradient = profile->gradient;
    point.curvature_up_per_m = profile->curvature_up_per_m;
  }
  point.cant = CantAt(chainage);
  return point;
}

AxisPosition DesignAxis::PositionOf(const PlanFoot& foot, const Eigen::Vector3d& p_in_site) const {
  AxisPosition position;
  position.chainage = foot.chainage;
  position.official = equations_.ToOfficial(foot.chainage);
  position.deviation_right_m = foot.offset_right_m;
  position.bearing_rad = BearingOf(foot.direction);
  position.curvature_right_per_m = foot.curvature_right_per_m;
  if (const auto profile = profile_.At(foot.chainage)) {
    position.deviation_up_m = p_in_site.z() - profile->up_m;
    position.gradient = profile->gradient;
  }
  return position;
}

// Which end of the axis the point lies beyond, if it lies abreast of one.
AxisFailure DesignAxis::WhyNoFoot(const Eigen::Vector2d& p_in_site, double reach_m) const {
  const PlanPoint first = plan_.At(start());
  const PlanPoint last = plan_.At(end());
  const Eigen::Vector2d from_first = p_in_site - first.place;
  const Eigen::Vector2d from_last = p_in_site - last.place;
  const auto is_abreast = [reach_m](const Eigen::Vector2d& from, const Eigen::Vector2d& direction) {
    return std::abs(CrossProduct(direction, from)) <= reach_m;
  };
  const double before_m = -from_first.dot(first.direction);
  const double beyond_m = from_last.dot(last.direction);
  const bool is_before = before_m > 0.0 && is_abreast(from_first, first.direction);
  const bool is_beyond = beyond_m > 0.0 && is_abreast(from_last, last.direction);
  if (is_before && (!is_beyond || from_first.squaredNorm() <= from_last.squaredNorm())) {
    return AxisFailure::kBeforeStart;
  }
  return is_beyond ? AxisFailure::kBeyondEnd : AxisFailure::kTooFar;
}

Result<AxisPosition, AxisFailure> DesignAxis::Project(const Eigen::Vector3d& p_in_site,
                                                      std::optional<InternalChainage> hint,
                                                      double reach_m) const {
  if (!p_in_site.allFinite() || !std::isfinite(reach_m) || (hint && !std::isfinite(hint->m))) {
    return Failure{AxisFailure::kNotFinite};
  }
  const Eigen::Vector2d p_plan = p_in_site.head<2>();
  if (hint) {
    const auto foot = plan_.FootNearChainage(p_plan, reach_m, *hint);
    if (!foot) return Failure{WhyNoFoot(p_plan, reach_m)};
    return PositionOf(*foot, p_in_site);
  }
  const Plan::Feet feet = plan_.FeetWithin(p_plan, reach_m);
  if (feet.empty()) return Failure{WhyNoFoot(p_plan, reach_m)};
  AxisPosition nearest = PositionOf(feet[0], p_in_site);
  std::optional<AxisPosition> second;
  for (std::size_t i = 1; i < feet.size(); ++i) {
    AxisPosition other = PositionOf(feet[i], p_in_site);
    if (DistanceOf(other) < DistanceOf(nearest)) std::swap(nearest, other);
    if (!second || DistanceOf(other) < DistanceOf(*second)) second = other;
  }
  if (!second) return nearest;
  if (DistanceOf(*second) - DistanceOf(nearest) < kEquallyNear_m) {
    return Failure{AxisFailure::kAmbiguous};
  }
  nearest.other_foot = second->chainage;
  return nearest;
}

std::vector<AxisPosition> DesignAxis::ProjectAll(const Eigen::Vector3d& p_in_site,
                                                 double reach_m) const {
  std::vector<AxisPosition> positions;
  if (!p_in_site.allFinite() || !std::isfinite(reach_m)) return positions;
  for (const PlanFoot& foot : plan_.AllFeet(p_in_site.head<2>(), reach_m)) {
    positions.push_back(PositionOf(foot, p_in_site));
  }
  return positions;
}

Result<Rigid3, AxisFailure> DesignAxis::AxisFromSite(InternalChainage chainage) const {
  const auto point = At(chainage);
  if (!point) return Failure{point.error()};
  const auto p_axis_in_site = point->p_in_site();
  if (!p_axis_in_site) return Failure{AxisFailure::kNoProfile};
  const Eigen::Vector2d along = point->direction_plan_in_site;
  Eigen::Matrix3d site_from_axis;
  site_from_axis << along.x(), -along.y(), 0.0, along.y(), along.x(), 0.0, 0.0, 0.0, 1.0;
  return Inverse(Rigid3{Eigen::Quaterniond(site_from_axis).normalized(), *p_axis_in_site});
}

}  // namespace tbm
