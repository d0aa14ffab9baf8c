#include "pose/centres/assign_scene.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace tbm::assign {
namespace {

bool Brighter(const Centre& a, const Centre& b) {
  return std::make_tuple(-a.peak_dn, a.pixel_px.x(), a.pixel_px.y()) <
         std::make_tuple(-b.peak_dn, b.pixel_px.x(), b.pixel_px.y());
}

bool IsUsable(const Centre& centre) {
  return centre.sigma_px <= kLargestSigmaPx && centre.pixel_px.allFinite() &&
         std::isfinite(centre.peak_dn) && std::isfinite(centre.sigma_px) && centre.sigma_px >= 0.0;
}

Spots SortedSpots(const Rig& rig, const Centres& centres) {
  FixedVector<int, kMaxCentres> order;
  for (std::size_t i = 0; i < centres.size(); ++i) {
    if (IsUsable(centres[i])) order.push_back(static_cast<int>(i));
  }
  const auto centre = [&](int i) -> const Centre& { return centres[static_cast<std::size_t>(i)]; };
  std::sort(
      order.begin(), order.end(), [&](int a, int b) { return Brighter(centre(a), centre(b)); });
  Spots spots;
  for (const int i : order) {
    const auto point = NormalisedFromPixel(rig.camera, centre(i).pixel_px);
    if (!point) continue;
    Spot spot;
    spot.pixel_px = centre(i).pixel_px;
    spot.ray_in_camera = point->homogeneous();
    spot.own_sigma_px = std::max(kLeastSigmaPx, centre(i).sigma_px);
    spot.sigma_px = std::hypot(spot.own_sigma_px, rig.calibration_residual_px);
    spot.index = i;
    spots.push_back(spot);
  }
  return spots;
}

// Area of the rectangle over which an even scatter would have the covariance of the spots. Never
// more than the image; never less than a small target would cover, for spots on one line.
double SpotArea(const Rig& rig, const Spots& spots) {
  constexpr double kLeastAreaPx2 = 3e4;
  const double image_px2 =
      static_cast<double>(rig.camera.image_width_px) * rig.camera.image_height_px;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Spot& spot : spots) mean += spot.pixel_px;
  const double count = static_cast<double>(spots.size());
  mean /= std::max(1.0, count);
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Spot& spot : spots) {
    scatter += (spot.pixel_px - mean) * (spot.pixel_px - mean).transpose();
  }
  scatter /= std::max(1.0, count - 1.0);
  const double even_px2 = 12.0 * std::sqrt(std::max(0.0, scatter.determinant()));
  return std::clamp(even_px2, kLeastAreaPx2, std::max(kLeastAreaPx2, image_px2));
}

Eigen::Matrix3d UpCovariance(const TiltMount& mount,
                             const TiltObservation& tilt,
                             const Eigen::Vector3d& up_in_body) {
  const Eigen::Matrix<double, 3, 2> by_reading =
      mount.tilt_from_body.transpose() * UpByInclination(tilt.inclination);
  const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - up_in_body * up_in_body.transpose();
  return tilt.sigma_rad * tilt.sigma_rad * (by_reading * by_reading.transpose()) +
         mount.mounting_sigma_rad * mount.mounting_sigma_rad * across;
}

std::optional<UpPair> Ups(const Rig& rig,
                          const std::optional<TiltObservation>& target_tilt,
                          const std::optional<TiltObservation>& camera_tilt) {
  if (!target_tilt || !camera_tilt) return std::nullopt;
  if (!std::isfinite(target_tilt->sigma_rad) || !std::isfinite(camera_tilt->sigma_rad)) {
    return std::nullopt;
  }
  const auto up_in_target_tilt = UpInTilt(target_tilt->inclination);
  const auto up_in_camera_tilt = UpInTilt(camera_tilt->inclination);
  if (!up_in_target_tilt || !up_in_camera_tilt) return std::nullopt;
  UpPair ups;
  ups.up_in_target = rig.target_tilt.tilt_from_body.transpose() * *up_in_target_tilt;
  ups.up_in_camera = rig.camera_tilt.tilt_from_body.transpose() * *up_in_camera_tilt;
  ups.covariance_in_target = UpCovariance(rig.target_tilt, *target_tilt, ups.up_in_target);
  ups.covariance_in_camera = UpCovariance(rig.camera_tilt, *camera_tilt, ups.up_in_camera);
  const Eigen::Vector3d boresight_rad(rig.intrinsics_sigma_px[3] / rig.camera.fy_px,
                                      rig.intrinsics_sigma_px[2] / rig.camera.fx_px,
                                      0.0);
  const Eigen::Matrix3d by_boresight = Skew(ups.up_in_camera);
  ups.covariance_in_camera += by_boresight * boresight_rad.array().square().matrix().asDiagonal() *
                              by_boresight.transpose();
  // Exact tilts still need a weight that can be inverted: a tenth of the best inclinometer there
  // is.
  constexpr double kLeastSigmaRad = 2e-6;
  ups.covariance_in_camera.diagonal().array() += kLeastSigmaRad * kLeastSigmaRad;
  return ups;
}

std::optional<PriorPull> Pull(const std::optional<PosePrior>& prior) {
  if (!prior || !prior->covariance.allFinite()) return std::nullopt;
  if (!prior->camera_from_target.translation.allFinite()) return std::nullopt;
  if (!prior->camera_from_target.rotation.coeffs().allFinite()) return std::nullopt;
  // No pose is known better than a microradian and ten micrometres from one frame to the next.
  PoseCovariance covariance = prior->covariance;
  covariance.diagonal().head<3>().array() += 1e-12;
  covariance.diagonal().tail<3>().array() += 1e-10;
  const Eigen::LLT<PoseCovariance> factor(covariance);
  if (factor.info() != Eigen::Success) return std::nullopt;
  return PriorPull{prior->camera_from_target, factor.solve(Information::Identity())};
}

}  // namespace

double UpSigma(const UpPair& ups) {
  return std::sqrt(0.5 * (ups.covariance_in_camera.trace() + ups.covariance_in_target.trace()));
}

Scene MakeScene(const Rig& rig,
                const Centres& centres,
                const std::optional<TiltObservation>& target_tilt,
                const std::optional<TiltObservation>& camera_tilt,
                const std::optional<PosePrior>& prior,
                const AssignOptions& options) {
  Scene scene;
  scene.rig = &rig;
  scene.options = options;
  scene.spots = SortedSpots(rig, centres);
  scene.spot_area_px2 = SpotArea(rig, scene.spots);
  scene.ups = Ups(rig, target_tilt, camera_tilt);
  if (scene.ups) {
    scene.target_tilt = target_tilt;
    scene.camera_tilt = camera_tilt;
  }
  scene.ups_are_sharp = scene.ups && UpSigma(*scene.ups) <= kSharpUpSigmaRad;
  scene.prior = Pull(prior);
  return scene;
}

Scene Doubting(const Scene& scene) {
  Scene doubting = scene;
  if (!scene.ups) return doubting;
  doubting.target_tilt->sigma_rad = kDoubtSigmaRad;
  doubting.camera_tilt->sigma_rad = kDoubtSigmaRad;
  doubting.ups = Ups(*scene.rig, doubting.target_tilt, doubting.camera_tilt);
  doubting.ups_are_sharp = false;
  return doubting;
}

}  // namespace tbm::assign
