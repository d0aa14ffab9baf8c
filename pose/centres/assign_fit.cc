#include "pose/centres/assign_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace tbm::assign {
namespace {

// Normal equations of one linearisation.
struct Normal {
  Information information = Information::Zero();
  PoseError gradient = PoseError::Zero();
  double chi2 = 0.0;
};

double FocalPx(const Rig& rig) { return std::max(rig.camera.fx_px, rig.camera.fy_px); }

bool AddLed(const Scene& scene, const Match& match, const Rigid3& pose, Normal& normal) {
  const Led& led = scene.rig->leds[static_cast<std::size_t>(match.led)];
  const Spot& spot = scene.spots[static_cast<std::size_t>(match.spot)];
  const Eigen::Vector3d arm = pose.rotation * led.p_led_in_target;
  const Eigen::Vector3d p_in_camera = arm + pose.translation;
  const double z_m = p_in_camera.z();
  if (!(z_m > 0.5 * scene.options.min_distance_m) || !(z_m < 2.0 * scene.options.max_distance_m)) {
    return false;
  }
  const auto projection = Project(scene.rig->camera, p_in_camera);
  if (!projection) return false;
  const double led_px = FocalPx(*scene.rig) * led.sigma_m / z_m;
  const double weight = 1.0 / (spot.sigma_px * spot.sigma_px + led_px * led_px);
  const Eigen::Vector2d residual_px = spot.pixel_px - projection->pixel_px;
  Eigen::Matrix<double, 2, 6> by_pose;
  by_pose.leftCols<3>().noalias() = projection->by_point_px_per_m * -Skew(arm);
  by_pose.rightCols<3>() = projection->by_point_px_per_m;
  normal.information.noalias() += weight * by_pose.transpose() * by_pose;
  normal.gradient.noalias() += weight * by_pose.transpose() * residual_px;
  normal.chi2 += weight * residual_px.squaredNorm();
  return true;
}

void AddTilts(const UpPair& ups, const Rigid3& pose, Normal& normal) {
  const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
  const Eigen::Vector3d turned = rotation * ups.up_in_target;
  const Eigen::Matrix3d covariance =
      ups.covariance_in_camera + rotation * ups.covariance_in_target * rotation.transpose();
  const Eigen::Vector3d across = ups.up_in_camera.unitOrthogonal();
  Eigen::Matrix<double, 3, 2> basis;
  basis << across, ups.up_in_camera.cross(across);
  const Eigen::Matrix2d weight = (basis.transpose() * covariance * basis).inverse();
  const Eigen::Vector2d residual = basis.transpose() * (ups.up_in_camera - turned);
  const Eigen::Matrix<double, 2, 3> by_turn = basis.transpose() * -Skew(turned);
  normal.information.topLeftCorner<3, 3>().noalias() += by_turn.transpose() * weight * by_turn;
  normal.gradient.head<3>().noalias() += by_turn.transpose() * weight * residual;
  normal.chi2 += residual.dot(weight * residual);
}

void AddPrior(const PriorPull& prior, const Rigid3& pose, Normal& normal) {
  const PoseError error = ErrorBetween(pose, prior.camera_from_target);
  const PoseError pull = prior.information * error;
  normal.information += prior.information;
  normal.gradient += pull;
  normal.chi2 += error.dot(pull);
}

}  // namespace

bool SameMatches(const Matches& a, const Matches& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin());
}

bool Contains(const Matches& larger, const Matches& smaller) {
  return std::all_of(smaller.begin(), smaller.end(), [&](const Match& match) {
    return std::find(larger.begin(), larger.end(), match) != larger.end();
  });
}

void Insert(Matches& matches, const Match& match) {
  matches.push_back(match);
  std::sort(
      matches.begin(), matches.end(), [](const Match& a, const Match& b) { return a.led < b.led; });
}

