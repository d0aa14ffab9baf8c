#include "pose/calibrate/target_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <Eigen/SVD>

namespace tbm {
namespace {

using Points = std::vector<Eigen::Vector3d>;
using Order = std::vector<std::size_t>;

constexpr double kLeastBreadth_m = 0.01;
constexpr std::size_t kMostForAllOrders = 7;

// The rigid transform that brings `from` onto `to` with the least squares (Kabsch).
struct RigidFit {
  Rigid3 to_from;
  double breadth_m = 0.0;  // second largest extent of `from`
  double worst_m = 0.0;
  double scale = 1.0;  // extent of `to` by that of `from`
};

RigidFit FitRigid(const Points& from, const Points& to) {
  const auto count = static_cast<double>(from.size());
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    from_mean += from[i] / count;
    to_mean += to[i] / count;
  }
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  double to_scatter = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    cross += (to[i] - to_mean) * (from[i] - from_mean).transpose();
    scatter += (from[i] - from_mean) * (from[i] - from_mean).transpose() / count;
    to_scatter += (to[i] - to_mean).squaredNorm() / count;
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
  flip(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  RigidFit fit;
  fit.to_from.rotation =
      Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * flip * svd.matrixV().transpose()));
  fit.to_from.translation = to_mean - fit.to_from.rotation * from_mean;
  fit.breadth_m = std::sqrt(scatter.jacobiSvd().singularValues()[1]);
  fit.scale = std::sqrt(to_scatter / std::max(scatter.trace(), 1e-12));
  for (std::size_t i = 0; i < from.size(); ++i) {
    fit.worst_m = std::max(fit.worst_m, (fit.to_from * from[i] - to[i]).norm());
  }
  return fit;
}

Points InOrder(const Points& points, const Order& order) {
  Points ordered;
  for (const std::size_t place : order) ordered.push_back(points[place]);
  return ordered;
}

std::size_t Moved(const Order& order) {
  std::size_t moved = 0;
  for (std::size_t i = 0; i < order.size(); ++i) moved += order[i] == i ? 0 : 1;
  return moved;
}

// The order of the LEDs that fits the points, with the fewest names changed.
std::optional<Order> FittingOrder(const Points& from, const Points& to, double most_off_m) {
  Order order(from.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::optional<Order> best;
  const auto consider = [&] {
    if (best && Moved(order) >= Moved(*best)) return;
    if (FitRigid(InOrder(from, order), to).worst_m <= most_off_m) best = order;
  };
  if (from.size() <= kMostForAllOrders) {
    while (std::next_permutation(order.begin(), order.end())) consider();
    return best;
  }
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      std::swap(order[i], order[j]);
      consider();
      std::swap(order[i], order[j]);
    }
  }
  return best;
}

// The one point without which the others fit, and how far it is from where they put it.
std::optional<std::pair<std::size_t, double>> LonelyPoint(const Points& from,
                                                          const Points& to,
                                                          double most_off_m) {
  std::optional<std::pair<std::size_t, double>> lonely;
  double least_m = most_off_m;
  for (std::size_t out = 0; from.size() > 3 && out < from.size(); ++out) {
    Points some_from = from;
    Points some_to = to;
    some_from.erase(some_from.begin() + static_cast<std::ptrdiff_t>(out));
    some_to.erase(some_to.begin() + static_cast<std::ptrdiff_t>(out));
    const RigidFit fit = FitRigid(some_from, some_to);
    if (fit.breadth_m < kLeastBreadth_m || fit.worst_m > least_m) continue;
    least_m = fit.worst_m;
    lonely = {out, (fit.to_from * from[out] - to[out]).norm()};
  }
  return lonely;
}

TargetCalibrationFailure WhyNot(const Order& leds,
                                std::size_t count,
                                const Points& from,
                                const Points& to,
                                const RigidFit& fit,
                                double most_off_m) {
  TargetCalibrationFailure failure;
  Points mirrored = to;
  for (Eigen::Vector3d& point : mirrored) point.x() = -point.x();
  const bool is_mirrored = FitRigid(from, mirrored).worst_m <= most_off_m;
  const auto order = FittingOrder(from, to, most_off_m);
  // A symmetric board in a mirror is the same board with many names exchanged.
  if (order && !(is_mirrored && Moved(*order) > 2)) {
    failure.fault = TargetCalibrationFault::kExchanged;
    failure.really.resize(count);
    std::iota(failure.really.begin(), failure.really.end(), std::size_t{0});
    for (std::size_t i = 0; i < leds.size(); ++i) failure.really[leds[i]] = leds[(*order)[i]];
    return failure;
  }
  if (is_mirrored) {
    failure.fault = TargetCalibrationFault::kMirrored;
    return failure;
  }
  if (const auto lonely = LonelyPoint(from, to, most_off_m)) {
    failure.fault = TargetCalibrationFault::kDoesNotFit;
    failure.wrong = {{{0, leds[lonely->first]}, lonely->second, {}}};
    return failure;
  }
  failure.fault = TargetCalibrationFault::kOtherBoard;
  failure.off_m = fit.worst_m;
  failure.scale = fit.scale;
  return failure;
}

}  // namespace

Result<Rigid3, TargetCalibrationFailure> StartTarget(
    std::span<const Eigen::Vector3d> nominal_m,
    std::span<const std::optional<Eigen::Vector3d>> led_in_site_m,
    double most_off_m) {
  Order leds;
  Points from;
  Points to;
  for (std::size_t j = 0; j < nominal_m.size(); ++j) {
    if (!led_in_site_m[j]) continue;
    leds.push_back(j);
    from.push_back(nominal_m[j]);
    to.push_back(*led_in_site_m[j]);
  }
  TargetCalibrationFailure failure;
  if (from.size() < 3) return Failure{failure};
  const RigidFit fit = FitRigid(from, to);
  if (fit.breadth_m < kLeastBreadth_m) {
    failure.fault = TargetCalibrationFault::kOnOneLine;
    return Failure{failure};
  }
  if (fit.worst_m <= most_off_m) return fit.to_from;
  return Failure{WhyNot(leds, nominal_m.size(), from, to, fit, most_off_m)};
}

}  // namespace tbm
