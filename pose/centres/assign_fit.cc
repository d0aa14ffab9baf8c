#include "pose/centres/assign_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "pose/solve/rows.h"

namespace tbm::assign {
namespace {

// Normal equations of one linearisation; of the matrix the lower triangle.
struct Normal {
  Information information = Information::Zero();
  PoseError gradient = PoseError::Zero();
  double chi2 = 0.0;
};

double FocalPx(const Rig& rig) { return std::max(rig.camera.fx_px, rig.camera.fy_px); }

// Adds weight times the products of two rows of kUnknowns derivatives each.
template <int kUnknowns>
void AddRows(const double (&rows)[2][kUnknowns],
             const Eigen::Vector2d& residual,
             const Eigen::Vector2d& weight,
             Normal& normal) {
  for (int a = 0; a < kUnknowns; ++a) {
    const double first = weight[0] * rows[0][a];
    const double second = weight[1] * rows[1][a];
    for (int b = 0; b <= a; ++b) {
      normal.information(a, b) += first * rows[0][b] + second * rows[1][b];
    }
    normal.gradient[a] += first * residual[0] + second * residual[1];
  }
  normal.chi2 += weight[0] * residual[0] * residual[0] + weight[1] * residual[1] * residual[1];
}

bool AddLed(const Scene& scene,
            const Match& match,
            const Eigen::Matrix3d& rotation,
            const Eigen::Vector3d& translation,
            Normal& normal) {
  const Led& led = scene.rig->leds[static_cast<std::size_t>(match.led)];
  const Spot& spot = scene.spots[static_cast<std::size_t>(match.spot)];
  const Eigen::Vector3d arm = rotation * led.p_led_in_target;
  const Eigen::Vector3d p_in_camera = arm + translation;
  const double z_m = p_in_camera.z();
  if (!(z_m > 0.5 * scene.options.min_distance_m) || !(z_m < 2.0 * scene.options.max_distance_m)) {
    return false;
  }
  const auto projection = Project(scene.rig->camera, p_in_camera);
  if (!projection) return false;
  const double led_px = FocalPx(*scene.rig) * led.sigma_m / z_m;
  const double weight = 1.0 / (spot.sigma_px * spot.sigma_px + led_px * led_px);
  // A row p of the derivative by the point meets turn x arm as turn . (arm x p).
  double rows[2][6];
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3d by_point = projection->by_point_px_per_m.row(i).transpose();
    const Eigen::Vector3d by_turn = arm.cross(by_point);
    for (int k = 0; k < 3; ++k) {
      rows[i][k] = by_turn[k];
      rows[i][3 + k] = by_point[k];
    }
  }
  AddRows(rows, spot.pixel_px - projection->pixel_px, Eigen::Vector2d::Constant(weight), normal);
  return true;
}

void AddTilts(const UpPair& ups, const Eigen::Matrix3d& rotation, Normal& normal) {
  const Eigen::Vector3d turned = rotation * ups.up_in_target;
  Eigen::Matrix<double, 3, 2> basis = TangentBasis(ups.up_in_camera);
  const Eigen::Matrix<double, 3, 2> in_target = rotation.transpose() * basis;
  const Eigen::Matrix2d covariance =
      basis.transpose() * (ups.covariance_in_camera * basis).eval() +
      in_target.transpose() * (ups.covariance_in_target * in_target).eval();
  // Both components at once along the axes of their covariance's root: two rows of unit variance.
  const double inverse_l00 = 1.0 / std::sqrt(covariance(0, 0));
  const double l10 = covariance(1, 0) * inverse_l00;
  const double inverse_l11 = 1.0 / std::sqrt(covariance(1, 1) - l10 * l10);
  basis.col(0) *= inverse_l00;
  basis.col(1) = inverse_l11 * (basis.col(1) - l10 * basis.col(0));
  double rows[2][3];
  Eigen::Vector2d residual;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3d axis = basis.col(i);
    const Eigen::Vector3d by_turn = turned.cross(axis);
    for (int k = 0; k < 3; ++k) rows[i][k] = by_turn[k];
    residual[i] = axis.dot(ups.up_in_camera - turned);
  }
  AddRows(rows, residual, Eigen::Vector2d::Ones(), normal);
}

void AddPrior(const PriorPull& prior, const Rigid3& pose, Normal& normal) {
  const PoseError error = ErrorBetween(pose, prior.camera_from_target);
  for (int a = 0; a < 6; ++a) {
    double pull = 0.0;
    for (int b = 0; b < 6; ++b) pull += prior.information(a, b) * error[b];
    for (int b = 0; b <= a; ++b) normal.information(a, b) += prior.information(a, b);
    normal.gradient[a] += pull;
    normal.chi2 += error[a] * pull;
  }
}

}  // namespace

bool SameMatches(const Matches& a, const Matches& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin());
}

bool Contains(const Matches& larger, std::span<const Match> smaller) {
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
    const Eigen::Matrix3d rotation = fit.camera_from_target.rotation.toRotationMatrix();
    Normal normal;
    for (const Match& match : matches) {
      if (!AddLed(scene, match, rotation, fit.camera_from_target.translation, normal)) return false;
    }
    if (scene.ups) AddTilts(*scene.ups, rotation, normal);
    if (use_prior == UsePrior::kYes) AddPrior(*scene.prior, fit.camera_from_target, normal);
    Factor6 factor;
    if (!Factorise(normal.information, 0.0, factor)) return false;
    const PoseError move = SolveWith(factor, normal.gradient);
    const double gain = move.dot(normal.gradient);
    if (!move.allFinite() || move.head<3>().norm() > 1.0) return false;
    fit.camera_from_target = Moved(fit.camera_from_target, move);
    fit.factor = factor;
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
  const Eigen::Matrix<double, 2, 3>& by_point = projection->by_point_px_per_m;
  const Eigen::Vector3d arm = pose.rotation * led.p_led_in_target;
  Eigen::Matrix<double, 6, 2> by_pose;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3d row = by_point.row(i).transpose();
    by_pose.col(i).head<3>() = arm.cross(row);
    by_pose.col(i).tail<3>() = row;
  }
  expected.pixel_px = projection->pixel_px;
  const Eigen::Matrix<double, 6, 2> spread = covariance.lazyProduct(by_pose);
  const double led_variance_m2 = led.sigma_m * led.sigma_m;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      expected.covariance(i, j) = by_pose.col(i).dot(spread.col(j)) +
                                  led_variance_m2 * by_point.row(i).dot(by_point.row(j));
    }
  }
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
    const PoseCovariance covariance = InverseOf(fit.factor);
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