bool Refine(const Scene& scene, const Matches& matches, UsePrior use_prior, Fit& fit) {
  constexpr int kMaxSteps = 8;
  constexpr double kSettled = 1e-4;  // step^2 in sigmas
  for (int step = 0; step < kMaxSteps; ++step) {
    Normal normal;
    for (const Match& match : matches) {
      if (!AddLed(scene, match, fit.camera_from_target, normal)) return false;
    }
    if (scene.ups) AddTilts(*scene.ups, fit.camera_from_target, normal);
    if (use_prior == UsePrior::kYes) AddPrior(*scene.prior, fit.camera_from_target, normal);
    const PoseError move = normal.information.ldlt().solve(normal.gradient);
    const double gain = move.dot(normal.gradient);
    if (!move.allFinite() || move.head<3>().norm() > 1.0) return false;
    fit.camera_from_target = Moved(fit.camera_from_target, move);
    fit.information = normal.information;
    fit.chi2 = std::max(0.0, normal.chi2 - gain);
    if (gain < kSettled) return true;
  }
  return false;
}

bool Expect(const Scene& scene,
            int led_index,
            const Rigid3& pose,
            const PoseCovariance& covariance,
            Expected& expected) {
  const Led& led = scene.rig->leds[static_cast<std::size_t>(led_index)];
  const auto projection = Project(scene.rig->camera, pose * led.p_led_in_target);
  if (!projection) return false;
  const Eigen::Matrix<double, 2, 6> by_pose =
      projection->by_point_px_per_m * PointByError(pose, led.p_led_in_target);
  expected.pixel_px = projection->pixel_px;
  expected.covariance = by_pose * covariance * by_pose.transpose() +
                        led.sigma_m * led.sigma_m * projection->by_point_px_per_m *
                            projection->by_point_px_per_m.transpose();
  return true;
}

bool Extend(const Scene& scene, UsePrior use_prior, Matches& matches, Fit& fit) {
  std::uint64_t spots_taken = 0;
  std::uint32_t leds_taken = 0;
  for (const Match& match : matches) {
    spots_taken |= std::uint64_t{1} << match.spot;
    leds_taken |= std::uint32_t{1} << match.led;
  }
  const int led_count = static_cast<int>(scene.rig->leds.size());
  const int spot_count = static_cast<int>(scene.spots.size());
  while (static_cast<int>(matches.size()) < std::min(led_count, spot_count)) {
    const PoseCovariance covariance = fit.information.ldlt().solve(PoseCovariance::Identity());
    double nearest = scene.options.gate_sigma * scene.options.gate_sigma;
    std::optional<Match> found;
    for (int led = 0; led < led_count; ++led) {
      if ((leds_taken >> led) & 1u) continue;
      Expected expected;
      if (!Expect(scene, led, fit.camera_from_target, covariance, expected)) continue;
      for (int s = 0; s < spot_count; ++s) {
        if ((spots_taken >> s) & 1u) continue;
        const Spot& spot = scene.spots[static_cast<std::size_t>(s)];
        const Eigen::Vector2d off_px = spot.pixel_px - expected.pixel_px;
        Eigen::Matrix2d spread = expected.covariance;
        spread.diagonal().array() += spot.sigma_px * spot.sigma_px;
        if (off_px.squaredNorm() > nearest * spread.trace()) continue;
        const double distance = off_px.dot(spread.inverse() * off_px);
        if (distance < nearest) {
          nearest = distance;
          found = Match{led, s};
        }
      }
    }
    if (!found) return true;
    Insert(matches, *found);
    spots_taken |= std::uint64_t{1} << found->spot;
    leds_taken |= std::uint32_t{1} << found->led;
    if (!Refine(scene, matches, use_prior, fit)) return false;
  }
  return true;
}

double Chi2Gate(double dof, double gate_sigma) {
  if (dof <= 0.0) return 0.0;
  const double part = 2.0 / (9.0 * dof);
  const double root = 1.0 - part + gate_sigma * std::sqrt(part);
  return dof * root * root * root;
}

}  // namespace tbm::assign
