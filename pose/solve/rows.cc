#include "pose/solve/rows.h"

#include <algorithm>
#include <cmath>

namespace tbm {

bool RowsOfLed(const Rig& rig,
               const LedObservation& led,
               const Eigen::Matrix3d& camera_from_target,
               const Eigen::Vector3d& translation,
               LedRows& rows) {
  const Eigen::Vector3d& p_led_in_target =
      rig.leds[static_cast<std::size_t>(led.led_index)].p_led_in_target;
  const Eigen::Vector3d arm = camera_from_target * p_led_in_target;
  const auto projection = Project(rig.camera, arm + translation);
  if (!projection) return false;
  const Eigen::Matrix<double, 2, 3>& by_point = projection->by_point_px_per_m;
  rows.residual_px = led.pixel_px - projection->pixel_px;
  // A row p of by_point meets turn x arm as turn . (arm x p).
  rows.by_pose.col(0) = arm.y() * by_point.col(2) - arm.z() * by_point.col(1);
  rows.by_pose.col(1) = arm.z() * by_point.col(0) - arm.x() * by_point.col(2);
  rows.by_pose.col(2) = arm.x() * by_point.col(1) - arm.y() * by_point.col(0);
  rows.by_pose.rightCols<3>() = by_point;
  rows.by_focal_length.x() = (projection->pixel_px.x() - rig.camera.cx_px) / rig.camera.fx_px;
  rows.by_focal_length.y() = (projection->pixel_px.y() - rig.camera.cy_px) / rig.camera.fy_px;
  return true;
}

Eigen::Matrix2d CovarianceOfLed(const Rig& rig, const LedObservation& led, const LedRows& rows) {
  const double centre_px = std::max(led.sigma_px, kLeastCentreSigmaPx);
  const double residual_px = rig.calibration_residual_px;
  const double led_m = rig.leds[static_cast<std::size_t>(led.led_index)].sigma_m;
  Eigen::Matrix2d covariance = (led_m * led_m) * (rows.by_point() * rows.by_point().transpose());
  covariance.diagonal().array() += centre_px * centre_px + residual_px * residual_px;
  return covariance;
}

Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& up) {
  int smallest = 0;
  up.cwiseAbs().minCoeff(&smallest);
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = up.cross(Eigen::Vector3d::Unit(smallest)).normalized();
  basis.col(1) = up.cross(basis.col(0));
  return basis;
}

std::optional<TiltConstraint> TiltConstraint::From(const PoseProblem& problem) {
  if (!problem.target_tilt || !problem.camera_tilt) return std::nullopt;
  const TiltObservation& target = *problem.target_tilt;
  const TiltObservation& camera = *problem.camera_tilt;
  const auto up_in_target_tilt = UpInTilt(target.inclination);
  const auto up_in_camera_tilt = UpInTilt(camera.inclination);
  if (!up_in_target_tilt || !up_in_camera_tilt) return std::nullopt;

  const TiltMount& target_mount = problem.rig->target_tilt;
  const TiltMount& camera_mount = problem.rig->camera_tilt;
  const double target_rad = std::max(target.sigma_rad, kLeastTiltSigmaRad);
  const double camera_rad = std::max(camera.sigma_rad, kLeastTiltSigmaRad);
  TiltConstraint tilts;
  tilts.up_in_target = target_mount.tilt_from_body.transpose() * *up_in_target_tilt;
  tilts.up_in_camera = camera_mount.tilt_from_body.transpose() * *up_in_camera_tilt;
  tilts.basis = TangentBasis(tilts.up_in_camera);
  tilts.target_deviation =
      target_rad * (target_mount.tilt_from_body.transpose() * UpByInclination(target.inclination));
  const Eigen::Matrix2d camera_deviation =
      camera_rad * (tilts.basis.transpose() * camera_mount.tilt_from_body.transpose() *
                    UpByInclination(camera.inclination));
  tilts.camera_covariance = camera_deviation * camera_deviation.transpose();
  // A mounting turned by w moves the up vector by w x up: the same sigma along every tangent.
  tilts.camera_covariance.diagonal().array() +=
      target_mount.mounting_sigma_rad * target_mount.mounting_sigma_rad +
      camera_mount.mounting_sigma_rad * camera_mount.mounting_sigma_rad;
  return tilts;
}

TiltConstraint::Rows TiltConstraint::At(const Eigen::Matrix3d& camera_from_target) const {
  const Eigen::Vector3d turned_up = camera_from_target * up_in_target;
  const Eigen::Matrix2d deviation =
      basis.transpose() * (camera_from_target * target_deviation).eval();
  Rows rows;
  rows.residual.noalias() = -basis.transpose() * turned_up;  // B^T u_C is zero
  rows.by_turn.row(0) = turned_up.cross(basis.col(0)).transpose();
  rows.by_turn.row(1) = turned_up.cross(basis.col(1)).transpose();
  rows.covariance = camera_covariance + deviation * deviation.transpose();
  return rows;
}

}  // namespace tbm
